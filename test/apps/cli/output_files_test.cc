#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/cli/output_files.h>
#include <plumbline/core/error.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class OutputFilesTest : public ::testing::Test {
 protected:
  OutputFilesTest() {
    std::string name = (fs::temp_directory_path() / "plumblineXXXXXX").string();
    folder_ = mkdtemp(name.data());
    std::ofstream(folder_ / "path.tum") << "1 0 0 0 0 0 0 1\n";
  }
  ~OutputFilesTest() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return folder_ / name; }

  // The message, or nothing.
  static std::string Refusal(const std::vector<FlagFile>& inputs,
                             const std::vector<FlagFile>& outputs) {
    try {
      CheckOutputFiles(inputs, outputs);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
};

TEST_F(OutputFilesTest, AnInputIsNoOutputByWhateverName) {
  fs::create_symlink(folder_ / "path.tum", folder_ / "link");
  fs::create_hard_link(folder_ / "path.tum", folder_ / "twin");
  fs::create_directories(folder_ / "sub");
  for (const char* name :
       {"path.tum", "./path.tum", "sub/../path.tum", "link", "twin"}) {
    const std::string refusal = Refusal({{"trajectory", Path("path.tum")}},
                                        {{"pose_errors", Path(name)}});
    EXPECT_THAT(refusal, HasSubstr("--pose_errors: ")) << name;
    EXPECT_THAT(refusal, HasSubstr("what --trajectory reads")) << name;
  }
  EXPECT_EQ(Refusal({{"trajectory", Path("path.tum")}, {"reference", ""}},
                    {{"pose_errors", Path("new.csv")}, {"plot", ""}}),
            "");
}

TEST_F(OutputFilesTest, TwoOutputsAreTwoFiles) {
  fs::create_directory_symlink(folder_, folder_ / "here");
  for (const char* name : {"new.csv", "here/new.csv", "path.tum"}) {
    const std::string first =
        std::string(name) == "path.tum" ? "path.tum" : "new.csv";
    EXPECT_THAT(
        Refusal({}, {{"output", Path(first)}, {"pose_errors", Path(name)}}),
        HasSubstr("is written for --output already"))
        << name;
  }
  // Links to a file that is not there yet, one of them by way of another.
  fs::create_symlink("new.csv", folder_ / "link.csv");
  fs::create_symlink(folder_ / "link.csv", folder_ / "chain.csv");
  fs::create_symlink("loop.csv", folder_ / "loop.csv");
  for (const char* name : {"link.csv", "chain.csv"}) {
    EXPECT_THAT(
        Refusal({}, {{"output", Path("new.csv")}, {"truth", Path(name)}}),
        HasSubstr("is written for --output already"))
        << name;
    EXPECT_EQ(
        Refusal({}, {{"output", Path("other.csv")}, {"truth", Path(name)}}), "")
        << name;
  }
  EXPECT_EQ(
      Refusal({}, {{"output", Path("new.csv")}, {"truth", Path("loop.csv")}}),
      "");
  EXPECT_EQ(Refusal({{"world", "/dev/null"}},
                    {{"output", "/dev/null"}, {"truth", "/dev/null"}}),
            "");
}

}  // namespace
}  // namespace plumbline
