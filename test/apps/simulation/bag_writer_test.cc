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

// A run that ends between the files, as here by a limit on their size, says so
// and can be repeated.
TEST_F(WriteRosbag2Test, HalfABagIsReplaced) {
  WriteRosbag2(Messages(3), bag_);
  const std::string old = Files().at("bag_0.db3");
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 4096;
  setrlimit(RLIMIT_FSIZE, &small);
  std::string what;
  try {
    WriteRosbag2(Messages(500), bag_);
  } catch (const Error& error) {
    what = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(what, HasSubstr("File too large"));
  EXPECT_EQ(Files().at("bag_0.db3"), old);
  EXPECT_THAT(Files().at("metadata.yaml"),
              ::testing::Not(HasSubstr("relative_file_paths")));
  WriteRosbag2(Messages(5), bag_);
  EXPECT_THAT(Files().at("metadata.yaml"), HasSubstr("message_count: 5"));
}

}  // namespace
}  // namespace plumbline
