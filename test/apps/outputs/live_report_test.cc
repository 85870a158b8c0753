#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/outputs/live_report.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::EndsWith;
using ::testing::HasSubstr;

class LiveReportTest : public ::testing::Test {
 protected:
  LiveReportTest()
      : folder_(fs::temp_directory_path() /
                ("plumbline_live_report_test_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~LiveReportTest() override { fs::remove_all(folder_); }

  Report Titled(const std::string& title) {
    ++made_;
    Report report;
    report.graph = &graph_;
    report.title = title;
    return report;
  }

  static std::string Text(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  fs::path folder_;
  Graph graph_;
  int made_ = 0;
};

TEST_F(LiveReportTest, PagesAreRenewedUntilTheLast) {
  const fs::path page = folder_ / "live/report.html";
  LiveReport live(folder_ / "live", 1e-9);
  EXPECT_FALSE(fs::exists(page));
  live.Offer("scans, 7 of 9", [&] { return Titled("first"); });
  EXPECT_EQ(made_, 1);
  std::string text = Text(page);
  EXPECT_THAT(text, HasSubstr(R"("live":{"stage":"scans, 7 of 9",)"));
  EXPECT_THAT(text, HasSubstr(R"("title":"first")"));
  EXPECT_THAT(text, EndsWith("</html>\n"));

  // The run wrote none.
  live.Finish("", [&] { return Titled("last"); });
  text = Text(page);
  EXPECT_THAT(text, HasSubstr(R"("live":null)"));
  EXPECT_THAT(text, HasSubstr(R"("title":"last")"));

  // It wrote one.
  std::ofstream(folder_ / "report.html") << "the page of the run";
  live.Finish(folder_ / "report.html", [&] { return Titled("no"); });
  EXPECT_EQ(Text(page), "the page of the run");
  EXPECT_EQ(made_, 2);
  // Nothing else is left there.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "live"),
                          fs::directory_iterator()),
            1);
}

TEST_F(LiveReportTest, PagesAreNotMadeBeforeTheyAreDue) {
  LiveReport late(folder_, 1e6);
  EXPECT_FALSE(late.IsDue());
  late.Offer("start", [&] { return Titled("early"); });
  EXPECT_EQ(made_, 0);
  EXPECT_FALSE(fs::exists(folder_ / "report.html"));

  // One that takes long is not made again soon: 0.5 s are 5 % of 10 s.
  LiveReport costly(folder_, 1e-9);
  costly.Offer("start", [&] {
    usleep(500000);
    return Titled("costly");
  });
  EXPECT_EQ(made_, 1);
  EXPECT_FALSE(costly.IsDue());
  costly.Offer("start", [&] { return Titled("again"); });
  EXPECT_EQ(made_, 1);
}

TEST_F(LiveReportTest, NothingOfOthersIsReplaced) {
  std::ofstream(folder_ / "report.html") << "somebody's page";
  try {
    const LiveReport live(folder_, 1.0);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("is there and is no report"));
  }
  EXPECT_THROW(LiveReport(folder_ / "report.html/live", 1.0), Error);
  // Nor is a pipe waited for.
  std::filesystem::create_directories(folder_ / "pipe");
  ASSERT_EQ(mkfifo((folder_ / "pipe/report.html").c_str(), 0600), 0);
  EXPECT_THROW(LiveReport(folder_ / "pipe", 1.0), Error);
  // A report may be replaced.
  WriteReport(Titled("earlier"), (folder_ / "report.html").string());
  EXPECT_NO_THROW(LiveReport(folder_, 1.0));
}

}  // namespace
}  // namespace plumbline
