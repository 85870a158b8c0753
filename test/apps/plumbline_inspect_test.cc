#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/shell.h"

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// Runs the binary on logs of a small drive, in every format.
class InspectTest : public ::testing::Test {
 protected:
  void SetUp() override {
    binary_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_inspect";
    simulate_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_simulate";
    for (const std::string& binary : {binary_, simulate_}) {
      if (!fs::exists(binary)) GTEST_SKIP() << binary << " is not built";
    }
    folder_ = fs::path(::testing::TempDir()) /
              ("inspect_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  // The drive as a log of this format; its path.
  std::string Drive(const std::string& format) {
    const std::string path = folder_ / ("drive_" + format);
    std::string output;
    EXPECT_EQ(RunInShell(simulate_ +
                             " --world=office --size=0.1 --seed=3 --quiet "
                             "--laser_offset=0.25 --format=" +
                             format + " --output=" + path,
                         &output),
              0)
        << output;
    return path;
  }

  // Of a pipe that nobody writes to.
  void ExpectAnswersTheFirstInterrupt() {
    const std::string pipe = folder_ / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    std::string output;
    EXPECT_EQ(
        RunInShell("timeout --foreground --signal=INT --kill-after=20 1 " +
                       binary_ + " " + pipe + "; exit $?",
                   &output),
        124);
    EXPECT_THAT(output, HasSubstr("interrupted"));
  }

  int Inspect(const std::string& arguments, std::string* output) {
    return RunInShell(binary_ + " " + arguments, output);
  }

  // Of a log that is taken, or is not (`status`).
  nlohmann::json Json(const std::string& path, int status = 0,
                      const std::string& flags = "") {
    std::string output;
    EXPECT_EQ(Inspect(path + " --json " + flags, &output), status) << output;
    const auto json = nlohmann::json::parse(output, nullptr, false);
    EXPECT_TRUE(json.is_object()) << output;
    return json;
  }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  static std::string ReadFile(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file),
            std::istreambuf_iterator<char>()};
  }

  std::string binary_;
  std::string simulate_;
  fs::path folder_;
};

TEST_F(InspectTest, SaysTheSameOfEveryFormat) {
  const std::map<std::string, std::string> formats = {
      {"carmen", "CARMEN log"},
      {"ros1", "ROS 1 bag"},
      {"ros2_db3", "ROS 2 bag (folder)"},
      {"mcap", "MCAP"},
      {"csv", "CSV"}};
  nlohmann::json first;
  for (const auto& [format, name] : formats) {
    SCOPED_TRACE(format);
    const nlohmann::json json = Json(Drive(format));
    ASSERT_TRUE(json["refused"].is_null()) << json["refused"];
    EXPECT_THAT(json["format"].get<std::string>(), HasSubstr(name));
    EXPECT_TRUE(json["skipped"].empty());
    EXPECT_FALSE(json["topics"].empty());
    const nlohmann::json& scans = json["scans"];
    const nlohmann::json& odometry = json["odometry"];
    if (first.is_null()) {
      first = json;
      EXPECT_GT(scans["count"], 100);
      EXPECT_NEAR(scans["rate_hz"], 5.0, 0.01);
      EXPECT_EQ(scans["beams"], 180);
      EXPECT_EQ(scans["first_beam_deg"], -90.0);
      EXPECT_EQ(scans["step_deg"], 1.0);
      EXPECT_NEAR(scans["laser_on_robot"]["x_m"], 0.25, 1e-6);
      EXPECT_GT(odometry["way_m"], 20.0);
    }
    for (const char* key : {"count", "beams", "time_reversals"}) {
      EXPECT_EQ(scans[key], first["scans"][key]) << key;
    }
    for (const char* key : {"begin_s", "end_s", "rate_hz", "longest_gap_s",
                            "returns_share", "nearest_m", "farthest_m"}) {
      EXPECT_NEAR(scans[key], first["scans"][key], 0.011) << key;
    }
    EXPECT_NEAR(scans["laser_on_robot"]["x_m"], 0.25, 1e-6);
    for (const char* key : {"way_m", "turned_deg", "largest_step_m"}) {
      EXPECT_NEAR(odometry[key], first["odometry"][key],
                  1e-3 * first["odometry"][key].get<double>())
          << key;
    }
  }
}

TEST_F(InspectTest, TopicsAndWhatIsUsedOfThem) {
  const std::string bag = Drive("ros1");
  const nlohmann::json json = Json(bag);
  std::map<std::string, nlohmann::json> topics;
  for (const auto& topic : json["topics"]) {
    topics[topic["name"].get<std::string>()] = topic;
  }
  ASSERT_EQ(topics.size(), 4u);
  EXPECT_EQ(topics["/scan"]["type"], "sensor_msgs/LaserScan");
  EXPECT_EQ(topics["/scan"]["use"], "scans");
  EXPECT_EQ(topics["/scan"]["messages"], json["scans"]["count"]);
  EXPECT_EQ(topics["/odom"]["use"], "odometry");
  EXPECT_NEAR(topics["/odom"]["rate_hz"], 15.0, 0.1);
  EXPECT_EQ(json["odometry"]["source"], "/odom");

  std::string text;
  EXPECT_EQ(Inspect(bag, &text), 0);
  EXPECT_THAT(text, StartsWith(bag + ": ROS 1 bag\n"));
  for (const char* part :
       {"topic ", "/scan  ", "sensor_msgs/LaserScan ", "\nscans      ",
        "\nlaser      180 beams from -90.00 to 89.00 degrees",
        "on the robot at x 0.250 m", "\nodometry   /odom: "}) {
    EXPECT_THAT(text, HasSubstr(part));
  }

  // Without odometry scan matching is said to carry it.
  const nlohmann::json alone = Json(bag, 0, "--odometry_topic=none");
  EXPECT_TRUE(alone["odometry"]["source"].is_null());
  EXPECT_EQ(alone["odometry"]["instead"], "scan matching alone");
  EXPECT_EQ(Inspect(bag + " --odometry_topic=none", &text), 0);
  EXPECT_THAT(text, HasSubstr("\nodometry   none: scan matching alone"));
}

// plumbline_solve takes them, and so they are not refused.
TEST_F(InspectTest, GraphsAreSaidToBeGraphs) {
  const std::string graph = Write("two.g2o",
                                  "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
                                  "EDGE_SE2 0 1 1 0 0 4 0 0 9 0 16\n");
  const nlohmann::json json = Json(graph);
  EXPECT_EQ(json["format"], "graph (g2o)");
  EXPECT_TRUE(json["refused"].is_null());
  std::string text;
  EXPECT_EQ(Inspect(graph, &text), 0);
  EXPECT_THAT(text, StartsWith(graph + ": graph (g2o)\n"));
  EXPECT_THAT(text, HasSubstr("plumbline_solve takes it as --input"));
  // Of what can be read once only that is the reason.
  EXPECT_EQ(Inspect("- <" + graph, &text), 2);
  EXPECT_THAT(text, HasSubstr("is a graph (g2o), not a log"));
}

TEST_F(InspectTest, RefusalsSayWhatIsThere) {
  const std::string bag = Drive("mcap");
  // A topic that is not there: those that are, with their counts.
  const nlohmann::json other = Json(bag, 2, "--scan_topic=/front");
  EXPECT_THAT(other["refused"].get<std::string>(), HasSubstr("/front"));
  EXPECT_THAT(other["refused"].get<std::string>(), HasSubstr("/scan"));
  EXPECT_FALSE(other.contains("scans"));
  std::string text;
  EXPECT_EQ(Inspect(bag + " --scan_topic=/front", &text), 2);
  EXPECT_THAT(text, HasSubstr(": cannot be mapped\n"));
  EXPECT_THAT(text, HasSubstr("\nrefused: "));
  EXPECT_THAT(text, Not(HasSubstr("\nscans ")));

  for (const auto& [path, why] : std::map<std::string, std::string>{
           {folder_ / "nowhere.bag", "nowhere.bag"},
           {folder_, "is a directory"},
           {Write("empty", ""), "is no log of a known format"},
           {Write("text.txt", "Dear diary,\n"), "is no log of a known format"},
           {Write("half.xz", std::string("\xfd"
                                         "7zXZ\0\0",
                                         7)),
            "compressed data is corrupt or breaks off"},
           {Write("old.rosbag", "#ROSBAG V1.2\n"), "1.2"}}) {
    SCOPED_TRACE(path);
    const nlohmann::json json = Json(path, 2);
    EXPECT_THAT(json["refused"].get<std::string>(), HasSubstr(why));
    EXPECT_EQ(Inspect(path, &text), 2);
    EXPECT_THAT(text, HasSubstr(why));
  }
  EXPECT_EQ(Inspect("", &text), 1);
  EXPECT_EQ(Inspect(bag + " " + bag, &text), 1);
}

TEST_F(InspectTest, APipeAnswersTheFirstInterrupt) {
  ExpectAnswersTheFirstInterrupt();
}

// Half a log is told as such.
TEST_F(InspectTest, CutLogsAreCountedOrRefused) {
  for (const char* format : {"carmen", "ros1", "mcap", "csv"}) {
    const std::string whole = ReadFile(Drive(format));
    const auto all = Json(Drive(format))["scans"]["count"].get<int>();
    for (const double share : {0.02, 0.3, 0.7, 0.97}) {
      SCOPED_TRACE(std::string(format) + " " + std::to_string(share));
      const std::string cut = Write(
          std::string("cut.") + format,
          whole.substr(0, static_cast<std::size_t>(
                              share * static_cast<double>(whole.size()))));
      std::string output;
      const int status = Inspect(cut + " --json", &output);
      const auto json = nlohmann::json::parse(output, nullptr, false);
      ASSERT_TRUE(json.is_object()) << output;
      if (status == 0) {
        EXPECT_LE(json["scans"]["count"].get<int>(), all);
        EXPECT_TRUE(json["refused"].is_null());
      } else {
        EXPECT_EQ(status, 2);
        EXPECT_THAT(json["refused"].get<std::string>(), HasSubstr(cut));
      }
    }
  }
  // A folder without its database.
  const fs::path folder = Drive("ros2_db3");
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".db3") fs::remove(entry.path());
  }
  const nlohmann::json json = Json(folder, 2);
  EXPECT_THAT(json["refused"].get<std::string>(), HasSubstr(".db3"));
}

}  // namespace
}  // namespace plumbline
