#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/utf8.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/tum.h>
#include <plumbline/outputs/checkpoint_file.h>
#include <plumbline/outputs/solve_outputs.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "apps/shell.h"
#include "detectors/hierarchy_worlds.h"

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::set<std::string>& FilesOfALog() {
  static const auto* files = new std::set<std::string>{
      "em_trace.csv",  "floorplan.dxf",  "floorplan.geojson", "floorplan.svg",
      "graph.g2o",     "map.json",       "map.png",           "map.svg",
      "occupancy.pgm", "occupancy.yaml", "report.html",       "rooms.csv",
      "summary.json",  "trajectory.tum"};
  return *files;
}

std::set<std::string> FilesOfAGraph() {
  std::set<std::string> files = FilesOfALog();
  for (const char* name :
       {"trajectory.tum", "occupancy.pgm", "occupancy.yaml", "rooms.csv"}) {
    files.erase(name);
  }
  return files;
}

std::string ReadFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file) << path;
  return {std::istreambuf_iterator<char>(file),
          std::istreambuf_iterator<char>()};
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  std::string line;
  while (std::getline(stream, line)) lines.push_back(line);
  return lines;
}

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

// Elements close in the order in which they opened, and there is one root.
bool IsWellFormed(const std::string& xml) {
  std::vector<std::string> open;
  int roots = 0;
  for (std::size_t i = xml.find('<'); i != std::string::npos;
       i = xml.find('<', i)) {
    if (xml.compare(i, 4, "<!--") == 0) {
      i = xml.find("-->", i);
      continue;
    }
    const std::size_t end = xml.find('>', i);
    if (end == std::string::npos) return false;
    const std::string tag = xml.substr(i + 1, end - i - 1);
    i = end;
    if (tag.empty() || tag.find('<') != std::string::npos) return false;
    if (tag[0] == '?' || tag[0] == '!') continue;
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return false;
    if (tag[0] == '/') {
      if (open.empty() || open.back() != tag.substr(1)) return false;
      open.pop_back();
      continue;
    }
    if (open.empty()) ++roots;
    if (tag.back() != '/') {
      open.push_back(tag.substr(0, tag.find_first_of(" \n\t")));
    }
  }
  return open.empty() && roots == 1;
}

// The six fields of poses come after the beams.
std::string Flaser(const std::vector<std::string>& ranges, double x,
                   double stamp) {
  std::ostringstream line;
  line << "FLASER " << ranges.size();
  for (const std::string& range : ranges) line << " " << range;
  for (int i = 0; i < 2; ++i) line << " " << x << " 0 0";
  line << " " << stamp << " host " << stamp;
  return line.str();
}

// Ranges in a room of 8 m x 6 m from (x, 0) along +x.
std::vector<std::string> RoomRanges(double x, int beams) {
  std::vector<std::string> ranges;
  for (int i = 0; i < beams; ++i) {
    const double angle = DegToRad(-90.0 + i * (beams > 181 ? 0.5 : 1.0)) + 1e-6;
    const double ahead =
        std::cos(angle) > 1e-9 ? (4.0 - x) / std::cos(angle) : 1e9;
    const double side = 3.0 / std::max(1e-9, std::abs(std::sin(angle)));
    std::ostringstream range;
    range.precision(3);
    range << std::fixed << std::min(ahead, side);
    ranges.push_back(range.str());
  }
  return ranges;
}

// Without what XML 1.0 cannot hold, line by line.
std::string KeepPrintable(const std::string& text) {
  std::string kept;
  for (const std::string& line : Lines(text)) {
    kept += PrintableUtf8(line) + "\n";
  }
  return kept;
}

// Runs the binary in a folder of its own.
class SolveTest : public ::testing::Test {
 protected:
  SolveTest() { RegisterBuiltins(&registry_); }

  void SetUp() override {
    binary_ = std::string(PLUMBLINE_BIN_DIR) + "/plumbline_solve";
    if (!std::ifstream(binary_)) GTEST_SKIP() << binary_ << " is not built";
    office_ = std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/office.clf.gz";
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("solve_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name() +
               "_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty() && !HasFailure()) fs::remove_all(folder_);
  }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }

  // Everything that the run prints goes to `output`.
  int Run(const std::string& arguments, std::string* output) {
    return RunInShell(binary_ + " " + arguments, output);
  }

  int Solve(const std::string& input, const std::string& out,
            const std::string& flags, std::string* output) {
    return Run("--input='" + input + "' --output_dir='" +
                   (folder_ / out).string() + "' " + flags,
               output);
  }

  // Names in an output folder; none when it was not made.
  std::set<std::string> Files(const std::string& out) const {
    std::set<std::string> names;
    if (!fs::exists(folder_ / out)) return names;
    for (const auto& entry : fs::directory_iterator(folder_ / out)) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }

  std::string Out(const std::string& out, const std::string& name) const {
    return ReadFile(folder_ / out / name);
  }

  // The comments, parameters and first `scans` scans of the bundled log.
  std::vector<std::string> OfficeLines(int scans) const {
    InputStream input(office_);
    std::vector<std::string> lines;
    std::string_view line;
    while (scans > 0 && input.ReadLine(&line)) {
      lines.emplace_back(line);
      if (line.substr(0, 6) == "FLASER") --scans;
    }
    return lines;
  }

  static std::string Join(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + "\n";
    return text;
  }

  // What two runs have to agree on: files without the times in them.
  std::map<std::string, std::string> Comparable(const std::string& out) const {
    std::map<std::string, std::string> files;
    for (const std::string& name : Files(out)) {
      std::string text = Out(out, name);
      if (name == "summary.json") {
        auto json = nlohmann::json::parse(text);
        json.erase("time_s");
        json.erase("peak_memory_bytes");
        json.erase("flags");
        // Some files have times in them.
        json.erase("sha256");
        if (json.contains("solver")) {
          for (const char* key :
               {"evaluation_s", "linear_solver_s", "setup_s"}) {
            json["solver"].erase(key);
          }
          json["solver"]["start"].erase("seconds");
        }
        for (const char* key :
             {"scan_seconds_second_tenth", "scan_seconds_last_tenth",
              "scan_seconds_growth"}) {
          if (json.contains("frontend")) json["frontend"].erase(key);
        }
        text = json.dump();
      } else if (name == "report.html") {
        // Times and flags stand on a line of their own.
        std::string kept;
        for (const std::string& line : Lines(text)) {
          if (line.find(" id=\"run\"") == std::string::npos)
            kept += line + "\n";
        }
        text = kept;
      } else if (name == "em_trace.csv") {
        const std::vector<std::string> lines = Lines(text);
        const std::vector<std::string> header = Cells(lines.at(0));
        const auto seconds =
            std::find(header.begin(), header.end(), "seconds") - header.begin();
        text.clear();
        for (const std::string& line : lines) {
          std::vector<std::string> cells = Cells(line);
          cells.at(seconds).clear();
          for (const std::string& cell : cells) text += cell + ",";
          text += "\n";
        }
      }
      files[name] = text;
    }
    return files;
  }

  void ExpectSame(const std::string& a, const std::string& b) const {
    SCOPED_TRACE(a + " and " + b);
    const auto first = Comparable(a);
    const auto second = Comparable(b);
    ASSERT_EQ(first.size(), second.size());
    for (const auto& file : first) {
      const auto other = second.find(file.first);
      ASSERT_TRUE(other != second.end()) << file.first;
      EXPECT_TRUE(file.second == other->second) << file.first << " differs";
    }
  }

  // The steps of a run are named, these among them, and are all of its time.
  static void CheckSteps(const nlohmann::json& summary,
                         const std::vector<std::string>& names) {
    const auto& steps = summary["time_s"]["steps"];
    for (const std::string& name : names) {
      EXPECT_TRUE(steps.contains(name)) << name;
    }
    double sum = 0.0;
    for (const auto& step : steps) {
      EXPECT_GE(step.get<double>(), 0.0);
      sum += step.get<double>();
    }
    const double total = summary["time_s"]["total"];
    EXPECT_NEAR(sum, total, 1e-9 * total);
  }

  // Every file is there, nothing else is, and all read back.
  void CheckFiles(const std::string& out,
                  const std::set<std::string>& expected) {
    ASSERT_EQ(Files(out), expected);

    const std::string json = Out(out, "map.json");
    Graph map;
    {
      std::istringstream text(json);
      ASSERT_NO_THROW(ReadGraphJson(text, "map.json", registry_, &map));
    }
    const std::string g2o = Out(out, "graph.g2o");
    Graph graph;
    std::istringstream text(g2o);
    G2oFile file;
    ASSERT_NO_THROW(file = ReadG2o(text, "graph.g2o", registry_, &graph));
    std::ostringstream again;
    WriteG2o(graph, &file, again);
    EXPECT_TRUE(again.str() == g2o) << "graph.g2o changes when written again";
    EXPECT_EQ(graph.num_features(), map.num_features());
    EXPECT_EQ(graph.num_constraints(), map.num_constraints());

    EXPECT_THAT(Out(out, "map.png"), StartsWith("\x89PNG\r\n\x1a\n"));
    EXPECT_THAT(Out(out, "map.png"), HasSubstr("IEND"));
    const std::string svg = Out(out, "map.svg");
    EXPECT_THAT(svg, HasSubstr("<svg"));
    EXPECT_TRUE(IsWellFormed(svg));

    const auto summary = nlohmann::json::parse(Out(out, "summary.json"));
    for (const char* key :
         {"input", "seed", "flags", "counts", "cost", "em", "time_s",
          "peak_memory_bytes", "orthogonality_deg", "version"}) {
      EXPECT_TRUE(summary.contains(key)) << key;
    }
    for (const char* key : {"scans", "features", "constraints"}) {
      EXPECT_TRUE(summary["counts"].contains(key)) << key;
    }
    for (const char* key : {"initial", "measurement", "structure", "total"}) {
      EXPECT_TRUE(summary["cost"][key].is_number()) << key;
    }
    EXPECT_TRUE(summary["em"]["iterations"].is_number_integer());
    EXPECT_TRUE(summary["em"]["converged"].is_boolean());
    for (const char* key :
         {"total", "parse", "frontend", "detect", "solve", "write"}) {
      ASSERT_TRUE(summary["time_s"][key].is_number()) << key;
      EXPECT_GE(summary["time_s"][key].get<double>(), 0.0) << key;
    }
    CheckSteps(summary, {"start", "reading", "figures", "writing"});
    EXPECT_GT(summary["peak_memory_bytes"].get<double>(), 1e6);
    std::size_t features = 0;
    for (const auto& type : summary["counts"]["features"]) {
      for (const auto& level : type) features += level.get<std::size_t>();
    }
    EXPECT_EQ(features, map.num_features());
    std::size_t constraints = 0;
    for (const auto& type : summary["counts"]["constraints"]) {
      for (const char* key : {"measurement", "structure", "broken"}) {
        constraints += type[key].get<std::size_t>();
      }
    }
    EXPECT_EQ(constraints, map.num_constraints());

    const std::vector<std::string> rows = Lines(Out(out, "em_trace.csv"));
    ASSERT_GE(rows.size(), 1u);
    EXPECT_THAT(rows[0],
                StartsWith("iteration,phase,cost_measurement,cost_structure,"));
    EXPECT_THAT(rows[0],
                HasSubstr(",structure_constraints,broken_constraints,"));
    // What detectors counted follows.
    EXPECT_THAT(rows[0], HasSubstr(",seconds,mean_position_error"));
    for (const std::string& row : rows) {
      EXPECT_EQ(Cells(row).size(), Cells(rows[0]).size()) << row;
    }
  }

  nlohmann::json SummaryOf(const std::string& out) const {
    return nlohmann::json::parse(Out(out, "summary.json"));
  }

  Registry registry_;
  std::string binary_;
  std::string office_;
  fs::path folder_;
};

TEST_F(SolveTest, Office) {
  std::string output;
  ASSERT_EQ(Solve(office_, "out", "", &output), 0) << output;
  // Nothing but the closing lines.
  const std::string out = (folder_ / "out").string();
  EXPECT_EQ(output.find(out + ": "), 0u) << output;
  EXPECT_THAT(output, HasSubstr(" walls, 4 shared directions, "));
  EXPECT_THAT(output, HasSubstr("\nopen " + out + "/report.html\n"));
  CheckFiles("out", FilesOfALog());
  const auto summary = SummaryOf("out");
  EXPECT_EQ(summary["input"], office_);
  EXPECT_EQ(summary["seed"], 1);
  EXPECT_EQ(summary["counts"]["scans"], 1408);
  EXPECT_TRUE(summary["em"]["converged"].get<bool>());
  EXPECT_TRUE(summary["flags"].contains("input"));
  EXPECT_FALSE(summary["flags"].contains("delta_threshold"));
  EXPECT_LT(summary["orthogonality_deg"].get<double>(), 1.0);
  EXPECT_GT(Lines(Out("out", "em_trace.csv")).size(), 4u);

  // A line a scan, with the log's own time stamps.
  const std::vector<TimedPose> trajectory =
      ReadTum((folder_ / "out/trajectory.tum").string());
  ASSERT_EQ(trajectory.size(), 1408u);
  EXPECT_EQ(Lines(Out("out", "trajectory.tum")).size(), 1408u);
  std::size_t scan = 0;
  for (const std::string& line : OfficeLines(1408)) {
    if (line.compare(0, 6, "FLASER") != 0) continue;
    std::istringstream fields(line);
    std::vector<std::string> words{std::istream_iterator<std::string>(fields),
                                   std::istream_iterator<std::string>()};
    EXPECT_EQ(trajectory[scan].timestamp, std::stod(words[words.size() - 3]));
    ++scan;
  }
  const RelationEvaluation evaluation = EvaluateRelations(
      trajectory, ReadRelations(std::string(PLUMBLINE_SOURCE_DIR) +
                                "/datasets/office.relations"));
  EXPECT_TRUE(evaluation.unmatched.empty());
  EXPECT_GT(evaluation.translation.count, 100u);
  EXPECT_LT(evaluation.translation.mean, 0.08);
  EXPECT_LT(evaluation.rotation_deg.mean, 0.8);

  // The building's directions, and no others.
  Graph map;
  std::istringstream text(Out("out", "map.json"));
  ReadGraphJson(text, "map.json", registry_, &map);
  std::set<int> found;
  for (const Feature* feature : map.Features()) {
    if (feature->type->name != "orientation") continue;
    bool is_true = false;
    for (const int direction : {-60, 0, 30, 90}) {
      if (std::abs(std::remainder(RadToDeg(feature->parameters[0]) - direction,
                                  180.0)) < 1.5) {
        is_true = true;
        found.insert(direction);
      }
    }
    EXPECT_TRUE(is_true) << RadToDeg(feature->parameters[0]);
  }
  EXPECT_EQ(found, (std::set<int>{-60, 0, 30, 90}));
}

// Whatever the number of threads.
// All files in the frame of the building, and nothing else about them changed.
// As --help says of --align=none.
TEST_F(SolveTest, TheFrameIsThatOfOdometry) {
  std::vector<std::string> lines;
  for (int i = 0; i < 30; ++i) {
    lines.push_back(Flaser(RoomRanges(0.1 * i, 181), 5.0 + 0.1 * i, 100.0 + i));
  }
  std::string output;
  ASSERT_EQ(Solve(Write("room.log", Join(lines)), "out",
                  "--outputs=trajectory.tum", &output),
            0)
      << output;
  const std::vector<TimedPose> poses =
      ReadTum((folder_ / "out/trajectory.tum").string());
  ASSERT_EQ(poses.size(), 30u);
  EXPECT_NEAR(poses[0].pose[0], 5.0, 1e-9);
  EXPECT_EQ(Run("--help", &output), 0);
  EXPECT_THAT(output, HasSubstr("that of odometry"));
  EXPECT_THAT(output, Not(HasSubstr("starts at the origin")));
}

TEST_F(SolveTest, AlignedToTheBuilding) {
  std::string output;
  const std::string outputs =
      "--outputs=trajectory.tum,map.json,occupancy.pgm,floorplan.geojson,"
      "rooms.csv,report.html ";
  ASSERT_EQ(Solve(office_, "plain", outputs, &output), 0) << output;
  ASSERT_EQ(Solve(office_, "aligned", outputs + "--align=building", &output), 0)
      << output;
  EXPECT_FALSE(SummaryOf("plain").contains("alignment"));
  const auto summary = SummaryOf("aligned");
  const auto& alignment = summary["alignment"];
  EXPECT_EQ(alignment["kind"], "building");
  const Pose2 by(alignment["x"], alignment["y"],
                 DegToRad(alignment["theta_deg"].get<double>()));
  EXPECT_LE(std::abs(by[2]), DegToRad(45.0) + 1e-9);
  EXPECT_EQ(summary["cost"], SummaryOf("plain")["cost"]);

  const auto poses = [&](const std::string& out) {
    return ReadTum((folder_ / out / "trajectory.tum").string());
  };
  const std::vector<TimedPose> plain = poses("plain");
  const std::vector<TimedPose> aligned = poses("aligned");
  ASSERT_EQ(plain.size(), aligned.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const Pose2 expected = Compose(by, plain[i].pose);
    EXPECT_LT((aligned[i].pose - expected).head<2>().norm(), 2e-6);
    EXPECT_NEAR(NormalizeAngle(aligned[i].pose[2] - expected[2]), 0.0, 2e-6);
  }

  const auto read = [&](const std::string& out, Graph* graph) {
    std::istringstream text(Out(out, "map.json"));
    ReadGraphJson(text, "map.json", registry_, graph);
  };
  Graph before, after;
  read("plain", &before);
  read("aligned", &after);
  ASSERT_EQ(before.num_features(), after.num_features());
  double squared = 0.0;
  double length = 0.0;
  for (const Feature* feature : after.Features()) {
    if (feature->type->name != "segment") continue;
    const Feature& other = before.GetFeature(feature->id);
    const Pose2 expected =
        Compose(by, Eigen::Vector3d(other.parameters[0], other.parameters[1],
                                    other.parameters[2]));
    EXPECT_NEAR(feature->parameters[0], expected[0], 1e-6);
    EXPECT_NEAR(feature->parameters[1], expected[1], 1e-6);
    const double extent = feature->extent_end - feature->extent_begin;
    const double off = std::abs(WrapAngle(feature->parameters[2], 0.5 * kPi));
    length += extent;
    squared += off < DegToRad(1.0) ? extent : 0.0;
  }
  // But for a wing at 30 degrees, the building is at right angles.
  EXPECT_GT(squared, 0.7 * length);

  // The plan lies where the map does. Its rooms are found on a grid whose cells
  // are turned against the walls or not: one may differ.
  const auto plan = [&](const std::string& out) {
    return nlohmann::json::parse(Out(out, "floorplan.geojson"));
  };
  const nlohmann::json plain_plan = plan("plain");
  const nlohmann::json aligned_plan = plan("aligned");
  std::map<std::string, int> kinds, plain_kinds;
  for (const auto& feature : plain_plan["features"]) {
    ++plain_kinds[feature["properties"].value("kind", "")];
  }
  double low = 1e9;
  for (const auto& feature : aligned_plan["features"]) {
    const std::string kind = feature["properties"].value("kind", "");
    ++kinds[kind];
    if (kind != "face") continue;
    for (const auto& position : feature["geometry"]["coordinates"]) {
      low =
          std::min({low, position[0].get<double>(), position[1].get<double>()});
    }
  }
  EXPECT_GE(low, -0.01);
  EXPECT_GT(kinds["room"], 0);
  EXPECT_NEAR(kinds["room"], plain_kinds["room"], 1);
  EXPECT_EQ(kinds["face"], plain_kinds["face"]);

  const auto errors = [&](const std::string& out) {
    const std::string evaluate =
        std::string(PLUMBLINE_BIN_DIR) + "/plumbline_evaluate";
    const std::string folder = (folder_ / out).string();
    const std::string datasets =
        std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/";
    std::string printed;
    EXPECT_EQ(RunInShell(evaluate + " --trajectory='" + folder +
                             "/trajectory.tum' --truth=" + datasets +
                             "office.truth.json --map='" + folder +
                             "/map.json' --output='" + folder + "/errors.json'",
                         &printed),
              0)
        << printed;
    return nlohmann::json::parse(Out(out, "errors.json"));
  };
  if (std::ifstream(std::string(PLUMBLINE_BIN_DIR) + "/plumbline_evaluate")) {
    const auto a = errors("plain").flatten();
    const auto b = errors("aligned").flatten();
    for (const auto& [key, value] : a.items()) {
      // How the trajectory was moved onto the truth is another matter.
      if (!value.is_number() || key.find("/alignment/") != key.npos) continue;
      ASSERT_TRUE(b.contains(key)) << key;
      EXPECT_NEAR(b[key].get<double>(), value.get<double>(), 1e-5) << key;
    }
  }
}

TEST_F(SolveTest, SameBytesEveryTime) {
  const std::string log = Write("office.log", Join(OfficeLines(300)));
  std::string output;
  ASSERT_EQ(Solve(log, "a", "", &output), 0) << output;
  ASSERT_EQ(Solve(log, "b", "", &output), 0) << output;
  ASSERT_EQ(Solve(log, "one", "--num_threads=1", &output), 0) << output;
  ASSERT_EQ(Solve(log, "two", "--num_threads=2", &output), 0) << output;
  EXPECT_EQ(Files("a"), FilesOfALog());
  ExpectSame("a", "b");
  ExpectSame("a", "one");
  ExpectSame("a", "two");
}

// How noisy a laser is comes out on the way: the map takes it as it was at the
// scan, however far ahead another thread has refined the odometry.
TEST_F(SolveTest, SameBytesOfANoisyLaser) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::vector<std::string> lines = OfficeLines(300);
  for (std::string& line : lines) {
    if (line.compare(0, 7, "FLASER ") != 0) continue;
    std::istringstream fields(line);
    std::ostringstream noisy;
    std::string word;
    int count = 0;
    fields >> word >> count;
    noisy << word << ' ' << count;
    for (int i = 0; i < count; ++i) {
      double range = 0.0;
      fields >> range;
      noisy << ' ' << std::max(0.1, range + noise(random));
    }
    while (fields >> word) noisy << ' ' << word;
    line = noisy.str();
  }
  const std::string log = Write("noisy.log", Join(lines));
  std::string output;
  ASSERT_EQ(Solve(log, "one", "--num_threads=1", &output), 0) << output;
  // More than once: which of them is ahead of the other may differ.
  for (const char* out : {"two", "again", "once_more"}) {
    ASSERT_EQ(Solve(log, out, "--num_threads=2", &output), 0) << output;
    ExpectSame("one", out);
  }
}

TEST_F(SolveTest, OfficeWithPoints) {
  std::string output;
  const std::string points = "--features=points ";
  ASSERT_EQ(Solve(office_, "out", points + "--num_threads=1", &output), 0)
      << output;
  EXPECT_EQ(output.find((folder_ / "out").string() + ": "), 0u) << output;
  CheckFiles("out", FilesOfALog());
  const auto summary = SummaryOf("out");
  EXPECT_EQ(summary["flags"]["features"], "points");
  EXPECT_TRUE(summary["em"]["converged"].get<bool>());
  EXPECT_LT(summary["orthogonality_deg"].get<double>(), 1.0);
  EXPECT_EQ(summary["closures"]["proposed"], 0);
  const auto& features = summary["counts"]["features"];
  EXPECT_GT(features["point"]["0"].get<int>(), 300);
  EXPECT_LT(features["point"]["0"].get<int>(), 700);
  EXPECT_GE(features["line"]["1"].get<int>(), 20);
  EXPECT_GE(features["orientation"]["2"].get<int>(), 2);
  EXPECT_FALSE(features.contains("segment"));

  const RelationEvaluation evaluation =
      EvaluateRelations(ReadTum((folder_ / "out/trajectory.tum").string()),
                        ReadRelations(std::string(PLUMBLINE_SOURCE_DIR) +
                                      "/datasets/office.relations"));
  EXPECT_TRUE(evaluation.unmatched.empty());
  EXPECT_LT(evaluation.translation.mean, 0.03);
  EXPECT_LT(evaluation.rotation_deg.mean, 0.2);

  // The building's directions, and no others.
  Graph map;
  std::istringstream text(Out("out", "map.json"));
  ReadGraphJson(text, "map.json", registry_, &map);
  std::set<int> found;
  for (const Feature* feature : map.Features()) {
    if (feature->type->name != "orientation") continue;
    bool is_true = false;
    for (const int direction : {-60, 0, 30, 90}) {
      if (std::abs(std::remainder(RadToDeg(feature->parameters[0]) - direction,
                                  180.0)) < 1.0) {
        is_true = true;
        found.insert(direction);
      }
    }
    EXPECT_TRUE(is_true) << RadToDeg(feature->parameters[0]);
  }
  EXPECT_EQ(found.count(0), 1u);
  EXPECT_EQ(found.count(90), 1u);

  // Whatever the number of threads.
  ASSERT_EQ(Solve(office_, "two", points + "--num_threads=2", &output), 0)
      << output;
  ExpectSame("out", "two");
}

TEST_F(SolveTest, WhatPointsCannotDo) {
  const std::string log = Write("office.log", Join(OfficeLines(30)));
  std::string output;
  const std::string points = "--features=points ";
  EXPECT_EQ(Solve(log, "a", points + "--refine=full", &output), 2);
  EXPECT_THAT(output, HasSubstr("--refine: 'full' does not go with "
                                "--features=points"));
  EXPECT_EQ(Solve(log, "b", points + "--global_association", &output), 2);
  EXPECT_THAT(output, HasSubstr("--global_association: 'true' does not go "
                                "with --features=points"));
  EXPECT_EQ(
      Solve(log, "c", points + "--hierarchy=orientation_mixture", &output), 2);
  EXPECT_THAT(output, HasSubstr("level 0 (point)"));
  EXPECT_EQ(Solve(log, "d", "--features=lines", &output), 1);
  EXPECT_TRUE(Files("a").empty());
  EXPECT_TRUE(Files("b").empty());
  // Off or left alone is fine.
  EXPECT_EQ(Solve(log, "e",
                  points + "--refine=map --global_association=false "
                           "--outputs=none",
                  &output),
            0)
      << output;
  EXPECT_EQ(Solve(log, "f", points + "--refine=none --outputs=none", &output),
            0)
      << output;
  // A graph has its features.
  ASSERT_EQ(Solve(log, "g", "--outputs=graph.g2o", &output), 0) << output;
  EXPECT_EQ(Solve((folder_ / "g/graph.g2o").string(), "h",
                  points + "--outputs=none", &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("--features is for logs"));
}

TEST_F(SolveTest, FilesThatAreAskedFor) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  using Names = std::set<std::string>;
  ASSERT_EQ(Solve(log, "none", "--outputs=none", &output), 0) << output;
  EXPECT_EQ(Files("none"), Names{"summary.json"});
  ASSERT_EQ(Solve(log, "some", "--outputs=map.json,occupancy.pgm", &output), 0);
  EXPECT_EQ(Files("some"), (Names{"map.json", "occupancy.pgm", "occupancy.yaml",
                                  "summary.json"}));
  ASSERT_EQ(Solve(log, "but", "--outputs=-map.png,-graph.g2o", &output), 0);
  Names expected = FilesOfALog();
  expected.erase("map.png");
  expected.erase("graph.g2o");
  EXPECT_EQ(Files("but"), expected);
  ASSERT_EQ(Solve(log, "all", "--outputs=all", &output), 0);
  expected = FilesOfALog();
  EXPECT_EQ(Files("all"), expected);
  EXPECT_THAT(Out("all", "report.html"),
              HasSubstr(R"("name":"delta_threshold","value":"0.3")"));
  EXPECT_EQ(Solve(log, "wrong", "--outputs=map.png,map.gif", &output), 2);
  EXPECT_THAT(output, HasSubstr("unknown file 'map.gif': expected names"));
  EXPECT_THAT(output, HasSubstr("floorplan.dxf"));
  EXPECT_TRUE(Files("wrong").empty());
}

// What an earlier run wrote and this one does not goes; what is not of a run
// stays.
TEST_F(SolveTest, FilesOfAnEarlierRun) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  using Names = std::set<std::string>;
  // Nothing says that this picture is ours.
  fs::create_directories(folder_ / "out");
  Write("out/map.png", "somebody's");
  ASSERT_EQ(Solve(log, "out", "--outputs=none", &output), 0) << output;
  EXPECT_EQ(Files("out"), (Names{"map.png", "summary.json"}));
  EXPECT_EQ(Out("out", "map.png"), "somebody's");

  ASSERT_EQ(Solve(log, "out", "--outputs=all", &output), 0) << output;
  Names all = FilesOfALog();
  Names listed;
  const auto files = SummaryOf("out")["files"];
  for (const auto& name : files) listed.insert(name.get<std::string>());
  listed.insert("summary.json");
  EXPECT_EQ(listed, all);

  Write("out/notes.txt", "mine");
  fs::create_directories(folder_ / "out/elsewhere");
  Write("out/elsewhere/map.png", "mine");
  // A link in the place of a file is somebody's.
  fs::remove(folder_ / "out/map.svg");
  fs::create_symlink("notes.txt", folder_ / "out/map.svg");
  ASSERT_EQ(
      Solve(log, "out", "--verbose --outputs=map.json,graph.g2o", &output), 0)
      << output;
  EXPECT_THAT(output, HasSubstr(" s  writing\n"));
  EXPECT_EQ(Files("out"), (Names{"elsewhere", "graph.g2o", "map.json",
                                 "map.svg", "notes.txt", "summary.json"}));
  EXPECT_EQ(Files("out/elsewhere"), Names{"map.png"});
  EXPECT_THAT(output, HasSubstr("map.svg (no regular file)\n"));
  EXPECT_THAT(output, HasSubstr(", report.html, rooms.csv, trajectory.tum\n"));
  EXPECT_THAT(output, Not(HasSubstr("map.json")));

  // A graph has no path of scans.
  ASSERT_EQ(Solve(log, "both", "", &output), 0) << output;
  Write("graph.g2o", Out("both", "graph.g2o"));
  ASSERT_EQ(Solve((folder_ / "graph.g2o").string(), "both", "", &output), 0)
      << output;
  EXPECT_EQ(Files("both"), FilesOfAGraph());

  // A run that fails leaves everything as it was.
  EXPECT_EQ(Solve("no_such.log", "both", "--outputs=none", &output), 2);
  EXPECT_EQ(Files("both"), FilesOfAGraph());
}

// The thesis of somebody who runs the program in its folder.
TEST_F(SolveTest, NothingOfOthersIsRemoved) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  fs::create_directories(folder_ / "out");
  Write("out/thesis.tex", "years of work");
  Write("out/map.svg", "drawn by hand");
  Write("out/summary.json", R"({"files": ["thesis.tex", "map.svg"]})");
  ASSERT_EQ(Solve(log, "out", "--outputs=map.json", &output), 0) << output;
  EXPECT_EQ(Out("out", "thesis.tex"), "years of work");
  EXPECT_EQ(Out("out", "map.svg"), "drawn by hand");
  EXPECT_THAT(output, HasSubstr("map.svg (written by a version"));

  // A run's own file, edited afterwards.
  ASSERT_EQ(Solve(log, "out", "--outputs=map.json,map.svg", &output), 0);
  Write("out/map.svg", "edited");
  ASSERT_EQ(Solve(log, "out", "--outputs=map.json", &output), 0) << output;
  EXPECT_EQ(Out("out", "map.svg"), "edited");
  EXPECT_THAT(output, HasSubstr("map.svg (changed since it was written)"));
}

TEST_F(SolveTest, TheInputIsNeitherRemovedNorReplaced) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "", &output), 0) << output;
  const std::string graph = Out("out", "graph.g2o");
  const std::string path = (folder_ / "out/graph.g2o").string();
  ASSERT_EQ(Solve(path, "out", "--outputs=map.json", &output), 0) << output;
  EXPECT_TRUE(Out("out", "graph.g2o") == graph);
  EXPECT_THAT(output, HasSubstr("graph.g2o (read by this run)"));
  EXPECT_THAT(output, HasSubstr("removed of an earlier run: em_trace.csv"));
  for (const std::string& input : {"'" + path + "'", "- <'" + path + "'"}) {
    EXPECT_EQ(Run("--output_dir='" + (folder_ / "out").string() +
                      "' --input=" + input,
                  &output),
              2);
    EXPECT_THAT(output, HasSubstr("graph.g2o: is read by this run"));
    EXPECT_TRUE(Out("out", "graph.g2o") == graph);
  }
}

// A summary's digests are those of the files beside it.
void ExpectWhole(const fs::path& folder) {
  const auto summary = nlohmann::json::parse(ReadFile(folder / "summary.json"));
  EXPECT_EQ(summary["partial"], false);
  EXPECT_EQ(summary["sha256"].size(), summary["files"].size());
  for (const auto& [name, digest] : summary["sha256"].items()) {
    EXPECT_EQ(digest, Sha256OfFile((folder / name).string())) << name;
  }
}

// Files of limited size stand for a disk that is full.
TEST_F(SolveTest, AFullDiskLeavesTheEarlierRunWhole) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "", &output), 0) << output;
  ExpectWhole(folder_ / "out");
  const auto before = Comparable("out");
  const std::string command =
      "ulimit -f 40; '" + binary_ + "' --input='" + log + "' --output_dir='" +
      (folder_ / "out").string() + "' --delta_threshold=1";
  EXPECT_EQ(RunInShell(command, &output), 2);
  EXPECT_THAT(output, HasSubstr("File too large"));
  EXPECT_THAT(output, HasSubstr("; so with "));
  EXPECT_THAT(output, HasSubstr("no file is replaced"));
  EXPECT_THAT(output, Not(HasSubstr(".plumbline_files")));
  ExpectWhole(folder_ / "out");
  EXPECT_TRUE(before == Comparable("out"));
  EXPECT_EQ(Files("out"), FilesOfALog());
}

TEST_F(SolveTest, KilledRunsLeaveWholeFolders) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "", &output), 0) << output;
  const std::string out = "--output_dir=" + (folder_ / "out").string();
  const std::string input = "--input=" + log;
  for (int i = 0; i < 10; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      execl(binary_.c_str(), binary_.c_str(), input.c_str(), out.c_str(),
            "--quiet", static_cast<char*>(nullptr));
      _exit(99);
    }
    usleep(30000 * i);
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    if (SummaryOf("out").contains("mixed")) continue;
    ExpectWhole(folder_ / "out");
  }
  ASSERT_EQ(Solve(log, "out", "", &output), 0) << output;
  ExpectWhole(folder_ / "out");
  EXPECT_EQ(Files("out"), FilesOfALog());
}

TEST_F(SolveTest, AKilledRunIsGoneOnWith) {
  const std::string log = Write("office.log", Join(OfficeLines(250)));
  const std::string flags = "--checkpoint_every=1e-9 --num_threads=1";
  std::string output;
  ASSERT_EQ(Solve(log, "whole", flags, &output), 0) << output;
  EXPECT_EQ(Files("whole"), FilesOfALog());
  auto whole = Comparable("whole");
  const fs::path checkpoint = folder_ / "out" / "checkpoint.plumbline";
  // As soon as the first state is there.
  const auto kill_early = [&] {
    const pid_t child = fork();
    if (child == 0) {
      const std::string out = "--output_dir=" + (folder_ / "out").string();
      const std::string input = "--input=" + log;
      execl(binary_.c_str(), binary_.c_str(), input.c_str(), out.c_str(),
            "--checkpoint_every=1e-9", "--num_threads=1", "--quiet",
            static_cast<char*>(nullptr));
      _exit(99);
    }
    while (!fs::exists(checkpoint) && waitpid(child, nullptr, WNOHANG) == 0) {
      usleep(1000);
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  };
  kill_early();
  if (!fs::exists(checkpoint)) GTEST_SKIP() << "it ended before it was killed";

  // Others are refused, and leave it alone.
  EXPECT_EQ(Solve(log, "out", flags + " --seed=7", &output), 2);
  EXPECT_THAT(output, HasSubstr("--seed was '1' then and is '7' now"));
  const std::string other = Write("other.log", Join(OfficeLines(249)));
  EXPECT_EQ(Solve(other, "out", flags, &output), 2);
  EXPECT_THAT(output, HasSubstr("the input's digest"));
  // So is the state of a folder that was sent by somebody.
  fs::create_directories(folder_ / "sent");
  fs::copy_file(checkpoint, folder_ / "sent/checkpoint.plumbline");
  EXPECT_EQ(Solve(log, "sent", flags, &output), 2);
  EXPECT_THAT(output, HasSubstr("the folder's inode was '"));
  EXPECT_TRUE(fs::exists(checkpoint));

  ASSERT_EQ(Solve(log, "out", flags, &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("goes on where a run that did not end"));
  EXPECT_EQ(Files("out"), FilesOfALog());
  for (const auto& [name, content] : Comparable("out")) {
    // It names the folder.
    if (name == "summary.json" || name == "report.html") continue;
    EXPECT_EQ(content, whole[name]) << name;
  }
}

TEST_F(SolveTest, ALiveReportChangesNothing) {
  const std::string log = Write("office.log", Join(OfficeLines(250)));
  std::string output;
  ASSERT_EQ(Solve(log, "alone", "", &output), 0) << output;
  const fs::path page = folder_ / "live" / "report.html";
  const std::string mark = "\"live\":{\"stage\":\"";
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const std::string out = "--output_dir=" + (folder_ / "out").string();
    const std::string live = "--live_dir=" + (folder_ / "live").string();
    const std::string input = "--input=" + log;
    execl(binary_.c_str(), binary_.c_str(), input.c_str(), out.c_str(),
          live.c_str(), "--live_every=0.01", "--quiet",
          static_cast<char*>(nullptr));
    _exit(99);
  }
  int status = 0;
  std::set<std::string> stages;
  while (waitpid(child, &status, WNOHANG) == 0) {
    usleep(2000);
    if (!fs::exists(page)) continue;
    // Pages are whole at any time.
    const std::string text = ReadFile(page);
    ASSERT_THAT(text, ::testing::EndsWith("</html>\n"));
    const std::size_t begin = text.find(mark);
    if (begin == std::string::npos) continue;
    stages.insert(text.substr(begin + mark.size(), 6));
  }
  ASSERT_TRUE(WIFEXITED(status));
  ASSERT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(stages.count("scans,"), 1u);
  EXPECT_EQ(ReadFile(page), Out("out", "report.html"));
  auto alone = Comparable("alone");
  for (const auto& [name, content] : Comparable("out")) {
    // They name the folders.
    if (name == "summary.json" || name == "report.html") continue;
    EXPECT_EQ(content, alone[name]) << name;
  }

  // Of a run without a report, and of several logs; a folder of its own.
  const std::string live = "--live_dir=" + (folder_ / "other").string();
  ASSERT_EQ(
      Solve(log + "," + log, "out",
            live + " --live_every=0.01 --outputs=trajectory.tum", &output),
      0)
      << output;
  const std::string last = ReadFile(folder_ / "other" / "report.html");
  EXPECT_THAT(last, HasSubstr("\"live\":null"));
  EXPECT_THAT(last, HasSubstr("\"scans\":500"));
  EXPECT_EQ(
      Solve(log, "out", "--live_dir=" + (folder_ / "out/.").string(), &output),
      2);
  EXPECT_THAT(output, HasSubstr("is the folder of --output_dir"));
}

// The parts of one recording, one by one: a part lacks what another one has.
TEST_F(SolveTest, PartsOfOneBagAreSaid) {
  const LaserModel laser;
  SimulatorOptions options;
  options.progress = [](double share) { return share < 0.1; };
  const std::vector<BagRecord> records =
      SimulatedMessages(Simulate(MakeWorld("office", 3, 0.5), options, 3),
                        laser, MessageEncoding::kRos1);
  const auto middle =
      records.begin() + static_cast<std::ptrdiff_t>(records.size() / 2);
  const std::string first =
      Write("d_0.bag", MakeRosbag1({records.begin(), middle}));
  const std::string second =
      Write("d_1.bag", MakeRosbag1({middle, records.end()}));
  std::string output;
  ASSERT_EQ(
      Solve(second + "," + first, "parts", "--outputs=trajectory.tum", &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr(second + ": begins where " + first + " ends"));
  EXPECT_THAT(output, Not(HasSubstr(first + ": begins where")));
}

// Said, since a reader of the command would think otherwise.
TEST_F(SolveTest, SeveralLogs) {
  const std::vector<std::string> lines = OfficeLines(400);
  std::vector<std::string> scans;
  for (const std::string& line : lines) {
    if (line.substr(0, 6) == "FLASER") scans.push_back(line);
  }
  const std::string first =
      Write("first.clf", Join({scans.begin(), scans.begin() + 250}));
  const std::string second =
      Write("second.clf", Join({scans.begin() + 150, scans.end()}));
  std::string output;
  ASSERT_EQ(Solve(second + "," + first, "both",
                  "--outputs=trajectory.tum,map.json", &output),
            0)
      << output;
  EXPECT_EQ(Files("both"),
            (std::set<std::string>{"map.json", "summary.json", "trajectory.tum",
                                   "trajectory_1.tum", "trajectory_2.tum"}));
  EXPECT_EQ(Lines(Out("both", "trajectory_1.tum")).size(), 250u);
  EXPECT_EQ(Out("both", "trajectory.tum"),
            Out("both", "trajectory_1.tum") + Out("both", "trajectory_2.tum"));
  const auto summary = nlohmann::json::parse(Out("both", "summary.json"));
  ASSERT_EQ(summary["logs"].size(), 2u);
  EXPECT_EQ(summary["logs"][0]["input"], second);
  EXPECT_EQ(summary["logs"][1]["trajectory"], "trajectory_2.tum");
  EXPECT_EQ(summary["logs"][1]["map"], "");
  EXPECT_GE(summary["logs"][1]["agreeing"], 3);
  EXPECT_TRUE(summary["logs"][1]["why_apart"].is_null());
  // Few parts of so short a log speak for its place, which is said.
  if (summary["logs"][1]["agreeing"] < 6) {
    EXPECT_THAT(summary["logs"][1]["uncertain"].get<std::string>(),
                HasSubstr("parts of it agree"));
    EXPECT_THAT(output, HasSubstr("1 log may be of another building"));
  } else {
    EXPECT_TRUE(summary["logs"][1]["uncertain"].is_null());
  }
  EXPECT_EQ(summary["counts"]["scans"], 500);
  CheckSteps(summary, {"reading", "scans", "placing of logs", "writing"});

  // A start where it is not: a map of its own.
  ASSERT_EQ(Solve(second + "," + first, "both",
                  "--outputs=trajectory.tum --start_pose=2:30,40,180", &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("kept apart, in "));
  EXPECT_THAT(output, HasSubstr("1 log kept apart (map_2)"));
  EXPECT_EQ(Files("both"),
            (std::set<std::string>{"map_2", "summary.json", "trajectory.tum",
                                   "trajectory_1.tum"}));
  EXPECT_EQ(Files("both/map_2"),
            (std::set<std::string>{"summary.json", "trajectory.tum",
                                   "trajectory_2.tum"}));

  // The map of a log apart does not outlive the run that made it; what somebody
  // put there does.
  std::ofstream(folder_ / "both/map_2/note.txt") << "mine";
  ASSERT_EQ(
      Solve(second + "," + first, "both", "--outputs=trajectory.tum", &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr("both/map_2: removed of an earlier run: "
                                "trajectory.tum, trajectory_2.tum, "
                                "summary.json"));
  EXPECT_EQ(Files("both/map_2"), std::set<std::string>{"note.txt"});
  fs::remove(folder_ / "both/map_2/note.txt");
  ASSERT_EQ(Solve(second, "both", "--outputs=trajectory.tum", &output), 0)
      << output;
  // An empty folder is nobody's.
  EXPECT_THAT(output, Not(HasSubstr("map_2")));

  const auto refuses = [&](const std::string& input, const std::string& flags,
                           const char* why) {
    EXPECT_NE(Solve(input, "none", flags, &output), 0);
    EXPECT_THAT(output, HasSubstr(why));
  };
  const std::string both = first + "," + second;
  refuses(both, "--start_pose=3:0,0,0", "2:3.5,-1,90");
  refuses(both, "--start_pose=2:0,0", "2:3.5,-1,90");
  refuses(both, "--features=points", "full refinement");
  refuses(both, "--refine=map", "full refinement");
  refuses(first + "," + Write("graph.g2o", "VERTEX_SE2 0 0 0 0\n"), "",
          "is a graph");
  refuses(first + ",/nowhere.clf", "", "/nowhere.clf");
}

TEST_F(SolveTest, AnEarlierMap) {
  const std::vector<std::string> lines = OfficeLines(400);
  std::vector<std::string> scans;
  for (const std::string& line : lines) {
    if (line.substr(0, 6) == "FLASER") scans.push_back(line);
  }
  const std::string first =
      Write("first.clf", Join({scans.begin(), scans.begin() + 250}));
  const std::string second =
      Write("second.clf", Join({scans.begin() + 150, scans.end()}));
  std::string output;
  ASSERT_EQ(Solve(first, "first", "--outputs=map.json", &output), 0) << output;
  const std::string flag = "--map=" + (folder_ / "first/map.json").string();
  const std::string map = Out("first", "map.json");

  // Of the files that are made by default those that say something new.
  ASSERT_EQ(Solve(second, "found", flag + " --localize", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("placed in the map"));
  EXPECT_THAT(output, HasSubstr("250 poses in " +
                                (folder_ / "first/map.json").string() + " ("));
  EXPECT_THAT(output, HasSubstr("found/map.svg"));
  EXPECT_EQ(Files("found"),
            (std::set<std::string>{"map.png", "map.svg", "summary.json",
                                   "trajectory.tum"}));
  EXPECT_EQ(Lines(Out("found", "trajectory.tum")).size(), 250u);
  EXPECT_EQ(SummaryOf("found")["logs"][0]["trajectory"], "trajectory.tum");
  EXPECT_EQ(SummaryOf("found")["em"]["converged"], true);
  EXPECT_EQ(Out("first", "map.json"), map);

  ASSERT_EQ(Solve(second, "both", flag + " --outputs=map.json,trajectory.tum",
                  &output),
            0)
      << output;
  EXPECT_EQ(Files("both"),
            (std::set<std::string>{"map.json", "summary.json", "trajectory.tum",
                                   "trajectory_1.tum"}));
  EXPECT_EQ(Lines(Out("both", "trajectory_1.tum")).size(), 250u);
  // And so on.
  ASSERT_EQ(Solve(first, "three",
                  "--localize --outputs=map.json,map.svg --map=" +
                      (folder_ / "both/map.json").string(),
                  &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("map.json not written: --localize leaves the "
                                "map as it is"));
  EXPECT_TRUE(SummaryOf("three")["logs"][0]["trajectory"].is_null());
  // What the summary names is there, of several logs, too.
  ASSERT_EQ(Solve(second + "," + first, "two",
                  flag + " --localize --outputs=trajectory.tum", &output),
            0)
      << output;
  EXPECT_EQ(Out("two", "trajectory.tum"),
            Out("two", "trajectory_1.tum") + Out("two", "trajectory_2.tum"));
  EXPECT_EQ(SummaryOf("two")["logs"][1]["trajectory"], "trajectory_2.tum");

  // A start where it is not: another place.
  EXPECT_EQ(Solve(second, "none", flag + " --start_pose=1:30,40,180", &output),
            4);
  EXPECT_THAT(output, HasSubstr("second.clf fits nowhere in"));
  EXPECT_THAT(output, HasSubstr("within 3 m and 45 degrees of where "
                                "--start_pose says"));
  EXPECT_THAT(output, HasSubstr("it was not looked for elsewhere"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));

  const auto refuses = [&](const std::string& flags, const char* why,
                           const std::string& out = "none") {
    EXPECT_EQ(Solve(second, out, flags, &output), 2) << flags;
    EXPECT_THAT(output, HasSubstr(why));
  };
  refuses("--localize", "--map=map.json");
  refuses(flag + " --localize --constraints=" + Write("walls.txt", ""),
          "--constraints: has no effect with --localize");
  refuses(flag, "another folder", "first");
  refuses(flag + " --refine=map", "full refinement");
  refuses(flag + " --start_pose=2:0,0,0", "1:3.5,-1,90");
  refuses("--map=/nowhere.json", "/nowhere.json");
  refuses(
      "--map=" + Write("old.json", R"({"features": [], "constraints": []})"),
      "has no key scans");
  refuses("--map=" + Write("cut.json", map.substr(0, map.size() / 2)),
          "is not JSON");
  EXPECT_EQ(
      Solve(Write("graph.g2o", "VERTEX_SE2 0 0 0 0\n"), "none", flag, &output),
      2);
  EXPECT_THAT(output,
              HasSubstr("graph.g2o is a graph: expected logs: --map goes "
                        "with nothing else"));
}

TEST_F(SolveTest, FlagsOfTheOtherInput) {
  const std::string log = Write("office.log", Join(OfficeLines(30)));
  std::string output;
  ASSERT_EQ(
      Solve(log, "out", "--initial_guess=chordal --outputs=graph.g2o", &output),
      0)
      << output;
  EXPECT_EQ(
      output.find(log + " is a log: --initial_guess is for graphs and has no "
                        "effect\n"),
      0u)
      << output;
  ASSERT_EQ(
      Solve(log, "out", "--quiet --initial_guess=chordal --outputs=graph.g2o",
            &output),
      0);
  EXPECT_EQ(output, "");
  ASSERT_EQ(Solve(log, "out",
                  "--scan_topic=/scan --odometry_topic=tf --outputs=graph.g2o",
                  &output),
            0);
  EXPECT_EQ(output.find(log + " is a CARMEN log: --odometry_topic, "
                              "--scan_topic are for bags and have no effect\n"),
            0u)
      << output;
  const std::string graph = Write("graph.g2o", Out("out", "graph.g2o"));
  // A value that is the default's asks for nothing.
  ASSERT_EQ(Solve(graph, "graph",
                  "--refine=full --link_radius=5 --laser_step=1 "
                  "--initial_guess=odometry --outputs=none",
                  &output),
            0)
      << output;
  EXPECT_THAT(output,
              HasSubstr(graph + " is a graph: --laser_step, --link_radius are "
                                "for logs and have no effect\n"));
}

// A grid that no memory holds is left out, with a message; the rest is there.
TEST_F(SolveTest, GridThatIsTooLarge) {
  std::string text;
  for (int i = 0; i < 5; ++i) {
    const double x = 40000.0 * i;
    text += "FLASER 3 5 5 5";
    for (int j = 0; j < 2; ++j) {
      text += " " + std::to_string(x) + " " + std::to_string(x) + " 0";
    }
    text += " " + std::to_string(100 + i) + " host 0\n";
  }
  std::string output;
  ASSERT_EQ(Solve(Write("far.log", text), "out",
                  "--odometry_refinement=false --refine=none", &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("occupancy.pgm not written: "));
  EXPECT_THAT(output, HasSubstr("cells of 0.05 m"));
  std::set<std::string> expected = FilesOfALog();
  // Nor are there rooms without a grid.
  EXPECT_THAT(output, HasSubstr("rooms.csv not written: "));
  expected.erase("occupancy.pgm");
  expected.erase("occupancy.yaml");
  expected.erase("rooms.csv");
  EXPECT_EQ(Files("out"), expected);
  // As --help has it.
  ASSERT_EQ(Run("--help | tr -s '\\n ' ' '", &output), 0);
  EXPECT_THAT(output, HasSubstr("more than " +
                                std::to_string(OccupancyOptions().max_cells) +
                                " such cells"));
}

TEST_F(SolveTest, WithoutStructure) {
  const std::string log = Write("office.log", Join(OfficeLines(150)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "--structure=false", &output), 0) << output;
  CheckFiles("out", FilesOfALog());
  const auto summary = SummaryOf("out");
  EXPECT_EQ(summary["flags"]["structure"], false);
  EXPECT_EQ(summary["cost"]["structure"], 0.0);
  EXPECT_FALSE(summary["counts"]["features"].contains("orientation"));
  for (const auto& type : summary["counts"]["constraints"]) {
    EXPECT_EQ(type["structure"], 0);
    EXPECT_EQ(type["broken"], 0);
  }
}

TEST_F(SolveTest, WithoutOdometryRefinement) {
  const std::string log = Write("office.log", Join(OfficeLines(150)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "--odometry_refinement=false", &output), 0)
      << output;
  CheckFiles("out", FilesOfALog());
  EXPECT_EQ(SummaryOf("out")["counts"]["scans"], 150);
  EXPECT_EQ(SummaryOf("out")["flags"]["odometry_refinement"], false);
}

TEST_F(SolveTest, StandardInput) {
  const std::string log = Write("office.log", Join(OfficeLines(60)));
  std::string output;
  ASSERT_EQ(Solve(log, "file", "", &output), 0) << output;
  ASSERT_EQ(Solve("-", "input", "<" + log, &output), 0) << output;
  EXPECT_EQ(SummaryOf("input")["input"], "-");
  EXPECT_TRUE(Out("file", "trajectory.tum") == Out("input", "trajectory.tum"));
  EXPECT_TRUE(Out("file", "map.json") == Out("input", "map.json"));
  EXPECT_TRUE(Out("file", "graph.g2o") == Out("input", "graph.g2o"));
  // Packed.
  ASSERT_EQ(std::system(("gzip -c " + log + " >" + log + ".gz").c_str()), 0);
  ASSERT_EQ(Solve("-", "packed", "<" + log + ".gz", &output), 0) << output;
  EXPECT_TRUE(Out("file", "map.json") == Out("packed", "map.json"));
}

// Once everything is read the signal is there already or comes within moments:
// hardly anything is solved, and what was done is written whole.
TEST_F(SolveTest, InterruptedRunsWriteWhatTheyHave) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const std::string text = Join(OfficeLines(400));
  // Longer than a pipe holds, so the binary is reading once it is written.
  ASSERT_GT(text.size(), 200000u);
  const std::string out = (folder_ / "out").string();
  // Of the whole log, which what was read of it is not.
  fs::create_directories(out);
  CheckpointFile state(
      folder_ / "out" / CheckpointFile::kName,
      [] {
        return CheckpointFile::Identity{{"the input", "whole"}};
      },
      1e-9);
  state.Offer([] { return std::string("state"); });
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    dup2(ends[0], STDIN_FILENO);
    close(ends[0]);
    close(ends[1]);
    if (std::freopen("/dev/null", "w", stderr) == nullptr) _exit(99);
    const std::string flag = "--output_dir=" + out;
    execl(binary_.c_str(), binary_.c_str(), "--input=-", flag.c_str(),
          static_cast<char*>(nullptr));
    _exit(99);
  }
  close(ends[0]);
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count =
        write(ends[1], text.data() + written, text.size() - written);
    ASSERT_GT(count, 0);
    written += count;
  }
  kill(child, SIGINT);
  close(ends[1]);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  const std::set<std::string> files = Files("out");
  for (const std::string& name : FilesOfAGraph()) {
    EXPECT_EQ(files.count(name), 1u) << name;
  }
  const auto summary = SummaryOf("out");
  EXPECT_LT(summary["counts"]["scans"], 400);
  EXPECT_EQ(summary["partial"], true);
  EXPECT_EQ(files.count(CheckpointFile::kName), 1u);
}

// Nothing more comes, and the pipe stays open.
TEST_F(SolveTest, InterruptedWhileWaitingForInput) {
  for (const int lines : {0, 300}) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const std::string name = "out" + std::to_string(lines);
    const std::string out = (folder_ / name).string();
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      dup2(ends[0], STDIN_FILENO);
      close(ends[0]);
      close(ends[1]);
      if (std::freopen("/dev/null", "w", stderr) == nullptr) _exit(99);
      const std::string flag = "--output_dir=" + out;
      execl(binary_.c_str(), binary_.c_str(), "--input=-", flag.c_str(),
            static_cast<char*>(nullptr));
      _exit(99);
    }
    close(ends[0]);
    const std::string text = lines > 0 ? Join(OfficeLines(lines)) : "";
    std::size_t written = 0;
    while (written < text.size()) {
      const ssize_t count =
          write(ends[1], text.data() + written, text.size() - written);
      ASSERT_GT(count, 0);
      written += count;
    }
    // Past the start of the process, where the signal would just end it.
    usleep(500000);
    kill(child, SIGINT);
    int status = 0;
    pid_t ended = 0;
    for (int i = 0; i < 600 && ended == 0; ++i) {
      usleep(50000);
      ended = waitpid(child, &status, WNOHANG);
    }
    if (ended == 0) kill(child, SIGKILL);
    close(ends[1]);
    ASSERT_EQ(ended, child);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 130);
    if (lines > 0) {
      EXPECT_EQ(Files(name).count("map.json"), 1u);
      EXPECT_LT(SummaryOf(name)["counts"]["scans"], 30);
    } else {
      EXPECT_FALSE(fs::exists(out));
    }
  }
}

const char kGraph[] =
    "# two corners of a room, seen along a drive\n"
    "VERTEX_SE2 10 0 0 0\n"
    "VERTEX_SE2 11 1.1 0.1 0.05\n"
    "VERTEX_SE2 12 2.1 0.1 1.6\n"
    "VERTEX_UNKNOWN 99 1 2 3\n"
    "FIX 10\n"
    "EDGE_SE2 10 11 1 0 0 100 0 0 100 0 1000\n"
    "EDGE_SE2 11 12 1 0 1.5707963 100 0 0 100 0 1000\n"
    "EDGE_SE2 10 12 2 0 1.5707963 100 0 0 100 0 1000\n";

TEST_F(SolveTest, Graph) {
  const std::string input = Write("small.g2o", kGraph);
  std::string output;
  ASSERT_EQ(Solve(input, "out", "", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("VERTEX_UNKNOWN"));
  CheckFiles("out", FilesOfAGraph());
  const auto summary = SummaryOf("out");
  EXPECT_EQ(summary["counts"]["scans"], 0);
  EXPECT_EQ(summary["counts"]["features"]["pose"]["0"], 3);
  EXPECT_EQ(summary["counts"]["constraints"]["pose_pose"]["measurement"], 3);
  EXPECT_GT(summary["cost"]["initial"].get<double>(), 1.0);
  EXPECT_LT(summary["cost"]["total"].get<double>(), 1e-6);
  EXPECT_TRUE(summary["orthogonality_deg"].is_null());
  Graph map;
  std::istringstream text(Out("out", "map.json"));
  ReadGraphJson(text, "map.json", registry_, &map);
  EXPECT_NEAR(map.GetFeature(1).parameters[0], 1.0, 1e-6);
  EXPECT_NEAR(map.GetFeature(1).parameters[1], 0.0, 1e-6);
  EXPECT_NEAR(map.GetFeature(2).parameters[0], 2.0, 1e-6);
  EXPECT_NEAR(map.GetFeature(2).parameters[2], 0.5 * kPi, 1e-6);
  // Ids and what is not known are kept.
  EXPECT_THAT(Out("out", "graph.g2o"),
              HasSubstr("\nVERTEX_UNKNOWN 99 1 2 3\n"));
  EXPECT_THAT(Out("out", "graph.g2o"), HasSubstr("\nFIX 10\n"));

  // The result is an input again, and stays as it is.
  ASSERT_EQ(Solve((folder_ / "out/graph.g2o").string(), "again", "", &output),
            0)
      << output;
  Graph stays;
  std::istringstream again(Out("again", "map.json"));
  ReadGraphJson(again, "map.json", registry_, &stays);
  EXPECT_NEAR(stays.GetFeature(2).parameters[0], 2.0, 1e-6);
}

// A way of four legs of one metre and left turns, all poses at the origin in
// the file; the last relation closes the loop. Then the same, one part beside
// the other without a link.
TEST_F(SolveTest, FilesThatAGraphDoesNotHave) {
  const std::string input = Write("small.g2o", kGraph);
  std::string output;
  ASSERT_EQ(
      Solve(input, "out", "--outputs=occupancy.pgm,rooms.csv,map.svg", &output),
      0)
      << output;
  EXPECT_THAT(output,
              HasSubstr("occupancy.pgm not written: a graph has no scans"));
  EXPECT_THAT(output, HasSubstr("rooms.csv not written: a graph has no scans"));
  EXPECT_THAT(output, Not(HasSubstr("trajectory.tum")));
  EXPECT_EQ(Files("out"), (std::set<std::string>{"map.svg", "summary.json"}));
  // Nobody asked for them.
  ASSERT_EQ(Solve(input, "out", "--outputs=all,-map.png", &output), 0);
  EXPECT_THAT(output, Not(HasSubstr("not written")));
}

TEST_F(SolveTest, StartsOfAGraph) {
  std::string graph;
  for (const int first : {0, 10}) {
    for (int i = 0; i < 4; ++i) {
      graph += "VERTEX_SE2 " + std::to_string(first + i) + " 0 0 0\n";
    }
    graph += "VERTEX_XY " + std::to_string(first + 5) + " 8 8\n";
    for (int i = 0; i < 4; ++i) {
      graph += "EDGE_SE2 " + std::to_string(first + i) + " " +
               std::to_string(first + (i + 1) % 4) +
               " 1 0 1.5707963267948966 9 0 0 4 0 25\n";
    }
    graph += "EDGE_SE2_XY " + std::to_string(first + 2) + " " +
             std::to_string(first + 5) + " 1 0 4 0 4\n";
  }
  const std::string input = Write("square.g2o", graph);
  std::string output;
  for (const std::string start : {"odometry", "spanning_tree", "chordal"}) {
    SCOPED_TRACE(start);
    ASSERT_EQ(Solve(input, start,
                    "--initial_guess=" + start + " --structure=false", &output),
              0)
        << output;
    const auto summary = SummaryOf(start);
    EXPECT_EQ(summary["flags"]["initial_guess"], start);
    const auto solver = summary["solver"];
    EXPECT_LT(solver["objective"].get<double>(), 1e-12);
    EXPECT_LT(summary["cost"]["initial"].get<double>(), 1e-12);
    EXPECT_EQ(solver["start"]["poses"], 8);
    EXPECT_EQ(solver["start"]["landmarks"], 2);
    EXPECT_EQ(solver["start"]["kept"], 0);
    EXPECT_TRUE(solver["converged"]);
    EXPECT_EQ(solver["solves"], 1);
    Graph map;
    std::istringstream text(Out(start, "map.json"));
    ReadGraphJson(text, "map.json", registry_, &map);
    // The tree: from the third corner, which looks back along the top edge.
    EXPECT_NEAR(map.GetFeature(9).parameters[0], 0.0, 1e-9);
    EXPECT_NEAR(map.GetFeature(9).parameters[1], 1.0, 1e-9);
  }
  EXPECT_EQ(Solve(input, "out", "--initial_guess=best", &output), 1);
  EXPECT_THAT(output, HasSubstr("spanning_tree"));
  // Too few steps are told of.
  ASSERT_EQ(Solve(input, "short",
                  "--max_solver_iterations=1 --structure=false "
                  "--outputs=none",
                  &output),
            0)
      << output;
  EXPECT_FALSE(SummaryOf("short")["solver"]["converged"]);
  EXPECT_FALSE(SummaryOf("short")["em"]["converged"]);
  EXPECT_EQ(SummaryOf("short")["em"]["termination"], "no_convergence");
  const std::string hint =
      "--initial_guess=chordal or a larger --max_solver_iterations may help";
  EXPECT_THAT(output, HasSubstr("the solver did not converge; " + hint));
  EXPECT_THAT(output, HasSubstr("worth a look: the solver did not converge (" +
                                hint + ")"));
  // So does the report.
  ASSERT_EQ(Solve(input, "short",
                  "--max_solver_iterations=1 --structure=false "
                  "--outputs=report.html",
                  &output),
            0)
      << output;
  EXPECT_THAT(Out("short", "report.html"), HasSubstr("\"unsolved\":\"" + hint));
}

TEST_F(SolveTest, AGraphThatBreaksOffWithinATag) {
  const std::string graph =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
      "EDGE_SE2 0 1 1 0 0 9 0 0 9 0 9\n";
  std::string output;
  ASSERT_EQ(Solve(Write("cut.g2o", graph + "PLU"), "out", "--outputs=graph.g2o",
                  &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("may break off: its last line, 'PLU', "));
  EXPECT_EQ(Out("out", "graph.g2o"), graph + "PLU");
  ASSERT_EQ(Solve(Write("whole.g2o", graph + "PLU\n"), "out",
                  "--outputs=graph.g2o", &output),
            0)
      << output;
  EXPECT_THAT(output, Not(HasSubstr("break off")));
}

// TORO's tags, and files in circulation that list relative poses only.
TEST_F(SolveTest, GraphsWithoutVertices) {
  const std::string edges =
      "EDGE_SE2 0 1 1 0 1.5707963267948966 100 0 0 100 0 1000\n"
      "EDGE_SE2 1 2 1 0 1.5707963267948966 100 0 0 100 0 1000\n"
      "EDGE_SE2 0 2 1 1 3.141592653589793 100 0 0 100 0 1000\n";
  const std::string toro =
      "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 1.57\nVERTEX2 2 1 1 3.14\n"
      "EDGE2 0 1 1 0 1.5707963267948966 100 0 100 1000 0 0\n"
      "EDGE2 1 2 1 0 1.5707963267948966 100 0 100 1000 0 0\n";
  std::string output;
  for (const auto& [name, text] : std::map<std::string, std::string>{
           {"edges.g2o", edges},
           {"toro.graph", toro},
           {"bom.g2o", "\xEF\xBB\xBF" + edges}}) {
    ASSERT_EQ(Solve(Write(name, text), "out", "--structure=false", &output), 0)
        << name << output;
    EXPECT_EQ(output.find("lists edges only") != std::string::npos,
              name != "toro.graph");
    CheckFiles("out", FilesOfAGraph());
    Graph graph;
    std::istringstream solved(Out("out", "graph.g2o"));
    ReadG2o(solved, "graph.g2o", registry_, &graph);
    ASSERT_EQ(graph.num_features(), 3u) << name;
    EXPECT_NEAR(graph.GetFeature(2).parameters[0], 1.0, 1e-6);
    EXPECT_NEAR(graph.GetFeature(2).parameters[1], 1.0, 1e-6);
  }
  const std::string path = (folder_ / "edges.g2o").string();
  EXPECT_EQ(Solve(path, "out", "--initial_guess=file", &output), 2);
  EXPECT_THAT(output, HasSubstr("lists edges only"));
  EXPECT_EQ(Solve(path, "out", "--initial_guess=spanning_tree", &output), 0);
  EXPECT_THAT(output, Not(HasSubstr("lists edges only")));
}

// Names and sources are bytes, whatever they are.
TEST_F(SolveTest, NamesThatAreNoText) {
  std::string text = Join(OfficeLines(60));
  std::string output;
  for (const std::string name : {"B\xFCro.log", "a\x01\x1b[2J\n<&\".log"}) {
    const std::string log = Write(name, text);
    ASSERT_EQ(Solve(log, "out", "--outputs=all", &output), 0) << output;
    for (const char* picture : {"floorplan.svg", "map.svg"}) {
      const std::string svg = Out("out", picture);
      EXPECT_TRUE(IsWellFormed(svg)) << picture;
      EXPECT_EQ(svg, KeepPrintable(svg)) << picture;
    }
    EXPECT_FALSE(
        nlohmann::json::parse(Out("out", "floorplan.geojson"), nullptr, false)
            .is_discarded());
    // Nor does a terminal obey what a folder is named, or a file that is bad.
    ASSERT_EQ(Solve(log, "out" + name, "--outputs=map.json", &output), 0)
        << output;
    EXPECT_EQ(output.find('\x1b'), std::string::npos);
    EXPECT_EQ(Solve(Write("bad" + name, "nothing"), "out", "", &output), 2);
    EXPECT_EQ(output.find('\x1b'), std::string::npos);
  }
}

TEST_F(SolveTest, AByteOrderMarkIsNoPartOfALog) {
  const std::string text = Join(OfficeLines(20));
  const std::size_t first = text.find("\nFLASER") + 1;
  std::string output;
  ASSERT_EQ(Solve(Write("bom.log", "\xEF\xBB\xBF" + text.substr(first)), "out",
                  "", &output),
            0)
      << output;
  EXPECT_EQ(SummaryOf("out")["counts"]["scans"], 20);
  EXPECT_TRUE(SummaryOf("out")["frontend"]["skipped"].empty());
}

// What is written can be read.
TEST_F(SolveTest, TimeStampsOfAllSpellings) {
  std::string text;
  for (const char* stamp : {"1e-400", "+0.5", "1.5", "25e-1"}) {
    std::string line = Flaser(RoomRanges(0.0, 181), 0.0, 7.0);
    line.replace(line.find(" 7 host 7"), 9,
                 std::string(" ") + stamp + " host 7");
    text += line + "\n";
  }
  std::string output;
  ASSERT_EQ(Solve(Write("stamps.log", text), "out", "", &output), 0) << output;
  const std::vector<TimedPose> trajectory =
      ReadTum((folder_ / "out/trajectory.tum").string());
  ASSERT_EQ(trajectory.size(), 4u);
  EXPECT_EQ(trajectory[0].timestamp, 0.0);
  EXPECT_EQ(trajectory[1].timestamp, 0.5);
  EXPECT_EQ(trajectory[3].timestamp, 2.5);
}

// Nobody writes to it.
TEST_F(SolveTest, APipeAsInputAnswersTheFirstInterrupt) {
  const std::string pipe_name = (folder_ / "pipe").string();
  ASSERT_EQ(mkfifo(pipe_name.c_str(), 0600), 0);
  std::string output;
  // In the foreground timeout interrupts once, else the group as well as the
  // program: a second interrupt ends it without a word.
  EXPECT_EQ(
      RunInShell("timeout --foreground --signal=INT --kill-after=20 1 '" +
                     binary_ + "' --input='" + pipe_name + "' --output_dir='" +
                     (folder_ / "out").string() + "'; exit $?",
                 &output),
      124);
  EXPECT_THAT(output, HasSubstr("interrupted"));
  // And with a writer it is read.
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  EXPECT_EQ(
      RunInShell("(sleep 0.3; cat '" + log + "' >'" + pipe_name + "') & '" +
                     binary_ + "' --input='" + pipe_name + "' --output_dir='" +
                     (folder_ / "out").string() + "'",
                 &output),
      0)
      << output;
  EXPECT_EQ(SummaryOf("out")["counts"]["scans"], 20);
  // The small files that flags name.
  const std::string solve = binary_ + "' --input='" + log + "' --output_dir='" +
                            (folder_ / "out").string() + "' '--";
  const std::string simulate = PLUMBLINE_BIN_DIR
                               "/plumbline_simulate' --output='" +
                               (folder_ / "simulated.log").string() + "' '--";
  for (const std::string& command : {solve + "plan", solve + "constraints",
                                     solve + "map", simulate + "world"}) {
    EXPECT_EQ(
        RunInShell("timeout --foreground --signal=INT --kill-after=20 1 '" +
                       command + "=" + pipe_name + "'; exit $?",
                   &output),
        124)
        << command;
    EXPECT_THAT(output, HasSubstr("interrupted")) << command;
  }
  // One in the place of an output is refused before the work.
  fs::create_directories(folder_ / "pipes");
  ASSERT_EQ(mkfifo((folder_ / "pipes/map.svg").c_str(), 0600), 0);
  EXPECT_EQ(Solve(log, "pipes", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("map.svg: is a pipe"));
}

TEST_F(SolveTest, FlagsThatSayMoreOfOneThatIsNotGiven) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  const std::pair<const char*, const char*> cases[] = {
      {"--plan_pose=1,2,90", "--plan"},
      {"--plan_layers=WALLS", "--plan"},
      {"--plan_sigma=0.1", "--plan"},
      {"--live_every=1", "--live_dir"},
      {"--marginals_hold_gauge", "--marginals"},
      {"--start_pose=2:0,0,0", "a second log, or --map"}};
  for (const auto& [flag, needed] : cases) {
    const std::string name =
        std::string(flag).substr(0, std::string(flag).find('='));
    std::string output;
    EXPECT_EQ(Solve(log, "out", flag, &output), 2) << flag;
    EXPECT_THAT(output, HasSubstr(name + ": "));
    EXPECT_THAT(output, HasSubstr(needed));
  }
  EXPECT_TRUE(Files("out").empty());
}

TEST_F(SolveTest, FlagsOfStructureWhereNoneIsLookedFor) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  // All that the help lists of structure, and its weighing.
  const std::string flags =
      "--hierarchy=orientation_mixture --allowed_angles=0,90 "
      "--angle_resolution=90 --structure_sigma_segment_orientation=1 "
      "--structure_sigma_orientation_orientation=1 "
      "--structure_sigma_same_wall=0.1 --structure_sigma_same_wall_angle=1 "
      "--structure_sigma_point_line_distance=0.1 "
      "--structure_sigma_point_circle_distance=0.1 "
      "--structure_sigma_point_point_coincidence=0.1 "
      "--detector_parameters=same_wall.sigma_offset=0.1 "
      "--structure_prior='" +
      Write("my.prior", "angle 0\n") +
      "' --delta_threshold=0.1 --delta_mode=cauchy --full_weight_test=true ";
  std::string output;
  ASSERT_EQ(Solve(log, "out", flags + "--structure=false", &output), 0)
      << output;
  const std::size_t begin = output.find("--structure=false: ");
  ASSERT_NE(begin, std::string::npos) << output;
  const std::string remark =
      output.substr(begin, output.find('\n', begin) - begin);
  EXPECT_THAT(remark, HasSubstr("say more of structure and have no effect"));
  std::istringstream words(flags);
  std::string word;
  while (words >> word) {
    if (word.substr(0, 2) != "--") continue;
    EXPECT_THAT(remark, HasSubstr(word.substr(0, word.find('='))));
  }
  // One of them is said in the singular, and none where there is structure.
  ASSERT_EQ(
      Solve(log, "out", "--delta_threshold=0.1 --structure=false", &output), 0);
  EXPECT_THAT(output, HasSubstr("--structure=false: --delta_threshold says "
                                "more of structure and has no effect\n"));
  ASSERT_EQ(Solve(log, "out", "--delta_threshold=0.1", &output), 0);
  EXPECT_THAT(output, Not(HasSubstr("no effect")));
}

TEST_F(SolveTest, FlagsThatAreNotUnderstood) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  std::string output;
  for (const char* text : {"--sede=3\n", "seed=3\n", "--seed = 3\n", "--seed\n",
                           "--nostructure=false\n", "\x01\xff\n"}) {
    const std::string flags = Write("my.flags", text);
    EXPECT_EQ(Solve(log, "out", "--flagfile='" + flags + "'", &output), 1)
        << text;
    EXPECT_THAT(output, HasSubstr("my.flags:1: "));
    EXPECT_THAT(output, HasSubstr("expected"));
  }
  EXPECT_EQ(Solve(log, "out", "--nostructure=false", &output), 1);
  EXPECT_TRUE(Files("out").empty());
  ASSERT_EQ(
      Solve(log, "out",
            "--flagfile='" + Write("my.flags", "\xEF\xBB\xBF--seed=3\n") + "'",
            &output),
      0)
      << output;
  EXPECT_EQ(SummaryOf("out")["seed"], 3);
  // Devices and packed nothing have no end.
  for (const char* flag : {"structure_prior", "plan", "constraints", "map"}) {
    EXPECT_EQ(
        Solve(log, "out", "--" + std::string(flag) + "=/dev/zero", &output), 2)
        << flag;
    EXPECT_THAT(output, HasSubstr("/dev/zero: ")) << flag;
  }
  EXPECT_EQ(RunInShell(PLUMBLINE_BIN_DIR
                           "/plumbline_simulate --world=/dev/zero --output='" +
                           (folder_ / "simulated.log").string() + "'",
                       &output),
            2);
  EXPECT_THAT(output, HasSubstr("/dev/zero"));
}

TEST_F(SolveTest, FrameOfTheInformation) {
  // Two ways from one pose to another that differ by (1, 1); turned by a
  // quarter, x and y of the first change their weights.
  const std::string input = Write("frame.g2o",
                                  "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n"
                                  "FIX 0\n"
                                  "EDGE_SE2 0 1 0 0 1.5707963267948966 "
                                  "4 0 0 1 0 1000\n"
                                  "EDGE_SE2 0 1 1 1 1.5707963267948966 "
                                  "1 0 0 1 0 1000\n");
  std::string output;
  const std::map<std::string, Eigen::Vector2d> expected = {
      {"first", {0.2, 0.5}}, {"second", {0.5, 0.2}}};
  for (const auto& [frame, position] : expected) {
    ASSERT_EQ(
        Solve(input, frame,
              "--information_frame=" + frame + " --structure=false", &output),
        0)
        << output;
    Graph map;
    std::istringstream text(Out(frame, "map.json"));
    ReadGraphJson(text, "map.json", registry_, &map);
    // The second, of equal weights, is the same either way.
    EXPECT_NEAR(map.GetFeature(1).parameters[0], position[0], 1e-6) << frame;
    EXPECT_NEAR(map.GetFeature(1).parameters[1], position[1], 1e-6) << frame;
  }
}

TEST_F(SolveTest, PublicGraphsComeBackByteForByte) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  for (const char* name : {"manhattanOlson3500", "city10000", "intel_posegraph",
                           "dlr", "segway_lines", "victoriaPark"}) {
    SCOPED_TRACE(name);
    const fs::path path = fs::path(folder == nullptr ? "" : folder) / "graphs" /
                          (std::string(name) + ".g2o.bz2");
    if (folder == nullptr || !fs::exists(path)) {
      GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with graphs/" << name
                   << ".g2o.bz2";
    }
    InputStream input(path.string());
    const std::string text = input.ReadRest();
    for (const bool information_at_second : {false, true}) {
      G2oOptions options;
      options.information_at_second = information_at_second;
      std::istringstream stream(text);
      Graph graph;
      const G2oFile file = ReadG2o(stream, name, registry_, &graph, options);
      std::ostringstream output;
      WriteG2o(graph, &file, output);
      EXPECT_TRUE(output.str() == text);
    }
  }
}

// Nearly all corridors of mit-killian share two directions. One scan of 17,480
// that was matched where wheels say, 0.11 m beside its way, cost a third of it
// that once.
TEST_F(SolveTest, KillianSharesItsDirections) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  const fs::path log =
      fs::path(folder == nullptr ? "" : folder) / "mit-killian.clf.bz2";
  if (folder == nullptr || !fs::exists(log)) {
    GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with mit-killian";
  }
  std::string output;
  ASSERT_EQ(Solve(log.string(), "out", "--outputs=map.json", &output), 0)
      << output;
  Graph graph;
  std::istringstream text(Out("out", "map.json"));
  ReadGraphJson(text, "map.json", registry_, &graph);
  double all = 0.0;
  double tied = 0.0;
  for (const Feature* feature : graph.Features()) {
    const std::optional<Wall> wall = WallOf(*feature);
    if (!wall) continue;
    all += wall->length();
    for (const ConstraintId id : graph.ConstraintsOf(feature->id)) {
      const Constraint& constraint = graph.GetConstraint(id);
      if (constraint.kind != ConstraintClass::kStructure ||
          !constraint.type->Is(RelationRole::kDirection) ||
          constraint.state != ConstraintState::kLive) {
        continue;
      }
      tied += wall->length();
      break;
    }
  }
  EXPECT_GT(all, 1500.0);
  EXPECT_GT(tied, 0.9 * all);
}

TEST_F(SolveTest, MarginalsOfAGraph) {
  // The second pose: 1/4, 1/9 and 1/16.
  const std::string graph =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
      "EDGE_SE2 0 1 1 0 0 4 0 0 9 0 16\n";
  std::string output;
  const std::string loose = Write("loose.g2o", graph);
  EXPECT_EQ(Solve(loose, "loose", "--marginals=pose", &output), 2);
  EXPECT_THAT(output, HasSubstr("gauge"));
  EXPECT_THAT(output, HasSubstr("FIX"));
  EXPECT_EQ(Solve(loose, "held",
                  "--marginals=pose --marginals_hold_gauge --outputs=map.json",
                  &output),
            0)
      << output;
  const std::string input = Write("fixed.g2o", graph + "FIX 0\n");
  ASSERT_EQ(Solve(input, "out", "--marginals=pose --ellipse_sigmas=2", &output),
            0)
      << output;
  for (const char* out : {"held", "out"}) {
    const auto map = nlohmann::json::parse(Out(out, "map.json"));
    const auto covariance = map["features"][1]["covariance"];
    EXPECT_NEAR(covariance[0][0].get<double>(), 0.25, 1e-9);
    EXPECT_NEAR(covariance[1][1].get<double>(), 1.0 / 9.0, 1e-9);
    EXPECT_NEAR(covariance[2][2].get<double>(), 1.0 / 16.0, 1e-9);
  }
  // The ellipse is drawn: the picture differs from one without.
  const std::string with = Out("out", "map.svg");
  EXPECT_TRUE(IsWellFormed(with));
  ASSERT_EQ(Solve(input, "plain", "--marginals=pose", &output), 0) << output;
  EXPECT_GT(with.size(), Out("plain", "map.svg").size());
  EXPECT_NE(Out("out", "map.png"), Out("plain", "map.png"));
  EXPECT_EQ(Solve(input, "bad", "--marginals=tree", &output), 2);
  EXPECT_THAT(output, HasSubstr("unknown word 'tree'"));
  EXPECT_EQ(Solve(input, "bad", "--ellipse_sigmas=2", &output), 2);
  EXPECT_THAT(output, HasSubstr("--marginals"));
}

TEST_F(SolveTest, MarginalsThatTheMapDoesNotHave) {
  // Nothing that was computed is lost for them.
  const std::string log = Write("short.clf", Join(OfficeLines(120)));
  std::string output;
  ASSERT_EQ(Solve(log, "some", "--marginals=segment,circle,99999", &output), 0)
      << output;
  EXPECT_THAT(output, HasSubstr("--marginals=segment,circle,99999: the map has "
                                "no circle that was measured, no feature "
                                "99999"));
  ASSERT_EQ(Solve(log, "none", "--marginals=point,line", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("and so no covariances"));
  std::map<std::string, int> with;
  for (const char* out : {"some", "none"}) {
    const auto map = nlohmann::json::parse(Out(out, "map.json"));
    for (const auto& feature : map["features"]) {
      if (feature.contains("covariance")) ++with[out];
    }
  }
  EXPECT_GT(with["some"], 0);
  EXPECT_EQ(with["none"], 0);
  EXPECT_EQ(Files("none"), FilesOfALog());
}

// The graphs that the field compares by, to the objective that a solve to
// rounding reaches (README).
TEST_F(SolveTest, PublicGraphs) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  struct Case {
    std::string name;
    std::string flags;
    double objective;
  };
  const std::vector<Case> cases = {
      {"manhattanOlson3500", "", 146.0766129},
      {"manhattanOlson3500", "--initial_guess=chordal", 146.0766129},
      {"city10000", "", 511.9851636},
      {"city10000", "--initial_guess=chordal", 511.9851636},
      {"intel_posegraph", "--initial_guess=chordal", 214.1708558},
      {"intel_posegraph",
       "--initial_guess=spanning_tree --information_frame=second", 215.8302350},
      {"dlr", "", 56871.44854},
      {"dlr", "--initial_guess=chordal", 56871.44854},
      {"segway_lines", "", 34539.51402},
      {"victoriaPark", "--initial_guess=chordal", 389.956505}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name + " " + c.flags);
    const fs::path input = fs::path(folder == nullptr ? "" : folder) /
                           "graphs" / (c.name + ".g2o.bz2");
    if (folder == nullptr || !fs::exists(input)) {
      GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with graphs/"
                   << c.name << ".g2o.bz2";
    }
    std::string output;
    ASSERT_EQ(Solve(input.string(), "out",
                    "--structure=false --outputs=none " + c.flags, &output),
              0)
        << output;
    const auto solver = SummaryOf("out")["solver"];
    EXPECT_TRUE(solver["converged"]);
    EXPECT_NEAR(solver["objective"].get<double>(), c.objective,
                1e-6 * c.objective);
  }
}

// Structure of points is looked for without being asked.
TEST_F(SolveTest, GraphOfPoints) {
  const SyntheticWorld world =
      MakeSyntheticWorld("S1", DefaultSyntheticOptions("S1"), 1, registry_);
  std::ostringstream graph;
  WriteG2o(*world.graph, nullptr, graph);
  const std::string input = Write("s1.g2o", graph.str());
  std::string output;
  ASSERT_EQ(Solve(input, "out", "--num_threads=1", &output), 0) << output;
  ASSERT_EQ(Solve(input, "again", "--num_threads=2", &output), 0) << output;
  CheckFiles("out", FilesOfAGraph());
  ExpectSame("out", "again");
  const auto features = SummaryOf("out")["counts"]["features"];
  EXPECT_EQ(features["point"]["0"], 572);
  EXPECT_EQ(features["line"]["1"], 14);
  EXPECT_EQ(features["circle"]["1"], 8);
  EXPECT_EQ(features["point"]["2"], 4);
  EXPECT_EQ(features["orientation"]["2"], 2);
  // Lines are drawn as far as the points on them reach.
  Graph map;
  std::istringstream text(Out("out", "map.json"));
  ReadGraphJson(text, "map.json", registry_, &map);
  for (const Feature* line : map.Features()) {
    if (line->type->name != "line") continue;
    double begin = 1e9, end = -1e9;
    for (const ConstraintId id : map.ConstraintsOf(line->id)) {
      const Constraint& constraint = map.GetConstraint(id);
      if (constraint.state != ConstraintState::kLive) continue;
      const Feature& other = map.GetFeature(constraint.features[0]);
      if (other.type->name != "point") continue;
      const double along = std::cos(line->parameters[1]) *
                               (other.parameters[0] - line->anchor[0]) +
                           std::sin(line->parameters[1]) *
                               (other.parameters[1] - line->anchor[1]);
      begin = std::min(begin, along);
      end = std::max(end, along);
    }
    EXPECT_NEAR(line->extent_begin, begin, 1e-9) << line->id;
    EXPECT_NEAR(line->extent_end, end, 1e-9) << line->id;
  }
  // Without structure the same input has its measurements only.
  ASSERT_EQ(Solve(input, "without", "--structure=false", &output), 0) << output;
  EXPECT_EQ(SummaryOf("without")["counts"]["features"].size(), 1u);
  EXPECT_EQ(SummaryOf("without")["cost"]["structure"], 0.0);
  EXPECT_THAT(output, Not(HasSubstr("leaves out")));
  // So has the graph that was written with structure, and the run says so.
  ASSERT_EQ(Solve((folder_ / "out/graph.g2o").string(), "measured",
                  "--structure=false", &output),
            0)
      << output;
  EXPECT_THAT(output, HasSubstr("--structure=false leaves out its structure"));
  EXPECT_EQ(SummaryOf("measured")["counts"]["features"].size(), 1u);
  EXPECT_EQ(SummaryOf("measured")["counts"]["features"]["point"]["0"], 572);
  EXPECT_EQ(SummaryOf("measured")["cost"]["structure"], 0.0);
  EXPECT_THAT(Out("measured", "graph.g2o"), Not(HasSubstr(" structure ")));
}

// Table 1, row 4: rooms, in all that is written.
TEST_F(SolveTest, GraphOfRooms) {
  const std::vector<HierarchyCase> cases = HierarchyCases();
  const auto rooms = std::find_if(
      cases.begin(), cases.end(),
      [](const HierarchyCase& row) { return row.name.find("Row4") == 0; });
  ASSERT_NE(rooms, cases.end());
  HierarchyWorld world(registry_, 1);
  rooms->make(&world);
  Graph graph;
  world.Build(&graph);
  std::ostringstream text;
  WriteG2o(graph, nullptr, text);
  const std::string input = Write("rooms.g2o", text.str());
  const std::string flags = "--hierarchy=" + rooms->hierarchy;
  std::string output;
  ASSERT_EQ(Solve(input, "out", flags + " --num_threads=1", &output), 0)
      << output;
  ASSERT_EQ(Solve(input, "again", flags + " --num_threads=2", &output), 0)
      << output;
  CheckFiles("out", FilesOfAGraph());
  ExpectSame("out", "again");
  const auto counts = SummaryOf("out")["counts"];
  EXPECT_EQ(counts["features"]["rectangle"]["1"], 5);
  EXPECT_EQ(counts["features"]["orientation"]["2"], 2);
  EXPECT_EQ(counts["constraints"]["segment_rectangle"]["structure"], 21);
  EXPECT_EQ(counts["constraints"]["rectangle_orientation"]["structure"], 10);
  Graph map;
  std::istringstream json(Out("out", "map.json"));
  ReadGraphJson(json, "map.json", registry_, &map);
  EXPECT_THAT(CompareWithTruth(map, world.truth()), ::testing::IsEmpty());
  // Each is an area on the map, and one stands for them in the legend.
  const std::string svg = Out("out", "map.svg");
  const std::string color = "98.431373%";
  int areas = 0;
  for (std::size_t at = svg.find(color); at != std::string::npos;
       at = svg.find(color, at + 1)) {
    ++areas;
  }
  EXPECT_EQ(areas, 6);
  // A level that is in the wrong place is refused with what fits where.
  EXPECT_EQ(Solve(input, "none", "--hierarchy=orientation_mixture/rectangle",
                  &output),
            2);
  EXPECT_THAT(output, HasSubstr("'rectangle' has nothing to read at level 1"));
  EXPECT_THAT(output, HasSubstr("level 0 (pose, segment): "));
}

// A prior says which angles hold and how tightly; what it leaves out is not
// found.
TEST_F(SolveTest, StructurePrior) {
  const std::vector<HierarchyCase> cases = HierarchyCases();
  const auto wing = std::find_if(
      cases.begin(), cases.end(),
      [](const HierarchyCase& row) { return row.name.find("Row3") == 0; });
  ASSERT_NE(wing, cases.end());
  HierarchyWorld world(registry_, 1);
  wing->make(&world);
  Graph graph;
  world.Build(&graph);
  std::ostringstream text;
  WriteG2o(graph, nullptr, text);
  const std::string input = Write("wing.g2o", text.str());
  const std::string prior =
      Write("grid.prior",
            "# A court at right angles; nothing is known of its wing.\n"
            "angle 90 0.05\n"
            "relation segment_orientation 0.25 deg\n");
  std::string output;
  ASSERT_EQ(Solve(input, "without", "", &output), 0) << output;
  ASSERT_EQ(Solve(input, "out", "--structure_prior=" + prior, &output), 0)
      << output;
  CheckFiles("out", FilesOfAGraph());
  const auto constraints = [&](const std::string& out) {
    return SummaryOf(out)["counts"]["constraints"];
  };
  EXPECT_EQ(constraints("without")["orientation_orientation"]["structure"], 3);
  EXPECT_EQ(constraints("out")["orientation_orientation"]["structure"], 1);
  EXPECT_EQ(constraints("out")["segment_orientation"]["structure"], 12);
  EXPECT_EQ(SummaryOf("out")["flags"]["structure_prior"], prior);
  Graph map;
  std::istringstream json(Out("out", "map.json"));
  ReadGraphJson(json, "map.json", registry_, &map);
  for (const Constraint* constraint : map.Constraints()) {
    const double sigma =
        RadToDeg(1.0 / std::sqrt(constraint->information(0, 0)));
    if (constraint->type->name == "segment_orientation") {
      EXPECT_NEAR(sigma, 0.25, 1e-9);
    } else if (constraint->type->name == "orientation_orientation") {
      EXPECT_NEAR(sigma, 0.05, 1e-9);
      EXPECT_NEAR(std::abs(constraint->expected[0]), kPi / 2, 1e-9);
    }
  }
  const std::string none =
      Write("none.prior", "relation segment_orientation no\n");
  ASSERT_EQ(Solve(input, "none", "--structure_prior=" + none, &output), 0)
      << output;
  EXPECT_EQ(SummaryOf("none")["counts"]["features"].count("orientation"), 0u);

  // Errors name the line, and nothing is written.
  const std::string broken = Write("broken.prior", "angle 90\nangel 0\n");
  EXPECT_EQ(Solve(input, "broken", "--structure_prior=" + broken, &output), 2);
  EXPECT_THAT(output, HasSubstr("broken.prior:2: 'angel' is no statement"));
  EXPECT_EQ(Solve(input, "broken", "--structure_prior=/no/such", &output), 2);
  EXPECT_THAT(output, HasSubstr("/no/such: cannot be read: No such file"));
  EXPECT_TRUE(Files("broken").empty());
}

// Graphs of points that are wrong, each with the line, and graphs in which
// there is nothing to find.
TEST_F(SolveTest, BadGraphsOfPoints) {
  const std::string points =
      "VERTEX_XY 0 0 0\nVERTEX_XY 1 1 0\nVERTEX_XY 2 2 0.1\n";
  const std::string tag = "PLUMBLINE_POINT_POINT_DISTANCE ";
  const std::pair<std::string, const char*> cases[] = {
      // An id that is nowhere, twice the same, not positive semidefinite.
      {points + tag + "0 7 1 100\n", "bad.g2o:4: "},
      {points + "VERTEX_XY 1 5 5\n", "bad.g2o:4: "},
      {points + tag + "0 1 1 -100\n", "bad.g2o:4: "},
      {points + tag + "0 1 1 nan\n", "bad.g2o:4: "},
      {points + tag + "0 1 inf 100\n", "bad.g2o:4: "},
      {points + tag + "0 1 1\n", "bad.g2o:4: "},
      {points + tag + "0 1 1 100 100\n", "bad.g2o:4: "},
      {points + tag + "0 1.5 1 100\n", "bad.g2o:4: "},
      {points + tag + "1 1 1 100\n", "bad.g2o:4: "},
      {"VERTEX_XY 0 0 0\nVERTEX_XY 1 nan 0\n", "bad.g2o:2: "},
      {"VERTEX_XY 0 0 0\nVERTEX_XY 1 0\n", "bad.g2o:2: "},
      {"VERTEX_XY 0 0 0\nVERTEX_XY 1 1e400 0\n", "bad.g2o:2: "}};
  std::string output;
  for (const auto& [graph, where] : cases) {
    EXPECT_EQ(Solve(Write("bad.g2o", graph), "out", "", &output), 2) << graph;
    EXPECT_THAT(output, HasSubstr(where)) << graph;
    EXPECT_THAT(output, HasSubstr("expected")) << graph;
  }
  EXPECT_TRUE(Files("out").empty());

  // Unknown tags are counted, and what is known is solved.
  ASSERT_EQ(
      Solve(Write("tags.g2o", points + "VERTEX_TREE 9 1\nVERTEX_TREE 8 1\n"),
            "tags", "", &output),
      0)
      << output;
  EXPECT_THAT(output, HasSubstr("2 lines with the unknown tag VERTEX_TREE"));
  EXPECT_EQ(SummaryOf("tags")["counts"]["features"]["point"]["0"], 3);
}

// Nothing at all is no graph.
// Numbers that are finite and have squares that are not.
TEST_F(SolveTest, ObjectivesThatOverflow) {
  std::string output;
  for (const char* text : {"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1e200 0 0\n"
                           "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n",
                           "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
                           "EDGE_SE2 0 1 1e200 0 0 1 0 0 1 0 1\n"}) {
    EXPECT_EQ(Solve(Write("large.g2o", text), "out", "", &output), 2) << text;
    EXPECT_THAT(output, HasSubstr("large.g2o: the sum of squared residuals"));
    EXPECT_THAT(output, HasSubstr("expected"));
  }
  EXPECT_TRUE(Files("out").empty());
}

TEST_F(SolveTest, NoGraph) {
  std::string output;
  for (const char* const text : {"", "\n\n", "# nothing\n"}) {
    EXPECT_EQ(Solve(Write("none.g2o", text), "out", "", &output), 2) << text;
    EXPECT_THAT(output, HasSubstr("none.g2o")) << text;
    EXPECT_THAT(output, HasSubstr("expected")) << text;
  }
  EXPECT_TRUE(Files("out").empty());
}

TEST_F(SolveTest, DegenerateGraphsOfPoints) {
  std::string isolated, one_spot;
  for (int i = 0; i < 30; ++i) {
    const std::string id = std::to_string(i);
    isolated += "VERTEX_XY " + id + " " + id + " 0\n";
    one_spot += "VERTEX_XY " + id + " 3 4\n";
    if (i > 0) {
      one_spot += "PLUMBLINE_POINT_POINT_DISTANCE " + std::to_string(i - 1) +
                  " " + id + " 0 100\n";
    }
  }
  const std::string three =
      "VERTEX_XY 0 0 0\nVERTEX_XY 1 1 0\nVERTEX_XY 2 2 0.1\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 0 1 1 100\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 1 2 1 100\n";
  for (const std::string& graph : {isolated, one_spot, three}) {
    SCOPED_TRACE(graph.substr(0, 40));
    std::string output;
    ASSERT_EQ(Solve(Write("points.g2o", graph), "out", "", &output), 0)
        << output;
    CheckFiles("out", FilesOfAGraph());
    EXPECT_EQ(SummaryOf("out")["counts"]["features"].size(), 1u);
  }
}

TEST_F(SolveTest, MapOfALogIsAGraphToSolve) {
  const std::string log = Write("office.log", Join(OfficeLines(150)));
  std::string output;
  ASSERT_EQ(Solve(log, "out", "", &output), 0) << output;
  ASSERT_EQ(Solve((folder_ / "out/graph.g2o").string(), "again", "", &output),
            0)
      << output;
  CheckFiles("again", FilesOfAGraph());
  EXPECT_TRUE(SummaryOf("again")["em"]["converged"].get<bool>());
  EXPECT_EQ(SummaryOf("again")["counts"]["features"]["segment"],
            SummaryOf("out")["counts"]["features"]["segment"]);
}

TEST_F(SolveTest, ListPlugins) {
  std::string output;
  EXPECT_EQ(Run("--list_plugins", &output), 0);
  for (const char* name :
       {"segment", "orientation", "pose_pose", "segment_orientation", "frozen",
        "geman_mcclure", "orientation_mixture", "orientation_relation"}) {
    EXPECT_THAT(output, HasSubstr(std::string("  ") + name + " ")) << name;
  }
  // Parameters of detectors with their defaults, units and meanings.
  EXPECT_THAT(output, HasSubstr("\n    min_side=1 m "));
  EXPECT_THAT(output, HasSubstr("\n    gate_deg=3 deg "));
  EXPECT_THAT(output, HasSubstr("\n    angle_0, angle_1, ... deg "));
  EXPECT_EQ(Run("--list_plugins --plugins=no_such_plugin.so", &output), 2);
  EXPECT_THAT(output, HasSubstr("no_such_plugin.so"));
}

TEST_F(SolveTest, Usage) {
  std::string output;
  EXPECT_EQ(Run("", &output), 1);
  EXPECT_THAT(output, HasSubstr("--input"));
  EXPECT_EQ(Run("--input=" + office_, &output), 1);
  EXPECT_THAT(output, HasSubstr("--output_dir"));
  EXPECT_EQ(Run("--help", &output), 0);
  EXPECT_THAT(output, HasSubstr("Example:"));
  EXPECT_THAT(output, HasSubstr("--delta_threshold"));
}

TEST_F(SolveTest, AbsurdFlags) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  std::string output;
  for (const char* flag : {"--delta_threshold=2",
                           "--delta_threshold=nan",
                           "--delta_threshold=x",
                           "--delta_mode=sometimes",
                           "--link_radius=0",
                           "--link_radius=-1",
                           "--link_radius=inf",
                           "--association_depth=0",
                           "--em_every=-1",
                           "--em_max_iterations=0",
                           "--num_threads=-1",
                           "--num_threads=1e9",
                           "--seed=-1",
                           "--angle_resolution=-5",
                           "--usable_range=0",
                           "--structure_sigma_segment_orientation=0",
                           "--refine=perhaps",
                           "--allowed_angles=x",
                           "--allowed_angles=nan",
                           "--allowed_angles=0,,90",
                           "--allowed_angles=1e9",
                           "--allowed_angles=",
                           "--angle_resolution=1e-6",
                           "--laser_start_angle=x",
                           "--laser_start_angle=361",
                           "--laser_step=nan",
                           "--laser_step=0",
                           "--laser_max_range=-1",
                           "--no_such_flag=1",
                           "argument"}) {
    EXPECT_EQ(Solve(log, "out", flag, &output), 1) << flag;
    std::string name = flag;
    name = name.substr(0, name.find('='));
    while (name[0] == '-') name.erase(0, 1);
    EXPECT_THAT(output, HasSubstr(name));
    EXPECT_THAT(output, Not(HasSubstr("ERROR")));
  }
  EXPECT_EQ(Solve(log, "out", "--delta_threshold=-0.1", &output), 1);
  EXPECT_THAT(output, StartsWith("--delta_threshold=-0.1: out of range"));
  EXPECT_EQ(Solve(log, "out", "--seed=-5", &output), 1);
  EXPECT_THAT(output, StartsWith("--seed=-5: cannot be read: expected"));
  EXPECT_EQ(Solve(log, "out", "--angle_resolution=1e-9", &output), 1);
  EXPECT_THAT(output, StartsWith("--angle_resolution: is 1e-09: expected 0, or "
                                 "0.01 to 90 degrees"));
  // Those that only a closer look shows to be wrong.
  for (const char* flag :
       {"--hierarchy=no_such_detector",
        "--hierarchy=orientation_relation/orientation_mixture",
        "--detector_parameters=sigma",
        "--detector_parameters=no_such_detector.sigma=1",
        "--detector_parameters=orientation_mixture.no_such=1",
        "--detector_parameters=orientation_mixture.sigma_deg=-1",
        "--log_reader=no_such_reader", "--outputs=no_such_file"}) {
    EXPECT_EQ(Solve(log, "out", flag, &output), 2) << flag << "\n" << output;
    EXPECT_THAT(output, HasSubstr(": expected ")) << flag;
    // Under the name of the flag, and no source file's.
    const std::string name = flag;
    EXPECT_THAT(output, StartsWith(name.substr(0, name.find('=')) + ": "));
    EXPECT_THAT(output, Not(HasSubstr(".cc:")));
  }
  EXPECT_TRUE(Files("out").empty());
  // At the ends of their ranges.
  for (const char* flag :
       {"--delta_threshold=0", "--delta_threshold=1", "--link_radius=0.5",
        "--em_every=1", "--em_max_iterations=1", "--num_threads=1024",
        "--usable_range=0.5", "--seed=18446744073709551615",
        "--association_depth=100", "--angle_resolution=90",
        "--hierarchy=orientation_mixture", "--refine=none"}) {
    EXPECT_EQ(Solve(log, "out", flag, &output), 0) << flag << "\n" << output;
    CheckFiles("out", FilesOfALog());
  }
}

TEST_F(SolveTest, OnlyCheckedFlags) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  std::string output;
  // What the run refuses is refused, in the same words and with its status.
  const std::string live = "--live_dir='" + (folder_ / "out").string() + "'";
  for (const char* flag :
       {live.c_str(),
        "--delta_threshold=7",
        "--hierarchy=foo",
        "--hierarchy=orientation_mixture/foo",
        "--features=points --hierarchy=orientation_mixture",
        "--outputs=foo",
        "--constraints=/nothere",
        "--plan=/nothere",
        "--map=/nothere",
        "--structure_prior=/nothere",
        "--plugins=/nothere.so",
        "--allowed_angles=1e9",
        "--marginals=tree",
        "--laser_max_range=nan",
        "--detector_parameters=orientation_mixture.sigma_deg=-1",
        "--log_reader=foo",
        "--start_pose=2:0,0,0",
        "--plan_sigma=0.1",
        "--localize",
        "--ellipse_sigmas=2"}) {
    const int status = Solve(log, "out", flag, &output);
    EXPECT_NE(status, 0) << flag;
    std::string checked;
    EXPECT_EQ(Solve(log, "out", std::string(flag) + " --check_flags", &checked),
              status)
        << flag;
    EXPECT_EQ(checked, output) << flag;
  }
  // What may be good with an input that it does not look at passes in silence,
  // and nothing is written.
  for (const char* flag :
       {"", "--hierarchy=same_wall",
        "--hierarchy=line_ransac,circle_ransac/center_cluster",
        "--structure=false --hierarchy=foo", "--marginals=pose,7",
        "--list_plugins", "--initial_guess=odometry"}) {
    EXPECT_EQ(Solve((folder_ / "missing").string(), "out",
                    std::string(flag) + " --check_flags", &output),
              0)
        << flag;
    EXPECT_EQ(output, "") << flag;
  }
  EXPECT_EQ(Run("--check_flags", &output), 0) << output;
  EXPECT_TRUE(Files("out").empty());
}

TEST_F(SolveTest, InputThatIsNone) {
  std::string output;
  EXPECT_EQ(Solve((folder_ / "missing").string(), "out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("missing: cannot be opened"));
  EXPECT_EQ(Solve(folder_.string(), "out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("is a directory: expected a file, or the "
                                "folder of a ROS 2 bag with metadata.yaml"));
  EXPECT_EQ(Solve(Write("empty", ""), "out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("empty: is empty: expected a robot's log"));
  EXPECT_EQ(Solve("-", "out", "</dev/null", &output), 2);
  EXPECT_THAT(output, HasSubstr("standard input: "));
  EXPECT_EQ(Solve(Write("blank", "\n\n\n"), "out", "", &output), 2);
  EXPECT_EQ(Solve(Write("text", "This is no log.\nNor is it a graph.\n"), "out",
                  "", &output),
            2);
  EXPECT_THAT(output, HasSubstr("text: "));

  std::mt19937_64 random(5);
  std::string bytes;
  for (int i = 0; i < 300000; ++i) {
    bytes += static_cast<char>(random() >> 56);
  }
  EXPECT_EQ(Solve(Write("random", bytes), "out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("random: "));
  EXPECT_LT(output.size(), 4000u);
  // Starts like each of the packed formats.
  for (const std::string& magic :
       {std::string("\x1f\x8b\x08\x00", 4), std::string("BZh9")}) {
    EXPECT_EQ(Solve(Write("packed", magic + bytes), "out", "", &output), 2);
    EXPECT_THAT(output, HasSubstr("packed: "));
  }
  EXPECT_TRUE(Files("out").empty());
}

// What is there is solved, with a report.
TEST_F(SolveTest, HalfAPackedLog) {
  const std::string whole = ReadFile(office_);
  const std::string input = Write("half.gz", whole.substr(0, 60000));
  std::string output;
  ASSERT_EQ(Solve(input, "out", "", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("half.gz: "));
  CheckFiles("out", FilesOfALog());
  const auto summary = SummaryOf("out");
  const int scans = summary["counts"]["scans"].get<int>();
  EXPECT_GT(scans, 50);
  EXPECT_LT(scans, 700);
  EXPECT_EQ(Lines(Out("out", "trajectory.tum")).size(),
            static_cast<std::size_t>(scans));
  EXPECT_FALSE(summary["frontend"]["skipped"].empty());

  // Half a graph is not one.
  const std::string graph = Write("small.g2o", kGraph);
  ASSERT_EQ(std::system(("gzip -f " + graph).c_str()), 0);
  const std::string packed = ReadFile(graph + ".gz");
  EXPECT_EQ(Solve(Write("half.g2o.gz", packed.substr(0, packed.size() - 12)),
                  "graph", "", &output),
            2);
  EXPECT_THAT(output, HasSubstr("half.g2o.gz: "));
  EXPECT_TRUE(Files("graph").empty());
}

TEST_F(SolveTest, GarbledLines) {
  std::vector<std::string> lines = OfficeLines(60);
  std::size_t garbled = 0;
  std::size_t index = 0;
  for (std::string& line : lines) {
    if (line.compare(0, 6, "FLASER") != 0) continue;
    // The last one breaks off, as in a log whose disk was full.
    if (index == 10 || index == 59) {
      line.resize(line.size() / 2);
    } else if (index == 20) {
      line.replace(line.size() / 3, 4, "\x01\xff\x02x");
    } else if (index == 30) {
      line = "FLASER 999999999 1 2 3";
    } else if (index == 40) {
      line = "FLASER -5 1 2 3";
    } else {
      --garbled;
    }
    ++garbled;
    ++index;
  }
  ASSERT_EQ(garbled, 5u);
  lines.insert(lines.begin() + 50, std::string(100000, 'x'));
  const std::string input = Write("garbled.log", Join(lines));
  std::string output;
  ASSERT_EQ(Solve(input, "out", "", &output), 0) << output;
  EXPECT_THAT(output, HasSubstr("garbled.log: "));
  EXPECT_THAT(output, HasSubstr("skipped"));
  EXPECT_LT(output.size(), 4000u);
  CheckFiles("out", FilesOfALog());
  EXPECT_EQ(SummaryOf("out")["counts"]["scans"], 55);
  EXPECT_EQ(Lines(Out("out", "trajectory.tum")).size(), 55u);
}

TEST_F(SolveTest, GarbledGraphs) {
  std::string output;
  const std::pair<const char*, const char*> cases[] = {
      {"VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 7 1 0 0 1 0 0 1 0 1\n", ":2: "},
      {"VERTEX_SE2 0 0 0\n", ":1: "},
      {"VERTEX_SE2 0 0 0 nan\n", ":1: "},
      {"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 0 0 0\n", ":2: "},
      {"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n"
       "EDGE_SE2 0 1 1 0 0 -1 0 0 1 0 1\n",
       ":3: "}};
  for (const auto& entry : cases) {
    EXPECT_EQ(Solve(Write("bad.g2o", entry.first), "out", "", &output), 2)
        << entry.first;
    EXPECT_THAT(output, HasSubstr(std::string("bad.g2o") + entry.second));
    EXPECT_THAT(output, HasSubstr("expected"));
  }
  EXPECT_TRUE(Files("out").empty());
}

// A board of 0.9 m, 1.2 m in front of the laser, for the second third.
TEST_F(SolveTest, WhatGoesAlongWithTheRobotIsLeftOut) {
  std::vector<std::string> lines = OfficeLines(1408);
  int scan = 0;
  for (std::string& line : lines) {
    if (line.compare(0, 6, "FLASER") != 0 || scan++ / 470 != 1) continue;
    std::istringstream fields(line);
    std::vector<std::string> words{std::istream_iterator<std::string>(fields),
                                   std::istream_iterator<std::string>()};
    const int beams = std::stoi(words[1]);
    for (int i = 0; i < beams; ++i) {
      const double angle = -0.5 * kPi + i * kPi / 180.0;
      std::string& range = words[static_cast<std::size_t>(i) + 2];
      if (std::abs(angle) < std::atan(0.45 / 1.2) &&
          std::stod(range) > 1.2 / std::cos(angle)) {
        range = std::to_string(1.2 / std::cos(angle));
      }
    }
    line.clear();
    for (const std::string& word : words) line += word + " ";
  }
  std::ofstream(folder_ / "cart.clf") << Join(lines);
  std::string output;
  ASSERT_EQ(Solve((folder_ / "cart.clf").string(), "cart",
                  "--outputs=trajectory.tum", &output),
            0)
      << output;
  EXPECT_NE(output.find("something went along with the robot for "),
            std::string::npos)
      << output;
  const RelationEvaluation evaluation =
      EvaluateRelations(ReadTum((folder_ / "cart/trajectory.tum").string()),
                        ReadRelations(std::string(PLUMBLINE_SOURCE_DIR) +
                                      "/datasets/office.relations"));
  EXPECT_LT(evaluation.translation.mean, 0.08);
}

TEST_F(SolveTest, BeamsInTheOtherOrderAreSaid) {
  std::vector<std::string> lines = OfficeLines(400);
  for (std::string& line : lines) {
    if (line.compare(0, 6, "FLASER") != 0) continue;
    std::istringstream fields(line);
    std::vector<std::string> words{std::istream_iterator<std::string>(fields),
                                   std::istream_iterator<std::string>()};
    std::reverse(words.begin() + 2, words.begin() + 2 + std::stoi(words[1]));
    line.clear();
    for (const std::string& word : words) line += word + " ";
  }
  std::ofstream(folder_ / "mirrored.clf") << Join(lines);
  std::string output;
  ASSERT_EQ(Solve((folder_ / "mirrored.clf").string(), "mirrored",
                  "--outputs=none", &output),
            0)
      << output;
  EXPECT_NE(output.find("the map turns left where odometry turns right"),
            std::string::npos)
      << output;
}

TEST_F(SolveTest, NoOdometryAtAll) {
  std::string text;
  for (int i = 0; i < 60; ++i) {
    text += Flaser(RoomRanges(0.05 * i, 181), 0.0, 100.0 + i) + "\n";
  }
  std::string output;
  ASSERT_EQ(Solve(Write("still.log", text), "out", "", &output), 0) << output;
  CheckFiles("out", FilesOfALog());
  // The scans tell the way.
  const std::vector<TimedPose> trajectory =
      ReadTum((folder_ / "out/trajectory.tum").string());
  ASSERT_EQ(trajectory.size(), 60u);
  EXPECT_NEAR(trajectory[59].pose[0] - trajectory[0].pose[0], 2.95, 0.05);
  EXPECT_NEAR(trajectory[59].pose[1], 0.0, 0.05);

  // Nor any pose.
  std::string raw;
  for (int i = 0; i < 30; ++i) {
    const double x = 0.05 * i;
    raw += "RAWLASER1 0 -1.5707963 3.1415927 0.0174533 20 0.01 0 181";
    for (const std::string& range : RoomRanges(x, 181)) raw += " " + range;
    raw += " 0 " + std::to_string(100.0 + i) + " host 0\n";
  }
  ASSERT_EQ(Solve(Write("raw.log", raw), "raw", "", &output), 0) << output;
  CheckFiles("raw", FilesOfALog());
  EXPECT_EQ(SummaryOf("raw")["counts"]["scans"], 30);
}

TEST_F(SolveTest, NumberOfBeamsChanges) {
  std::string text;
  for (int i = 0; i < 60; ++i) {
    const double x = 0.05 * i;
    text += Flaser(RoomRanges(x, i < 20   ? 181
                                 : i < 40 ? 361
                                          : 180),
                   x, 100.0 + i) +
            "\n";
  }
  std::string output;
  ASSERT_EQ(Solve(Write("beams.log", text), "out", "", &output), 0) << output;
  CheckFiles("out", FilesOfALog());
  const std::vector<TimedPose> trajectory =
      ReadTum((folder_ / "out/trajectory.tum").string());
  ASSERT_EQ(trajectory.size(), 60u);
  for (int i = 0; i < 60; ++i) {
    EXPECT_NEAR(trajectory[i].pose[0], 0.05 * i, 0.05) << i;
    EXPECT_NEAR(trajectory[i].pose[1], 0.0, 0.05) << i;
  }
}

// Their steps once grew with the square of the beams.
TEST_F(SolveTest, AHundredThousandBeams) {
  constexpr int kBeams = 100000;
  std::vector<std::string> ranges;
  for (int i = 0; i < kBeams; ++i) {
    const double angle = kPi * (static_cast<double>(i) / kBeams - 0.5) + 1e-9;
    ranges.push_back(std::to_string(
        std::min(4.0 / std::max(1e-9, std::cos(angle)),
                 3.0 / std::max(1e-9, std::abs(std::sin(angle))))));
  }
  std::string text;
  for (int i = 0; i < 3; ++i) text += Flaser(ranges, 0.0, 100.0 + i) + "\n";
  std::string output;
  ASSERT_EQ(Solve(Write("beams.log", text), "out",
                  "--outputs=map.json,trajectory.tum", &output),
            0)
      << output;
  EXPECT_EQ(ReadTum((folder_ / "out/trajectory.tum").string()).size(), 3u);
}

TEST_F(SolveTest, ScansWithoutBeams) {
  std::string output;
  std::string none, some;
  for (int i = 0; i < 20; ++i) {
    const double x = 0.1 * i;
    none += Flaser({}, x, 100.0 + i) + "\n";
    some += Flaser(i == 10 ? std::vector<std::string>() : RoomRanges(x, 181), x,
                   100.0 + i) +
            "\n";
  }
  // A log without any beam has no map.
  EXPECT_EQ(Solve(Write("none.log", none), "none", "", &output), 2) << output;
  EXPECT_THAT(output, HasSubstr("none.log: "));
  EXPECT_TRUE(Files("none").empty());
  ASSERT_EQ(Solve(Write("some.log", some), "some", "", &output), 0) << output;
  CheckFiles("some", FilesOfALog());
  // Nothing but readings out of range.
  std::string far;
  for (int i = 0; i < 20; ++i) {
    far += Flaser(std::vector<std::string>(181, "81.83"), 0.1 * i, 100.0 + i) +
           "\n";
  }
  ASSERT_EQ(Solve(Write("far.log", far), "far", "", &output), 0) << output;
  CheckFiles("far", FilesOfALog());
  EXPECT_NEAR(ReadTum((folder_ / "far/trajectory.tum").string())[19].pose[0],
              1.9, 1e-6);
}

TEST_F(SolveTest, OutputThatCannotBeWritten) {
  const std::string log = Write("office.log", Join(OfficeLines(20)));
  std::string output;
  // A file where the folder should be, and on the way to it.
  Write("file", "mine");
  EXPECT_EQ(Solve(log, "file", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("output folder"));
  EXPECT_EQ(Solve(log, "file/out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("output folder"));
  EXPECT_EQ(ReadFile(folder_ / "file"), "mine");

  // A folder in the place of a file.
  fs::create_directories(folder_ / "out" / "map.json" / "sub");
  EXPECT_EQ(Solve(log, "out", "", &output), 2);
  EXPECT_THAT(output, HasSubstr("map.json"));
  for (const std::string& name : Files("out")) {
    EXPECT_EQ(FilesOfALog().count(name), 1u) << name;
  }
  EXPECT_EQ(Files("out").count("summary.json"), 0u);

  // No right to write there: said before anything is solved.
  if (geteuid() != 0) {
    fs::create_directories(folder_ / "locked");
    chmod((folder_ / "locked").c_str(), 0555);
    EXPECT_EQ(Solve(log, "locked", "", &output), 2);
    EXPECT_THAT(output, HasSubstr("locked"));
    EXPECT_TRUE(Files("locked").empty());
    chmod((folder_ / "locked").c_str(), 0755);
  }

  // Folders are made, and a second run replaces the files of the first.
  ASSERT_EQ(Solve(log, "new/sub/folder", "", &output), 0) << output;
  CheckFiles("new/sub/folder", FilesOfALog());
  Write("new/sub/folder/map.svg", "old");
  ASSERT_EQ(Solve(log, "new/sub/folder", "", &output), 0) << output;
  CheckFiles("new/sub/folder", FilesOfALog());
}

}  // namespace
}  // namespace plumbline
