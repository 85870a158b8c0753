#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/version.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/summary.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

namespace plumbline {
namespace {

WallDirection WallAtDegrees(double degrees, double length) {
  return {DegToRad(degrees), length};
}

TEST(OrthogonalityTest, PerfectAtAnyAngle) {
  for (const double turn : {0.0, 17.0, 44.9, 45.0, -45.0, 89.99, 123.4}) {
    const auto rms = OrthogonalityDeg(
        {WallAtDegrees(turn, 3.0), WallAtDegrees(turn + 90.0, 2.0),
         WallAtDegrees(turn + 180.0, 1.0), WallAtDegrees(turn - 90.0, 5.0)});
    ASSERT_TRUE(rms.has_value());
    EXPECT_NEAR(*rms, 0.0, 1e-9) << turn;
  }
}

TEST(OrthogonalityTest, WorkedByHand) {
  // Folded: 0 and 1 degree, mean 0.5, deviations of half a degree.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 2.0), WallAtDegrees(91.0, 2.0)}),
      0.5, 1e-9);
  // Weights 3 and 1: mean 0.5, (3 * 0.25 + 1 * 2.25) / 4 = 0.75.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 3.0), WallAtDegrees(92.0, 1.0)}),
      std::sqrt(0.75), 1e-9);
  // Across the cut of the folding: 44.5 and 45.5 (= -44.5 mod 90).
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(44.5, 1.0), WallAtDegrees(45.5, 1.0)}),
      0.5, 1e-9);
}

TEST(OrthogonalityTest, ObliqueAndShortWallsAreLeftOut) {
  // 30 and 45 degrees lie farther than 10 from every multiple of 90; the wall
  // of 0.99 m at 5 degrees is too short to count.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 3.0), WallAtDegrees(92.0, 1.0),
                         WallAtDegrees(30.0, 1.5), WallAtDegrees(45.0, 1.5),
                         WallAtDegrees(5.0, 0.99)}),
      std::sqrt(0.75), 1e-9);
  // At 1.00 m it counts: mean (2 + 5) / 5 = 1.4 and deviations -1.4, 0.6, 3.6.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 3.0), WallAtDegrees(92.0, 1.0),
                         WallAtDegrees(5.0, 1.0)}),
      std::sqrt((3 * 1.96 + 0.36 + 12.96) / 5.0), 1e-9);
}

TEST(OrthogonalityTest, DominantIsTheMostLengthAndNotTheMean) {
  // An oblique wing at 24 degrees of nearly the same size does not pull the
  // dominant direction: one metre of the main part is off by 3 degrees.
  // Mean 0.3: (9 * 0.09 + 1 * 7.29) / 10 = 0.81.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 9.0), WallAtDegrees(93.0, 1.0),
                         WallAtDegrees(24.0, 9.0)}),
      0.9, 1e-9);
  // Circular mean over all would lie at 8 degrees between the two, where
  // both are within the window; the mode is at the longer one.
  EXPECT_NEAR(
      *OrthogonalityDeg({WallAtDegrees(0.0, 10.0), WallAtDegrees(16.0, 9.0)}),
      0.0, 1e-9);
}

TEST(OrthogonalityTest, NothingToMeasure) {
  EXPECT_FALSE(OrthogonalityDeg(std::vector<WallDirection>{}).has_value());
  EXPECT_FALSE(OrthogonalityDeg({WallAtDegrees(0.0, 0.5)}).has_value());
  EXPECT_FALSE(
      OrthogonalityDeg(
          {WallAtDegrees(std::nan(""), 5.0),
           WallAtDegrees(0.0, std::numeric_limits<double>::infinity())})
          .has_value());
  EXPECT_NEAR(*OrthogonalityDeg({WallAtDegrees(33.0, 5.0)}), 0.0, 1e-9);
}

TEST(MeanOfTenthTest, Tenths) {
  std::vector<double> values;
  for (int i = 0; i < 20; ++i) values.push_back(i);
  EXPECT_EQ(MeanOfTenth(values, 0), 0.5);
  EXPECT_EQ(MeanOfTenth(values, 1), 2.5);
  EXPECT_EQ(MeanOfTenth(values, 9), 18.5);
  EXPECT_FALSE(MeanOfTenth({}, 1).has_value());
  // 5 values: the tenth from 0 to 0.5 is empty, that from 4.5 to 5 holds one.
  EXPECT_FALSE(MeanOfTenth({1, 2, 3, 4, 5}, 0).has_value());
  EXPECT_EQ(MeanOfTenth({1, 2, 3, 4, 5}, 9), 5.0);
}

class SummaryGraphTest : public ::testing::Test {
 protected:
  SummaryGraphTest() { RegisterBuiltinRelations(&registry_); }

  Feature MakeFeature(const std::string& type, std::vector<double> parameters,
                      double extent, int level) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    feature.extent_begin = -extent / 2.0;
    feature.extent_end = extent / 2.0;
    feature.level = level;
    feature.is_virtual = level > 0;
    return feature;
  }

  Constraint Tie(FeatureId segment, FeatureId orientation) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("segment_orientation");
    constraint.features = {segment, orientation};
    constraint.expected = Eigen::VectorXd::Zero(1);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    constraint.kind = ConstraintClass::kStructure;
    return constraint;
  }

  Registry registry_;
};

TEST_F(SummaryGraphTest, CountsFeaturesAndConstraints) {
  Graph graph;
  Transaction transaction;
  const FeatureId a =
      transaction.AddFeature(MakeFeature("segment", {0.0, 0.0, 0.0}, 2.0, 0));
  const FeatureId b = transaction.AddFeature(
      MakeFeature("segment", {3.0, 1.0, DegToRad(91.0)}, 2.0, 0));
  // Direction 0 like the first segment's; its parameters are d, alpha.
  transaction.AddFeature(MakeFeature("line", {7.0, 0.0}, 0.5, 1));
  const FeatureId o =
      transaction.AddFeature(MakeFeature("orientation", {0.0}, 0.0, 1));
  transaction.AddConstraint(Tie(a, o));
  transaction.AddConstraint(Tie(b, o));
  Constraint motion;
  motion.type = &registry_.GetRelation("pose_pose");
  motion.features = {a, b};
  motion.expected = Eigen::Vector3d(3.0, 1.0, 1.5);
  motion.information = Eigen::Matrix3d::Identity();
  transaction.AddConstraint(motion);
  const TransactionResult result = graph.Apply(std::move(transaction));
  Transaction breaking;
  breaking.BreakConstraint(result.constraints[1]);
  graph.Apply(std::move(breaking));

  Summary summary;
  summary.features["left over"][3] = 1;
  CountGraph(graph, &summary);
  EXPECT_EQ(summary.features,
            (std::map<std::string, std::map<int, std::int64_t>>{
                {"segment", {{0, 2}}},
                {"line", {{1, 1}}},
                {"orientation", {{1, 1}}}}));
  ASSERT_EQ(summary.constraints.size(), 2u);
  EXPECT_EQ(summary.constraints["segment_orientation"].structure, 1);
  EXPECT_EQ(summary.constraints["segment_orientation"].broken, 1);
  EXPECT_EQ(summary.constraints["segment_orientation"].measurement, 0);
  EXPECT_EQ(summary.constraints["pose_pose"].measurement, 1);
  // The line of half a metre does not count: 0 and 91 degrees.
  ASSERT_TRUE(summary.orthogonality_deg.has_value());
  EXPECT_NEAR(*summary.orthogonality_deg, 0.5, 1e-9);
}

TEST(SummaryTest, HasTheKeysOfTheContract) {
  Summary summary;
  summary.input = "a\xFF.clf";
  summary.seed = 18446744073709551615u;
  summary.flags = {{"delta_threshold", "0.25", "0.3", "double"},
                   {"structure", "false", "true", "bool"},
                   {"num_threads", "-2", "0", "int32"},
                   {"seed", "18446744073709551615", "1", "uint64"},
                   {"hierarchy", "7", "", "string"}};
  summary.scans = 20;
  summary.range_noise = 0.012;
  summary.range_offset = -0.025;
  summary.odometry_scale = 0.96;
  summary.odometry_course = kPi / 60.0;
  summary.features["segment"][0] = 4;
  summary.constraints["pose_pose"].measurement = 5;
  summary.initial_cost = 9.0;
  summary.measurement_cost = 1.5;
  summary.structure_cost = 0.25;
  summary.em_iterations = 3;
  summary.em_termination = EmTermination::kConvergence;
  summary.total_seconds = 6.0;
  summary.step_seconds = {{"reading", 1.5}, {"writing", 4.5}};
  summary.reading.seconds = std::nan("");
  summary.peak_memory_bytes = 123;
  summary.skipped = {{"too short", 2, {7, 9}}};
  summary.tracking.loose = {{2.5, 7.25, "a gap"}};
  summary.tracking.pieces = 2;
  summary.plan = Summary::Plan{4, 3, 6.5};
  for (int i = 0; i < 20; ++i) summary.scan_seconds.push_back(i);
  std::ostringstream output;
  WriteSummary(summary, output);
  const auto json = nlohmann::ordered_json::parse(output.str());

  std::vector<std::string> keys;
  for (const auto& entry : json.items()) keys.push_back(entry.key());
  EXPECT_EQ(keys,
            (std::vector<std::string>{
                "input", "seed", "flags", "counts", "cost", "em", "time_s",
                "peak_memory_bytes", "orthogonality_deg", "closures", "version",
                "files", "sha256", "partial", "frontend", "tracking", "plan"}));
  EXPECT_EQ(json["plan"].dump(),
            R"({"rooms":4,"doors":3,"way_outside_m":6.5})");
  EXPECT_EQ(json["tracking"].dump(),
            R"({"pieces":2,"loose":[{"begin":2.5,"end":7.25,"why":"a gap"}]})");
  EXPECT_EQ(json["input"], "a\xEF\xBF\xBD.clf");
  EXPECT_EQ(json["seed"], 18446744073709551615u);
  EXPECT_EQ(json["flags"].dump(),
            R"({"delta_threshold":0.25,"structure":false,"num_threads":-2,)"
            R"("seed":18446744073709551615,"hierarchy":"7"})");
  EXPECT_EQ(json["counts"].dump(),
            R"({"scans":20,"features":{"segment":{"0":4}},"constraints":)"
            R"({"pose_pose":{"measurement":5,"structure":0,"broken":0}}})");
  EXPECT_EQ(json["cost"].dump(),
            R"({"initial":9.0,"measurement":1.5,"structure":0.25,)"
            R"("total":1.75})");
  EXPECT_EQ(json["em"].dump(), R"({"iterations":3,"converged":true,)"
                               R"("termination":"convergence"})");
  EXPECT_EQ(json["time_s"].dump(),
            R"({"total":6.0,"parse":null,"parse_idle":0.0,"parse_cpu":0.0,)"
            R"("frontend":0.0,"detect":0.0,)"
            R"("solve":0.0,"write":0.0,)"
            R"("steps":{"reading":1.5,"writing":4.5}})");
  EXPECT_EQ(json["peak_memory_bytes"], 123);
  EXPECT_TRUE(json["orthogonality_deg"].is_null());
  EXPECT_EQ(json["version"], kVersion);
  // Second tenth 2, 3; last tenth 18, 19; 18.5 / 2.5 = 7.4.
  EXPECT_EQ(json["frontend"].dump(),
            R"({"skipped":[{"reason":"too short","count":2,)"
            R"("first_lines":[7,9]}],"scan_seconds_second_tenth":2.5,)"
            R"("scan_seconds_last_tenth":18.5,"scan_seconds_growth":7.4,)"
            R"("range_noise_m":0.012,"range_offset_m":-0.025,)"
            R"("odometry_scale":0.96,"odometry_course_deg":3.0})");
}

TEST(SummaryTest, APartOfARunSaysSo) {
  Summary summary;
  summary.scans = 389;
  summary.scans_in_log = 1408;
  summary.files = {"map.json"};
  summary.digests = {{"map.json", "0123"}};
  const auto write = [&] {
    std::ostringstream output;
    WriteSummary(summary, output);
    return nlohmann::json::parse(output.str());
  };
  EXPECT_EQ(write()["partial"], false);
  EXPECT_FALSE(write().contains("scans_in_log"));
  EXPECT_EQ(write()["sha256"].dump(), R"({"map.json":"0123"})");
  summary.partial = true;
  EXPECT_EQ(write()["partial"], true);
  EXPECT_EQ(write()["scans_in_log"], 1408);
}

TEST(SummaryTest, MirrorsAreToldWhereThereAreAny) {
  Summary summary;
  summary.scans = 10;
  const auto write = [&] {
    std::ostringstream output;
    WriteSummary(summary, output);
    return nlohmann::ordered_json::parse(output.str());
  };
  EXPECT_FALSE(write().contains("mirrors"));
  summary.mirrors.push_back({{1.0, 2.0}, {4.0, 6.0}, 150, 0.75});
  EXPECT_EQ(write()["mirrors"].dump(),
            R"([{"begin":[1.0,2.0],"end":[4.0,6.0],"width_m":5.0,)"
            R"("returns":150,"share":0.75}])");
}

TEST(SummaryTest, AGraphHasNoFrontend) {
  std::ostringstream output;
  WriteSummary(Summary(), output);
  const auto json = nlohmann::json::parse(output.str());
  EXPECT_FALSE(json.contains("frontend"));
  EXPECT_FALSE(json.contains("solver"));
  EXPECT_EQ(json["flags"].dump(), "{}");
}

TEST(SummaryTest, FiguresOfTheSolver) {
  Summary summary;
  summary.measurement_cost = 3.0;
  summary.structure_cost = 0.5;
  Summary::Solver solver;
  solver.start_poses = 5;
  solver.start_landmarks = 2;
  solver.start_kept = 1;
  solver.start_seconds = 0.25;
  solver.solves = 2;
  solver.converged = false;
  solver.iterations = 9;
  solver.evaluation_seconds = 0.5;
  solver.linear_solver_seconds = 0.75;
  solver.setup_seconds = 0.125;
  summary.solver = solver;
  std::ostringstream output;
  WriteSummary(summary, output);
  EXPECT_EQ(nlohmann::ordered_json::parse(output.str())["solver"].dump(),
            R"({"objective":3.5,"iterations":9,"solves":2,"converged":false,)"
            R"("evaluation_s":0.5,"linear_solver_s":0.75,"setup_s":0.125,)"
            R"("start":{"poses":5,"landmarks":2,"kept":1,"seconds":0.25}})");
}

TEST(SummaryTest, PeakMemoryIsPlausible) {
  // A process that runs tests takes megabytes, not gigabytes or kilobytes.
  EXPECT_GT(PeakMemoryBytes(), 1 << 20);
}

}  // namespace
}  // namespace plumbline
