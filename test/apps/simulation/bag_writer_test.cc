#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/error.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class WriteRosbag2Test : public ::testing::Test {
 protected:
  WriteRosbag2Test() {
    std::string name = (fs::temp_directory_path() / "plumblineXXXXXX").string();
    folder_ = mkdtemp(name.data());
    bag_ = folder_ / "bag";
  }
  ~WriteRosbag2Test() override { fs::remove_all(folder_); }

  static std::vector<BagRecord> Messages(int count) {
    std::vector<BagRecord> records;
    for (int i = 0; i < count; ++i) {
      OdometryMessage message;
      message.header = {1000000000LL * i, "odom"};
      message.child_frame = "base_link";
      records.push_back({"/odom", "nav_msgs/Odometry", message.header.stamp,
                         EncodeOdometry(message, MessageEncoding::kCdr)});
    }
    return records;
  }

  // What is in the folder, by name.
  std::map<std::string, std::string> Files() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(bag_)) {
      std::ifstream file(entry.path(), std::ios::binary);
      files[entry.path().filename()] = {std::istreambuf_iterator<char>(file),
                                        {}};
    }
    return files;
  }

  void Put(const std::string& name, const std::string& text) const {
    fs::create_directories(bag_);
    std::ofstream(bag_ / name, std::ios::app) << text;
  }

  void ExpectRefused() const {
    const std::map<std::string, std::string> before = Files();
    try {
      WriteRosbag2(Messages(3), bag_);
      ADD_FAILURE() << "was replaced";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("a new or empty folder"));
    }
    EXPECT_EQ(Files(), before);
  }

  fs::path folder_, bag_;
};

TEST_F(WriteRosbag2Test, ABagOfItsOwnIsReplaced) {
  fs::create_directories(bag_);
  WriteRosbag2(Messages(3), bag_);
  const std::map<std::string, std::string> three = Files();
  EXPECT_EQ(three.size(), 2u);
  EXPECT_THAT(three.at("metadata.yaml"), HasSubstr("message_count: 3"));
  WriteRosbag2(Messages(5), bag_);
  EXPECT_THAT(Files().at("metadata.yaml"), HasSubstr("message_count: 5"));
  EXPECT_EQ(Files().size(), 2u);
  WriteRosbag2(Messages(3), bag_);
  EXPECT_EQ(Files(), three);
}

// Somebody's day of driving, in a folder of the name that was typed.
TEST_F(WriteRosbag2Test, ABagOfSomebodyElseStays) {
  Put("metadata.yaml", "rosbag2_bagfile_information:\n  version: 5\n");
  Put("bag_0.db3", "a day of driving");
  ExpectRefused();
}

TEST_F(WriteRosbag2Test, ABagThatWasAddedToStays) {
  WriteRosbag2(Messages(3), bag_);
  Put("thesis.tex", "years of work");
  ExpectRefused();
}

TEST_F(WriteRosbag2Test, ABagThatWasChangedStays) {
  for (const char* name : {"metadata.yaml", "bag_0.db3"}) {
    SCOPED_TRACE(name);
    fs::remove_all(bag_);
    WriteRosbag2(Messages(3), bag_);
    Put(name, "# a remark\n");
    ExpectRefused();
  }
}

// The message of writing so many messages with a limit on the size of files.
std::string WhyNotWithin(rlim_t limit, const std::vector<BagRecord>& messages,
                         const fs::path& bag) {
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = limit;
  setrlimit(RLIMIT_FSIZE, &small);
  std::string what;
  try {
    WriteRosbag2(messages, bag);
  } catch (const Error& error) {
    what = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  return what;
}

TEST_F(WriteRosbag2Test, ABagThatCannotBeWrittenLeavesTheOneBefore) {
  WriteRosbag2(Messages(3), bag_);
  const std::map<std::string, std::string> old = Files();
  EXPECT_THAT(WhyNotWithin(4096, Messages(500), bag_),
              HasSubstr("File too large"));
  EXPECT_EQ(Files(), old);
  WriteRosbag2(Messages(5), bag_);
  EXPECT_THAT(Files().at("metadata.yaml"), HasSubstr("message_count: 5"));
}

TEST_F(WriteRosbag2Test, ABagThatCannotBeWrittenLeavesNothingOfItself) {
  EXPECT_THAT(WhyNotWithin(4096, Messages(500), bag_ / "deep" / "bag"),
              HasSubstr("File too large"));
  EXPECT_FALSE(fs::exists(bag_));
  // A folder that was there stays.
  fs::create_directories(bag_);
  EXPECT_THAT(WhyNotWithin(4096, Messages(500), bag_),
              HasSubstr("File too large"));
  EXPECT_TRUE(Files().empty());
}

// The description that a run leaves that is killed between the files tells no
// more than whose they are.
TEST_F(WriteRosbag2Test, HalfABagIsReplaced) {
  WriteRosbag2(Messages(3), bag_);
  fs::remove(bag_ / "bag_0.db3");
  WriteRosbag2(Messages(5), bag_);
  EXPECT_THAT(Files().at("metadata.yaml"), HasSubstr("message_count: 5"));
}

}  // namespace
}  // namespace plumbline
