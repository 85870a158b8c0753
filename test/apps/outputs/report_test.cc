#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/break_log.h>
#include <plumbline/core/error.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/outputs/report.h>
#include <plumbline/pipeline/without_structure.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "apps/browser.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// A corridor whose walls turn away a little, and the structure that straightens
// it.
class ReportTest : public ::testing::Test {
 protected:
  ReportTest() { RegisterBuiltins(&registry_); }

  FeatureId Add(const std::string& type, std::vector<double> parameters,
                int level = 0, double length = 0.0) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    feature.level = level;
    feature.is_virtual = level > 0;
    feature.extent_end = length;
    feature.observations = level > 0 ? 0 : 7;
    feature.source = level > 0 ? "orientation_mixture" : "frontend";
    feature.fixed = graph_.num_features() == 0;
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  ConstraintId Tie(const std::string& relation, std::vector<FeatureId> features,
                   std::vector<double> expected, double sigma,
                   ConstraintClass kind) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = std::move(features);
    const auto size = static_cast<Eigen::Index>(expected.size());
    constraint.expected =
        Eigen::Map<const Eigen::VectorXd>(expected.data(), size);
    constraint.information =
        Eigen::MatrixXd::Identity(size, size) / (sigma * sigma);
    constraint.kind = kind;
    constraint.source = "orientation_mixture";
    Transaction transaction;
    transaction.AddConstraint(constraint);
    return graph_.Apply(std::move(transaction)).constraints[0];
  }

  // `walls` of 4 m end to end, turned by 0.01 rad one against the other as the
  // measurements have it, but level in the graph's state.
  void MakeCorridor(int walls) {
    std::vector<FeatureId> ids;
    for (int i = 0; i < walls; ++i) {
      ids.push_back(Add("segment", {5.0 * i, 0.0, 0.0}, 0, 4.0));
      if (i > 0) {
        Tie("pose_pose", {ids[i - 1], ids[i]}, {5.0, 0.0, 0.01}, 0.01,
            ConstraintClass::kMeasurement);
      }
    }
    const FeatureId orientation = Add("orientation", {0.0}, 1);
    for (const FeatureId id : ids) {
      Tie("segment_orientation", {id, orientation}, {0.0}, DegToRad(0.1),
          ConstraintClass::kStructure);
    }
    for (Constraint* constraint : graph_.MutableConstraints()) {
      if (constraint->kind == ConstraintClass::kStructure) {
        constraint->delta = 0.75;
      }
    }
  }

  Report MakeReport() {
    Report report;
    report.graph = &graph_;
    report.before.features = SolveWithoutStructure(graph_, registry_);
    report.path = {Pose2(0, -1, 0), Pose2(0.01, -1, 0), Pose2(10, -1, 0)};
    EmTraceRow row;
    for (const char* phase : {"measurements", "break", "detect_0"}) {
      row.phase.phase = phase;
      row.phase.cost.measurement += 10.0;
      row.phase.features = {{"segment", 3}};
      report.trace.push_back(row);
    }
    report.summary.input = "dir/log.clf";
    report.summary.total_seconds = 2.0;
    report.summary.step_seconds = {{"reading", 0.5},
                                   {"joint adjustment of poses and walls", 1.5},
                                   {"writing", 0.0}};
    CountGraph(graph_, &report.summary);
    report.flags = {{"delta_threshold", "0.3", "0.3", "double"},
                    {"input", "dir/log.clf", "", "string"}};
    report.delta_threshold = 0.3;
    report.title = "log.clf";
    return report;
  }

  static std::string Text(const Report& report) {
    std::ostringstream text;
    WriteReport(report, text);
    return text.str();
  }

  // The JSON in one of the page's script elements.
  static nlohmann::json Script(const std::string& page, const std::string& id) {
    const std::string start =
        "<script type=\"application/json\" id=\"" + id + "\">";
    const std::size_t begin = page.find(start);
    EXPECT_NE(begin, std::string::npos);
    const std::size_t end = page.find("</script>", begin);
    return nlohmann::json::parse(
        page.substr(begin + start.size(), end - begin - start.size()));
  }

  // A corridor and a room with a door between them; another leads nowhere.
  static BuildingPlan TwoRooms() {
    BuildingPlan plan;
    plan.rooms.resize(2);
    plan.rooms[0].kind = PlanRoom::Kind::kCorridor;
    plan.rooms[0].outline.shell = {{0, -2}, {20, -2}, {20, 0}, {0, 0}};
    plan.rooms[0].area = 40.0;
    plan.rooms[0].is_entered = true;
    plan.rooms[0].neighbors = {1};
    plan.rooms[1].outline.shell = {{0, 0.2}, {5, 0.2}, {5, 4.2}, {0, 4.2}};
    plan.rooms[1].area = 20.0;
    plan.rooms[1].neighbors = {0};
    plan.doors.resize(2);
    plan.doors[0].begin = {1.0, 0.1};
    plan.doors[0].end = {1.9, 0.1};
    plan.doors[0].rooms = {1, 0};
    plan.doors[0].is_driven = true;
    plan.doors[1].begin = {18.0, 0.1};
    plan.doors[1].end = {18.8, 0.1};
    plan.doors[1].rooms = {-1, 0};
    return plan;
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(ReportTest, WithoutStructureTheMeasurementsSpeak) {
  MakeCorridor(3);
  const auto before = SolveWithoutStructure(graph_, registry_);
  ASSERT_EQ(before.size(), 3u);
  // From the fixed first wall: 5 m ahead and 0.01 rad, twice.
  EXPECT_NEAR(before.at(1).parameters[0], 5.0, 1e-6);
  EXPECT_NEAR(before.at(1).parameters[2], 0.01, 1e-6);
  EXPECT_NEAR(before.at(2).parameters[0], 5.0 + 5.0 * std::cos(0.01), 1e-6);
  EXPECT_NEAR(before.at(2).parameters[1], 5.0 * std::sin(0.01), 1e-6);
  EXPECT_NEAR(before.at(2).parameters[2], 0.02, 1e-6);
  EXPECT_EQ(before.at(2).id, 2);
  // The graph stays as it was.
  EXPECT_EQ(graph_.GetFeature(2).parameters[2], 0.0);
}

TEST_F(ReportTest, NothingToLeaveOut) {
  EXPECT_TRUE(SolveWithoutStructure(graph_, registry_).empty());
  Add("segment", {0, 0, 0}, 0, 1.0);
  EXPECT_TRUE(SolveWithoutStructure(graph_, registry_).empty());
}

// The replay is what a run without structure comes to.
TEST_F(ReportTest, ReplayIsARunWithoutStructure) {
  Log log = ReadCarmenLog(
      std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/office.clf.gz",
      LaserOptions());
  log.scans.resize(200);
  LogSolverOptions options;
  options.refine = Refinement::kNone;
  LogSolver with(registry_, options);
  const LogSolverResult result = with.Run(log);
  const MapWithoutStructure replayed =
      ReplayWithoutStructure(log.scans, registry_, options, result);
  EXPECT_EQ(replayed.path.size(), 200u);
  EXPECT_GT(replayed.features.size(), 10u);

  LogSolverOptions plain = options;
  plain.structure = false;
  plain.em_every = 0;
  LogSolver without(registry_, plain);
  const LogSolverResult other = without.Run(log);
  int moved = 0;
  for (const auto& entry : replayed.features) {
    bool is_there = false;
    for (const Feature* feature : without.graph().Features()) {
      is_there |=
          feature->type == entry.second.type &&
          std::hypot(feature->parameters[0] - entry.second.parameters[0],
                     feature->parameters[1] - entry.second.parameters[1]) <
              1e-6;
    }
    EXPECT_TRUE(is_there) << entry.first;
    const Feature& structured = with.graph().GetFeature(entry.first);
    const double distance =
        std::hypot(structured.parameters[0] - entry.second.parameters[0],
                   structured.parameters[1] - entry.second.parameters[1]);
    EXPECT_LT(distance, 1.0) << entry.first;
    moved += distance > 1e-6;
  }
  EXPECT_GT(moved, 5);
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_LT((replayed.path[i] - other.trajectory[i]).norm(), 1e-6) << i;
  }
  EXPECT_TRUE(
      ReplayWithoutStructure(log.scans, registry_, plain, other).path.empty());
}

// The two are laid over each other: what one scan knows of the wall that holds
// the one while it grows must not turn it against the other.
TEST_F(ReportTest, TheReplayBeginsWhereTheMapDoes) {
  Log log = ReadCarmenLog(
      std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/office.clf.gz",
      LaserOptions());
  log.scans.resize(200);
  for (const Refinement refine : {Refinement::kMap, Refinement::kFull}) {
    LogSolverOptions options;
    options.refine = refine;
    const LogSolverResult result = LogSolver(registry_, options).Run(log);
    const MapWithoutStructure replayed =
        ReplayWithoutStructure(log.scans, registry_, options, result);
    ASSERT_EQ(replayed.path.size(), 200u);
    EXPECT_LT(Between(result.trajectory.front(), replayed.path.front()).norm(),
              1e-9);
  }
}

TEST_F(ReportTest, DataOfTheMap) {
  MakeCorridor(3);
  Transaction transaction;
  // Constraints 0 and 1 are measurements; 4 ties the last wall.
  transaction.BreakConstraint(4);
  graph_.Apply(std::move(transaction));
  graph_.GetFeature(2).parameters[2] = DegToRad(2.0);
  graph_.GetConstraint(4).delta = 0.001;
  const std::string page = Text(MakeReport());
  const auto data = Script(page, "data");
  EXPECT_EQ(data["title"], "log.clf");
  EXPECT_EQ(data["delta_threshold"], 0.3);
  const auto& features = data["features"];
  EXPECT_EQ(features["id"], nlohmann::json::parse("[0, 1, 2, 3]"));
  EXPECT_EQ(features["level"], nlohmann::json::parse("[0, 0, 0, 1]"));
  EXPECT_EQ(features["measured"], nlohmann::json::parse("[1, 2, 1, 0]"));
  EXPECT_EQ(features["after"][1], nlohmann::json::parse("[5.0,0.0,9.0,0.0]"));
  EXPECT_EQ(features["after"][3], nlohmann::json());
  EXPECT_EQ(features["before"][1],
            nlohmann::json::parse("[5.0, 0.0, 8.9998, 0.04]"));
  EXPECT_EQ(features["before"][3], nlohmann::json());
  const auto& structure = data["structure"];
  EXPECT_EQ(structure["live"], nlohmann::json::parse("[1, 1, 0]"));
  EXPECT_EQ(structure["delta"], nlohmann::json::parse("[0.75, 0.75, 0.001]"));
  EXPECT_EQ(structure["features"][2], nlohmann::json::parse("[2, 3]"));
  // Two degrees off where a tenth is tolerated.
  EXPECT_NEAR(std::abs(structure["broken"][2]["error"][0].get<double>()),
              DegToRad(2.0), 1e-6);
  EXPECT_NEAR(structure["broken"][2]["tolerance"][0].get<double>(),
              DegToRad(0.1), 1e-7);
  EXPECT_EQ(data["path"], nlohmann::json::parse("[0.0,-1.0,10.0,-1.0]"));
  EXPECT_EQ(data["trace"].size(), 3u);
  const auto run = Script(page, "run");
  EXPECT_EQ(run["time_s"]["total"], 2.0);
  EXPECT_EQ(run["flags"][1]["value"], "dir/log.clf");
  EXPECT_EQ(run["phase_seconds"].size(), 3u);
}

TEST_F(ReportTest, DataOfAnInterruptedRun) {
  MakeCorridor(3);
  Report report = MakeReport();
  EXPECT_TRUE(Script(Text(report), "data")["partial"].is_null());
  report.summary.partial = true;
  report.summary.scans_in_log = 400;
  EXPECT_EQ(Script(Text(report), "data")["partial"]["scans_in_log"], 400);
}

TEST_F(ReportTest, DataOfTheRooms) {
  MakeCorridor(3);
  Report report = MakeReport();
  EXPECT_TRUE(Script(Text(report), "data")["building"].is_null());
  const BuildingPlan plan = TwoRooms();
  report.building = &plan;
  const auto building = Script(Text(report), "data")["building"];
  ASSERT_EQ(building["rooms"].size(), 2u);
  EXPECT_EQ(building["rooms"][0]["kind"], "corridor");
  EXPECT_EQ(building["rooms"][0]["area"], 40.0);
  EXPECT_EQ(building["rooms"][0]["rings"],
            nlohmann::json::parse("[[0.0,-2.0,20.0,-2.0,20.0,0.0,0.0,0.0]]"));
  ASSERT_EQ(building["doors"].size(), 2u);
  EXPECT_EQ(building["doors"][0]["width"], 0.9);
  EXPECT_EQ(building["doors"][1]["rooms"], nlohmann::json({-1, 0}));
}

// A wall that only a rectangle holds has the colour of the rectangle's side, as
// on the map.
TEST_F(ReportTest, ColoursAreThoseOfTheMap) {
  const FeatureId tied = Add("segment", {0, 0, 0}, 0, 9.0);
  const FeatureId side = Add("segment", {5, 5, 0}, 0, 4.0);
  const FeatureId across = Add("segment", {5, 5, 0.5 * kPi}, 0, 2.0);
  const FeatureId free = Add("segment", {5, 9, 1}, 0, 2.0);
  const FeatureId rectangle = Add("rectangle", {5, 6, 0, 3, 1}, 1);
  const FeatureId level = Add("orientation", {0.0}, 2);
  const FeatureId upright = Add("orientation", {0.5 * kPi}, 2);
  const auto tie = [&](const std::string& relation, FeatureId a, FeatureId b,
                       std::vector<double> expected) {
    Tie(relation, {a, b}, std::move(expected), 0.01,
        ConstraintClass::kStructure);
  };
  tie("segment_orientation", tied, level, {0.0});
  tie("segment_rectangle", side, rectangle, {0.0, 0.0});
  tie("segment_rectangle", across, rectangle, {0.0, 0.5 * kPi});
  tie("rectangle_orientation", rectangle, level, {0.0});
  tie("rectangle_orientation", rectangle, upright, {0.5 * kPi});
  Report report = MakeReport();
  const auto data = Script(Text(report), "data");
  EXPECT_EQ(data["clusters"], nlohmann::json({level, upright}));
  const auto& cluster = data["features"]["cluster"];
  EXPECT_EQ(cluster[tied], 0);
  EXPECT_EQ(cluster[side], 0);
  EXPECT_EQ(cluster[across], 1);
  EXPECT_EQ(cluster[free], -1);
  EXPECT_EQ(cluster[rectangle], -1);
}

// Rows of every relation of the structure have units, closures among them.
TEST_F(ReportTest, UnitsOfRows) {
  MakeCorridor(3);
  Tie("segment_segment_collinearity", {0, 2}, {0.0, 0.0}, 0.05,
      ConstraintClass::kStructure);
  const auto data = Script(Text(MakeReport()), "data");
  EXPECT_EQ(data["units"]["segment_segment_collinearity"],
            (std::vector<std::string>{"m", "deg"}));
  EXPECT_EQ(data["units"]["segment_orientation"],
            std::vector<std::string>{"deg"});
  EXPECT_EQ(data["units"].size(), 2u);
}

// A broken constraint says when and by what, and what it would be in the final
// map.
TEST_F(ReportTest, BrokenThenAndNow) {
  MakeCorridor(3);
  const ConstraintId off = Tie("segment_orientation", {1, 3}, {DegToRad(0.2)},
                               DegToRad(0.1), ConstraintClass::kStructure);
  const ConstraintId within = Tie("segment_orientation", {2, 3}, {0.0},
                                  DegToRad(0.1), ConstraintClass::kStructure);
  graph_.GetConstraint(within).break_below = 0.01;
  BreakLog log;
  log.Attach(&graph_);
  log.SetIteration(2);
  // It is broken while the wall is 5 degrees off, and moves back then.
  graph_.GetFeature(1).parameters[2] = DegToRad(-5.2);
  Transaction transaction;
  transaction.BreakConstraint(off);
  graph_.Apply(std::move(transaction));
  graph_.GetFeature(1).parameters[2] = 0.0;
  log.Detach();
  transaction = Transaction();
  transaction.BreakConstraint(within);
  graph_.Apply(std::move(transaction));
  graph_.GetConstraint(off).delta = 0.001;
  graph_.GetConstraint(within).delta = 0.002;
  Report report = MakeReport();
  report.breaks = log.records();
  const auto broken = Script(Text(report), "data")["structure"]["broken"];
  // Live, live, live, and these two; two standard deviations off is 4.55 %.
  EXPECT_TRUE(broken[0].is_null());
  EXPECT_EQ(broken[3]["iteration_then"], 2);
  EXPECT_NEAR(std::abs(broken[3]["error_then"][0].get<double>()), DegToRad(5.0),
              1e-6);
  EXPECT_NEAR(std::abs(broken[3]["error"][0].get<double>()), DegToRad(0.2),
              1e-6);
  EXPECT_NEAR(broken[3]["delta"].get<double>(), 0.0455, 1e-4);
  EXPECT_EQ(broken[3]["limit"], 0.3);
  EXPECT_FALSE(broken[4].contains("iteration_then"));
  EXPECT_EQ(broken[4]["delta"], 1.0);
  EXPECT_EQ(broken[4]["limit"], 0.01);
}

TEST_F(ReportTest, GridAndClosures) {
  MakeCorridor(3);
  Report report = MakeReport();
  auto data = Script(Text(report), "data");
  EXPECT_TRUE(data["grid"].is_null());
  EXPECT_TRUE(data["closures"].empty());
  EXPECT_TRUE(data["live"].is_null());

  Constraint same;
  same.type = registry_.FindRelation(RelationRole::kSameWall,
                                     *graph_.GetFeature(0).type,
                                     *graph_.GetFeature(2).type);
  ASSERT_NE(same.type, nullptr);
  Tie(same.type->name, {0, 2},
      std::vector<double>(static_cast<std::size_t>(same.type->residual_size)),
      0.05, ConstraintClass::kStructure);
  OccupancyOptions options;
  options.resolution = 0.5;
  options.border = 0;
  const OccupancyGrid grid({0.0, 0.0}, {4.0, 2.0}, options);
  report.grid = MakeReportGrid(grid);
  report.stage = "closing of loops";
  report.reload_seconds = 5;
  data = Script(Text(report), "data");
  EXPECT_EQ(data["grid"]["width"], grid.width());
  EXPECT_EQ(data["grid"]["height"], grid.height());
  EXPECT_EQ(data["grid"]["resolution"], 0.5);
  // A PNG begins so in base64.
  EXPECT_EQ(data["grid"]["png"].get<std::string>().substr(0, 11),
            "iVBORw0KGgo");
  // The fourth of the structure constraints.
  EXPECT_EQ(data["closures"], nlohmann::json::parse("[3]"));
  EXPECT_TRUE(data["placed_closures"].empty());
  report.closures = {{Pose2(1.0, 2.0, 0.5), true, 0.75},
                     {Pose2(3.0, -1.0, 0.0), false, 0.001}};
  data = Script(Text(report), "data");
  EXPECT_EQ(
      data["placed_closures"],
      nlohmann::json::parse("[[1.0,2.0,0.5,1,0.75],[3.0,-1.0,0.0,0,0.001]]"));
  EXPECT_EQ(data["live"]["stage"], "closing of loops");
}

TEST_F(ReportTest, TextInTheDataEndsNothing) {
  MakeCorridor(2);
  Report report = MakeReport();
  report.title = "</script><script>alert(1)</script><!--";
  report.summary.input = "\xff\xfe<b>";
  const std::string page = Text(report);
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_EQ(Script(page, "data")["title"], report.title);
}

TEST_F(ReportTest, NumbersThatAreNone) {
  MakeCorridor(2);
  for (Feature* feature : graph_.MutableFeatures()) {
    feature->parameters[0] = std::nan("");
  }
  graph_.MutableConstraints()[1]->delta =
      std::numeric_limits<double>::infinity();
  Report report = MakeReport();
  report.path = {Pose2(std::nan(""), 0, 0)};
  report.summary.initial_cost = std::numeric_limits<double>::infinity();
  const auto data = Script(Text(report), "data");
  EXPECT_TRUE(data["features"]["after"][0].is_null());
  EXPECT_TRUE(data["path"].empty());
}

TEST_F(ReportTest, SameBytesAndWholeFiles) {
  MakeCorridor(3);
  EXPECT_EQ(Text(MakeReport()), Text(MakeReport()));
  EXPECT_THROW(WriteReport(MakeReport(), "/no/such/folder/report.html"), Error);
}

// -- In a browser -------------------------------------------------------------

class ReportInBrowserTest : public ReportTest {
 protected:
  void SetUp() override {
    if (Browser::Find().empty()) GTEST_SKIP() << "Chromium is not installed";
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("report_" + std::to_string(getpid()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    browser_ = std::make_unique<Browser>(folder_ / "profile");
  }
  void TearDown() override {
    browser_.reset();
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }

  void Open(const Report& report) {
    WriteReport(report, folder_ / "report.html");
    browser_->Open("file://" + (folder_ / "report.html").string());
  }

  // The window's place of a point of the map, px.
  Eigen::Vector2d Place(double x, double y) {
    const auto place = browser_->Evaluate(
        "(() => { const box = document.getElementById('map')"
        ".getBoundingClientRect(); return [box.left + plumbline.screenX(" +
        std::to_string(x) + "), box.top + plumbline.screenY(" +
        std::to_string(y) + ")]; })()");
    return {place[0].get<double>(), place[1].get<double>()};
  }
  std::string TipText() {
    return browser_
        ->Evaluate(
            "document.getElementById('tip').style.display === 'block' ? "
            "document.getElementById('tip').innerText : ''")
        .get<std::string>();
  }

  std::filesystem::path folder_;
  std::unique_ptr<Browser> browser_;
};

TEST_F(ReportInBrowserTest, MeasuresAndShowsLayers) {
  MakeCorridor(3);
  const BuildingPlan plan = TwoRooms();
  OccupancyGrid grid({0.0, -3.0}, {20.0, 5.0}, OccupancyOptions());
  Report report = MakeReport();
  report.building = &plan;
  report.grid = MakeReportGrid(grid);
  Open(report);
  const auto text_of = [this](const std::string& id) {
    return browser_
        ->Evaluate("document.getElementById('" + id + "').textContent")
        .get<std::string>();
  };
  // Without any layer nothing is there but the scale.
  const auto ink = [this] {
    return browser_
        ->Evaluate(
            "(() => { const map = document.getElementById('map'); "
            "const copy = document.createElement('canvas'); "
            "copy.width = map.width; copy.height = map.height; "
            "const c = copy.getContext('2d', {willReadFrequently: true}); "
            "c.drawImage(map, 0, 0); "
            "const d = c.getImageData(0, 0, copy.width, copy.height).data; "
            "let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0; "
            "return n; })()")
        .get<int>();
  };
  const auto wait_until_drawn = [this] {
    browser_->Evaluate(
        "new Promise((done) => requestAnimationFrame(() => "
        "requestAnimationFrame(() => done(1))))");
  };
  const auto click = [&](const std::string& id) {
    browser_->Evaluate("document.getElementById('" + id + "').click()");
    wait_until_drawn();
  };
  wait_until_drawn();
  for (const char* layer : {"show-walls", "show-plan", "show-path"}) {
    const int before = ink();
    click(layer);
    EXPECT_LT(ink(), before) << layer;
  }
  const int bare = ink();
  click("show-plan");
  EXPECT_GT(ink(), 5 * bare);
  click("show-walls");

  // From the end of the first wall to that of the second, not quite hit.
  browser_->Evaluate("document.getElementById('map').scrollIntoView()");
  click("ruler");
  for (const double x : {0.01, 9.01}) {
    const Eigen::Vector2d place = Place(x, 0.01);
    browser_->Mouse("mousePressed", place[0], place[1]);
    browser_->Mouse("mouseReleased", place[0], place[1]);
  }
  EXPECT_THAT(text_of("measured"), HasSubstr("Distance 9.000 m"));
  click("ruler");
  EXPECT_EQ(text_of("measured"), "");
  // Nothing is wider than a telephone.
  browser_->Call("Emulation.setDeviceMetricsOverride",
                 {{"width", 420},
                  {"height", 900},
                  {"deviceScaleFactor", 1},
                  {"mobile", true}});
  EXPECT_LE(
      browser_->Evaluate("document.documentElement.scrollWidth").get<int>(),
      420);
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

TEST_F(ReportInBrowserTest, SaysWhatIsToBeKnownAtItsTop) {
  MakeCorridor(3);
  Report report = MakeReport();
  const auto head = [this] {
    return browser_->Evaluate("document.querySelector('header').textContent")
        .get<std::string>();
  };
  Open(report);
  EXPECT_THAT(head(), Not(HasSubstr("interrupted")));
  // The summary, which is written last, has more of both.
  EXPECT_THAT(head(), HasSubstr("sbefore writing files"));
  EXPECT_THAT(head(), HasSubstr("MBmemory before writing files"));
  report.summary.partial = true;
  report.summary.scans = 30;
  report.summary.scans_in_log = 400;
  report.summary.logs.resize(3);
  report.summary.logs[1].input = "b.clf";
  report.summary.logs[1].map = "map_2";
  report.summary.logs[1].why_apart = "no part of it looks like a part";
  report.summary.logs[2] = report.summary.logs[1];
  report.summary.logs[2].input = "c.clf";
  report.summary.logs[2].candidate = Pose2(1.0, -2.5, DegToRad(90.0));
  Open(report);
  EXPECT_THAT(head(), HasSubstr("b.clf was kept apart, in the folder map_2: no "
                                "part of it looks like a part.c.clf"));
  EXPECT_THAT(head(), HasSubstr("--start_pose=3:1.00,-2.50,90.0 puts it"));
  EXPECT_THAT(head(), HasSubstr("The run was interrupted: this is what was "
                                "done until then"));
  EXPECT_THAT(head(), HasSubstr(" 30 of 400 scans."));
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

// Names are as long as they are: none is cut, none runs into a bar.
TEST_F(ReportInBrowserTest, NamesOfStepsAreWhole) {
  MakeCorridor(3);
  Report report = MakeReport();
  report.summary.step_seconds = {
      {"reading", 1.0},
      {"structure of the map from adjusted poses", 4.0},
      {"scan matching for want of odometry", 2.0}};
  Open(report);
  for (const int width : {420, 950, 1300, 2000}) {
    browser_->Call("Emulation.setDeviceMetricsOverride",
                   {{"width", width},
                    {"height", 900},
                    {"deviceScaleFactor", 1},
                    {"mobile", false}});
    browser_->Evaluate("drawTimes()");
    EXPECT_EQ(browser_->Evaluate(
                  "(() => { const svg = document.querySelector('#times svg'); "
                  "const w = svg.viewBox.baseVal.width; const boxes = "
                  "[...svg.querySelectorAll('text, rect')].map((n) => "
                  "n.getBBox()); return boxes.filter((b) => b.x < 0 || "
                  "b.x + b.width > w).length + boxes.filter((b, k) => "
                  "k % 3 === 0 && b.x + b.width > boxes[k + 1].x && "
                  "b.y + b.height > boxes[k + 1].y + 4).length; })()"),
              0)
        << width;
  }
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

TEST_F(ReportInBrowserTest, LoadsAndAnswersTheMouse) {
  MakeCorridor(3);
  Transaction transaction;
  transaction.BreakConstraint(4);
  graph_.Apply(std::move(transaction));
  graph_.GetConstraint(4).delta = 0.001;
  Report report = MakeReport();
  report.title = "<b>bold</b>";
  report.trace.back().phase.cost.measurement = 123456.789;
  Open(report);
  EXPECT_THAT(browser_->complaints(), IsEmpty());
  EXPECT_EQ(browser_->Evaluate("document.getElementById('title').textContent"),
            "<b>bold</b>");

  // Hover over the second wall's middle.
  browser_->Evaluate("document.getElementById('map').scrollIntoView()");
  Eigen::Vector2d place = Place(7.0, 0.0);
  browser_->Mouse("mouseMoved", place[0], place[1]);
  std::string tip = TipText();
  EXPECT_THAT(tip, HasSubstr("segment 1"));
  EXPECT_THAT(tip, HasSubstr("4.00 m"));
  EXPECT_THAT(tip, HasSubstr("0.00°"));
  EXPECT_THAT(tip, HasSubstr("0.750"));
  EXPECT_THAT(tip, HasSubstr("orientation 3"));
  EXPECT_THAT(tip, HasSubstr("7 scans"));
  EXPECT_EQ(browser_->Evaluate("plumbline.hovered"), 1);
  // Nothing there.
  place = Place(7.0, 1.0);
  browser_->Mouse("mouseMoved", place[0], place[1]);
  EXPECT_EQ(TipText(), "");

  // The map is drawn: there is the colour of the first direction.
  const std::string blue =
      "(() => { const c = document.getElementById('map'); const d = "
      "c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = "
      "0; for (let i = 0; i < d.length; i += 4) n += d[i] === 0 && d[i + 1] "
      "=== 114 && d[i + 2] === 178 && d[i + 3] === 255; return n; })()";
  EXPECT_GT(browser_->Evaluate(blue).get<int>(), 500);

  // The toggle takes the walls to where they are without structure.
  browser_->Evaluate("document.getElementById('toggle').click()");
  browser_->Evaluate(
      "new Promise(done => { const look = () => plumbline.morph === 0 ? "
      "done(0) : setTimeout(look, 20); look(); })");
  EXPECT_EQ(browser_->Evaluate("document.getElementById('toggle').textContent"),
            "Show with structure");
  place = Place(7.0, 0.02);
  browser_->Mouse("mouseMoved", place[0], place[1]);
  tip = TipText();
  EXPECT_THAT(tip, HasSubstr("segment 1"));
  EXPECT_THAT(tip, HasSubstr("0.57°"));  // 0.01 rad
  // The slider takes them half-way back.
  browser_->Evaluate(
      "(() => { const s = document.getElementById('morph'); s.value = 50; "
      "s.dispatchEvent(new Event('input')); })()");
  EXPECT_EQ(browser_->Evaluate("plumbline.geometry(1, plumbline.morph)[3]"),
            0.02);

  // The wheel zooms about the mouse, dragging moves.
  place = Place(5.0, 0.0);
  const double scale = browser_->Evaluate("plumbline.view.scale").get<double>();
  browser_->Mouse("mouseWheel", place[0], place[1], -400.0);
  EXPECT_GT(browser_->Evaluate("plumbline.view.scale").get<double>(),
            1.5 * scale);
  EXPECT_LT((Place(5.0, 0.0) - place).norm(), 1.0);
  browser_->Mouse("mousePressed", place[0], place[1]);
  browser_->Mouse("mouseMoved", place[0] + 60.0, place[1] + 30.0);
  browser_->Mouse("mouseReleased", place[0] + 60.0, place[1] + 30.0);
  EXPECT_LT((Place(5.0, 0.0) - place - Eigen::Vector2d(60.0, 30.0)).norm(),
            1.0);

  // What was broken is listed with why.
  const std::string broken =
      browser_->Evaluate("document.getElementById('broken').innerText")
          .get<std::string>();
  EXPECT_THAT(broken, HasSubstr("segment_orientation"));
  EXPECT_THAT(broken, HasSubstr("segment 2"));
  EXPECT_THAT(broken, HasSubstr("delta 0.001 < 0.3"));
  EXPECT_THAT(broken, HasSubstr("inside its tolerance: off by 0°"));
  browser_->Evaluate("document.querySelector('#broken tr.link').click()");
  EXPECT_EQ(browser_->Evaluate("plumbline.hovered"), 2);
  for (const char* id : {"histogram", "trace", "times"}) {
    EXPECT_GT(browser_
                  ->Evaluate("document.querySelectorAll('#" + std::string(id) +
                             " svg *').length")
                  .get<int>(),
              3)
        << id;
  }
  // No label reaches out of its drawing, no number is broken over two lines.
  EXPECT_EQ(browser_->Evaluate(
                "[...document.querySelectorAll('svg text')].filter(text => { "
                "const a = text.getBoundingClientRect(), b = "
                "text.closest('svg').getBoundingClientRect(); return a.left < "
                "b.left - 1 || a.right > b.right + 1; }).map(text => "
                "text.textContent).join('; ')"),
            "");
  EXPECT_EQ(browser_->Evaluate(
                "[...document.querySelectorAll('td.number')].filter(cell => { "
                "const range = document.createRange(); "
                "range.selectNodeContents(cell); return "
                "range.getClientRects().length > 1; }).map(cell => "
                "cell.textContent).join('; ')"),
            "");
  // Every way to colour.
  for (const char* mode : {"delta", "scans", "direction"}) {
    browser_->Evaluate(
        "(() => { const s = document.getElementById('colour'); s.value = '" +
        std::string(mode) + "'; s.dispatchEvent(new Event('change')); })()");
  }
  browser_->Evaluate("new Promise(done => setTimeout(() => done(0), 50))");
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

TEST_F(ReportInBrowserTest, Rooms) {
  MakeCorridor(3);
  Report report = MakeReport();
  const BuildingPlan plan = TwoRooms();
  report.building = &plan;
  Open(report);
  const auto text = [&](const std::string& id) {
    return browser_->Evaluate("document.getElementById('" + id + "').innerText")
        .get<std::string>();
  };
  EXPECT_THAT(text("rooms-note"),
              HasSubstr("1 room, 1 corridor, 2 doors; 60.0 m²"));
  EXPECT_EQ(browser_->Evaluate("[...document.querySelectorAll('#rooms tbody "
                               "tr')].map(row => [...row.cells].map(cell => "
                               "cell.textContent).join('|')).join(';')"),
            "1|corridor|40.0|yes|2, 1 door to no known room;2|room|20.0|no|1");
  EXPECT_EQ(browser_->Evaluate("[...document.querySelectorAll('#doors tbody "
                               "tr')].map(row => [...row.cells].map(cell => "
                               "cell.textContent).join('|')).join(';')"),
            "1|0.90|2 – 1|yes;2|0.80|no known room – 1|no");
  // Rooms are tinted where they are; one that is picked is in the middle.
  browser_->Evaluate("document.querySelectorAll('#rooms tr.link')[1].click()");
  EXPECT_NEAR(browser_->Evaluate("plumbline.view.x").get<double>(), 2.5, 1e-9);
  EXPECT_NEAR(browser_->Evaluate("plumbline.view.y").get<double>(), 2.2, 1e-9);
  const std::string tinted =
      "new Promise(done => requestAnimationFrame(() => "
      "requestAnimationFrame(() "
      "=> { const c = document.getElementById('map'); const d = "
      "c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = "
      "0; for (let i = 0; i < d.length; i += 4) n += d[i] === 230 && d[i + 1] "
      "=== 239 && d[i + 2] === 246; done(n); })))";
  EXPECT_GT(browser_->Evaluate(tinted).get<int>(), 10000);
  Open(report);
  browser_->Evaluate("document.getElementById('show-plan').click()");
  EXPECT_EQ(browser_->Evaluate(tinted).get<int>(), 0);
  // Looked for in vain, and not looked for.
  const BuildingPlan none;
  report.building = &none;
  Open(report);
  EXPECT_THAT(text("rooms-note"), HasSubstr("None"));
  report.building = nullptr;
  Open(report);
  EXPECT_EQ(
      browser_->Evaluate("document.getElementById('rooms-card').style.display"),
      "none");
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

// What the robot saw beyond the last wall of the map is to be seen, too.
TEST_F(ReportInBrowserTest, RoomsBeyondTheWallsAreInView) {
  MakeCorridor(3);
  Report report = MakeReport();
  BuildingPlan plan = TwoRooms();
  double top = 0.0;
  for (Eigen::Vector2d& corner : plan.rooms[1].outline.shell) {
    corner.y() += 25.0;
    top = std::max(top, corner.y());
  }
  report.building = &plan;
  Open(report);
  EXPECT_LT((top - browser_->Evaluate("plumbline.view.y").get<double>()) *
                browser_->Evaluate("plumbline.view.scale").get<double>(),
            browser_->Evaluate("document.getElementById('map').clientHeight")
                    .get<double>() /
                2.0);
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

TEST_F(ReportInBrowserTest, NothingToShow) {
  Open(MakeReport());
  EXPECT_THAT(browser_->complaints(), IsEmpty());
  EXPECT_THAT(browser_->Evaluate("document.body.innerText").get<std::string>(),
              HasSubstr("There is no structure."));
}

TEST_F(ReportInBrowserTest, EveryKindOfFeature) {
  Add("point", {0, 0});
  Add("circle", {3, 3, 1});
  Add("line", {1.0, 0.5}, 1, 4.0);
  Add("rectangle", {2, 2, 0.3, 3, 1}, 1);
  Add("orientation", {0.3}, 2);
  Add("pose", {1, 1, 0});
  Open(MakeReport());
  EXPECT_THAT(browser_->complaints(), IsEmpty());
  browser_->Evaluate("document.getElementById('map').scrollIntoView()");
  // The middle of the rectangle's long side, 1 m across its direction.
  const Eigen::Vector2d place = Place(2.0 - std::sin(0.3), 2.0 + std::cos(0.3));
  browser_->Mouse("mouseMoved", place[0], place[1]);
  EXPECT_THAT(TipText(), HasSubstr("rectangle 3"));
  EXPECT_THAT(TipText(), HasSubstr("6.00 × 2.00 m"));
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

// 20,000 walls: loads, finds the wall under the mouse, draws.
TEST_F(ReportInBrowserTest, LargeMap) {
  Transaction transaction;
  Feature orientation;
  orientation.type = &registry_.GetFeature("orientation");
  orientation.level = 1;
  orientation.is_virtual = true;
  const FeatureId shared = transaction.AddFeature(orientation);
  for (int i = 0; i < 20000; ++i) {
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {5.0 * (i % 200), 3.0 * (i / 200), 0.0};
    feature.extent_end = 4.0;
    Constraint constraint;
    constraint.type = &registry_.GetRelation("segment_orientation");
    constraint.features = {transaction.AddFeature(feature), shared};
    constraint.expected = Eigen::VectorXd::Zero(1);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    constraint.kind = ConstraintClass::kStructure;
    transaction.AddConstraint(constraint);
  }
  graph_.Apply(std::move(transaction));
  Report report = MakeReport();
  report.before.features.clear();
  for (const Feature* feature : std::as_const(graph_).Features()) {
    if (feature->is_virtual) continue;
    report.before.features[feature->id] = *feature;
    report.before.features[feature->id].parameters[1] += 0.5;
  }
  Open(report);
  browser_->Evaluate("document.getElementById('map').scrollIntoView()");
  // Wall 100 of row 50: feature 1 + 50 * 200 + 100.
  browser_->Evaluate(
      "for (let i = 0; i < 12; ++i) document.getElementById('in').click()");
  browser_->Evaluate(
      "plumbline.view.x = 502, plumbline.view.y = 150, "
      "window.dispatchEvent(new "
      "Event('resize'))");
  const Eigen::Vector2d place = Place(502.0, 150.0);
  browser_->Mouse("mouseMoved", place[0], place[1]);
  EXPECT_THAT(TipText(), HasSubstr("segment 10101"));
  EXPECT_THAT(browser_->complaints(), IsEmpty());
}

}  // namespace
}  // namespace plumbline
