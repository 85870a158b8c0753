#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/checkpoint_file.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class CheckpointFileTest : public ::testing::Test {
 protected:
  CheckpointFileTest()
      : folder_(::testing::TempDir() + "checkpoint_file_test_" +
                std::to_string(getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~CheckpointFileTest() override { fs::remove_all(folder_); }

  CheckpointFile Make(const std::string& seed, double every = 0.0) const {
    return CheckpointFile(
        path(),
        [seed] {
          return CheckpointFile::Identity{{"--seed", seed}, {"a\xff", "b\xff"}};
        },
        every);
  }
  fs::path path() const { return folder_ / CheckpointFile::kName; }
  std::string Content() const {
    std::ifstream file(path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void Write(const std::string& content) const {
    std::ofstream(path(), std::ios::binary) << content;
  }
  std::string ReasonNotToRead() const {
    try {
      Make("1").Read();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
};

TEST_F(CheckpointFileTest, KeepsAStateUntilTheRunHasEnded) {
  EXPECT_EQ(Make("1").Read(), std::nullopt);
  const std::string state("a\n\0b\xff", 5);
  Make("1").Offer([&] { return state; });
  CheckpointFile other = Make("1");
  EXPECT_EQ(other.Read(), state);
  // One that has neither read nor written it leaves it alone.
  Make("1").Remove();
  EXPECT_TRUE(fs::exists(path()));
  other.Remove();
  EXPECT_FALSE(fs::exists(path()));
}

TEST_F(CheckpointFileTest, IsNotWrittenTooOften) {
  CheckpointFile checkpoint = Make("1", 1000.0);
  checkpoint.Offer([]() -> std::string { throw 1; });
  EXPECT_FALSE(fs::exists(path()));
}

TEST_F(CheckpointFileTest, RefusesTheStateOfAnotherRun) {
  Make("2").Offer([] { return "state"; });
  EXPECT_THAT(ReasonNotToRead(),
              HasSubstr("--seed was '2' then and is '1' now"));
  EXPECT_TRUE(fs::exists(path()));
}

TEST_F(CheckpointFileTest, RefusesWhatIsDamaged) {
  Make("1").Offer([] { return "state"; });
  const std::string whole = Content();
  // Any byte but those of the first line.
  for (std::size_t i = 23; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] ^= 1;
    Write(damaged);
    EXPECT_THAT(ReasonNotToRead(), HasSubstr("damaged")) << i;
  }
  for (std::size_t size = 23; size < whole.size(); ++size) {
    Write(whole.substr(0, size));
    EXPECT_THAT(ReasonNotToRead(), HasSubstr("damaged")) << size;
  }
}

TEST_F(CheckpointFileTest, SomebodyElsesFileStays) {
  for (const std::string content :
       {"", "thesis", "plumbline checkpoint 12\n"}) {
    Write(content);
    EXPECT_THAT(ReasonNotToRead(), HasSubstr("is no checkpoint"));
    EXPECT_THROW(Make("1").Offer([] { return "state"; }), Error);
    Make("1").Remove();
    EXPECT_EQ(Content(), content);
  }
  fs::remove(path());
  fs::create_directory(path());
  EXPECT_THAT(ReasonNotToRead(), HasSubstr("is no checkpoint"));
}

}  // namespace
}  // namespace plumbline
