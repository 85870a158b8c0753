#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/carmen_reader.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "frontend/timed_poses.h"
#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

Relation Displacement(double time1, double time2, double x, double y,
                      double theta) {
  Relation relation;
  relation.time1 = time1;
  relation.time2 = time2;
  relation.displacement = Pose2(x, y, theta);
  return relation;
}

std::vector<Relation> ParseRelations(const std::string& text) {
  InputStream input("file.relations", text);
  return ReadRelations(&input);
}

TEST(RelationsTest, OrderOfComposition) {
  // True displacement: 2 m ahead, no turn. The trajectory ends at the right
  // place but turned by 90 degrees: inverse(u) (+) d = (0, 0, 90 degrees).
  // (d (+) inverse(u) would be (2, -2), and inverse(d) (+) u turned by -90.)
  const std::vector<TimedPose> trajectory = {At(1, 0, 0, 0),
                                             At(2, 2, 0, kPi / 2)};
  const RelationEvaluation right_place =
      EvaluateRelations(trajectory, {Displacement(1, 2, 2, 0, 0)});
  ASSERT_EQ(right_place.errors.size(), 1u);
  EXPECT_NEAR(right_place.translation.mean, 0.0, 1e-12);
  EXPECT_NEAR(right_place.errors[0].error[2], kPi / 2, 1e-12);
  EXPECT_NEAR(right_place.rotation_deg.mean, 90.0, 1e-9);

  // u = (1, 0, 90 degrees), d = (1, 3, 90 degrees): from u, which looks along
  // y, d lies 3 m ahead. (The other orders give (0, 3) and (-3, 0).)
  const RelationEvaluation ahead =
      EvaluateRelations({At(1, 0, 0, 0), At(2, 1, 3, kPi / 2)},
                        {Displacement(1, 2, 1, 0, kPi / 2)});
  EXPECT_NEAR(ahead.errors[0].error[0], 3.0, 1e-12);
  EXPECT_NEAR(ahead.errors[0].error[1], 0.0, 1e-12);
  EXPECT_NEAR(ahead.errors[0].error[2], 0.0, 1e-12);
}

TEST(RelationsTest, DisplacementIsSeenFromTheFirstPose) {
  // From (5, 5) looking along y to (5, 7) looking along -x: 2 m ahead, turned
  // left by 90 degrees.
  const RelationEvaluation evaluation =
      EvaluateRelations({At(1, 5, 5, kPi / 2), At(2, 5, 7, kPi)},
                        {Displacement(1, 2, 2, 0, kPi / 2)});
  EXPECT_NEAR(evaluation.translation.mean, 0.0, 1e-12);
  EXPECT_NEAR(evaluation.rotation_deg.mean, 0.0, 1e-9);
}

TEST(RelationsTest, AnglesAreWrapped) {
  const RelationEvaluation evaluation = EvaluateRelations(
      {At(1, 0, 0, 3.0), At(2, 0, 0, -3.0)}, {Displacement(1, 2, 0, 0, 0)});
  EXPECT_NEAR(evaluation.rotation_deg.mean, RadToDeg(2 * kPi - 6.0), 1e-9);
}

TEST(RelationsTest, Statistics) {
  // Errors 3, 4, 8: mean 5, deviations -2, -1, 3, sample variance 14 / 2.
  const ErrorStatistics statistics = ComputeStatistics({3, 4, 8});
  EXPECT_EQ(statistics.count, 3u);
  EXPECT_DOUBLE_EQ(statistics.mean, 5.0);
  EXPECT_DOUBLE_EQ(statistics.standard_deviation, std::sqrt(7.0));
  EXPECT_DOUBLE_EQ(statistics.maximum, 8.0);
  EXPECT_EQ(ComputeStatistics({3}).standard_deviation, 0.0);
  EXPECT_EQ(ComputeStatistics({}).mean, 0.0);
}

TEST(RelationsTest, SquaredErrors) {
  // Translational errors 3 and 5, rotational errors 0 and 10 degrees.
  const RelationEvaluation evaluation = EvaluateRelations(
      {At(1, 0, 0, 0), At(2, 4, 0, 0), At(3, 4, 0, DegToRad(10))},
      {Displacement(1, 2, 1, 0, 0), Displacement(1, 3, 0, 3, 0)});
  EXPECT_NEAR(evaluation.translation.mean, 4.0, 1e-12);
  EXPECT_NEAR(evaluation.squared_translation.mean, 17.0, 1e-9);
  EXPECT_NEAR(evaluation.squared_translation.maximum, 25.0, 1e-9);
  EXPECT_NEAR(evaluation.rotation_deg.mean, 5.0, 1e-9);
  EXPECT_NEAR(evaluation.squared_rotation_deg.mean, 50.0, 1e-9);
  EXPECT_NEAR(evaluation.squared_rotation_deg.standard_deviation,
              std::sqrt(5000.0), 1e-9);
}

TEST(RelationsTest, TimesMatchToAMillisecond) {
  const std::vector<TimedPose> trajectory = {At(976052857.337530, 0, 0, 0),
                                             At(976052858.0, 1, 0, 0),
                                             At(976052857.5, 2, 0, 0)};
  const TrajectoryIndex index(trajectory);
  EXPECT_EQ(index.Find(976052857.337530, 1e-3), 0);
  EXPECT_EQ(index.Find(976052857.338530, 1e-3), 0);
  EXPECT_EQ(index.Find(976052857.336530, 1e-3), 0);
  EXPECT_EQ(index.Find(976052857.339, 1e-3), -1);
  EXPECT_EQ(index.Find(976052857.336, 1e-3), -1);
  EXPECT_EQ(index.Find(976052857.5004, 1e-3), 2);
  EXPECT_EQ(index.Find(976052858.0, 0.0), 1);
  EXPECT_EQ(index.Find(0.0, 1e-3), -1);
  EXPECT_EQ(index.Find(1e12, 1e-3), -1);

  const RelationEvaluation evaluation = EvaluateRelations(
      trajectory, {Displacement(976052857.3375, 976052858.0, 1, 0, 0),
                   Displacement(976052857.3375, 976052859.0, 1, 0, 0),
                   Displacement(1.0, 976052858.0, 1, 0, 0)});
  EXPECT_EQ(evaluation.errors.size(), 1u);
  EXPECT_EQ(evaluation.unmatched.size(), 2u);
}

TEST(RelationsTest, NearestAndThenFirst) {
  const std::vector<TimedPose> trajectory = {
      At(1.0, 0, 0, 0), At(1.0008, 0, 0, 0), At(1.0, 0, 0, 0),
      At(1.0008, 0, 0, 0)};
  const TrajectoryIndex index(trajectory);
  EXPECT_EQ(index.Find(1.0003, 1e-3), 0);
  EXPECT_EQ(index.Find(1.0006, 1e-3), 1);
  EXPECT_EQ(index.Find(1.0, 1e-3), 0);
  EXPECT_EQ(index.Find(1.0012, 1e-3), 1);
}

TEST(RelationsTest, NoMatchAtAll) {
  const RelationEvaluation evaluation =
      EvaluateRelations({}, {Displacement(1, 2, 0, 0, 0)});
  EXPECT_EQ(evaluation.translation.count, 0u);
  EXPECT_EQ(evaluation.unmatched.size(), 1u);
}

TEST(RelationsTest, ReadsRelations) {
  const std::vector<Relation> relations = ParseRelations(
      "# t1 t2 x y z roll pitch yaw\n"
      "\n"
      "1216.630413 1217.490267 0.407950 -0.016330 0.1 0.2 0.3 -0.069620\r\n"
      "  1 2\t3 4 0 0 0 5");
  ASSERT_EQ(relations.size(), 2u);
  EXPECT_EQ(relations[0].time1, 1216.630413);
  EXPECT_EQ(relations[0].time2, 1217.490267);
  EXPECT_EQ(relations[0].displacement, Pose2(0.407950, -0.016330, -0.069620));
  EXPECT_EQ(relations[0].line, 3);
  EXPECT_EQ(relations[1].displacement, Pose2(3, 4, 5));
}

TEST(RelationsTest, RefusesBadRelations) {
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 3 4 5 6 7 8\n1 2 3\n"); }),
              HasSubstr("file.relations:2: 3 fields: expected eight numbers"));
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 3 4 5 6 7 8 9\n"); }),
              HasSubstr("file.relations:1: 9 fields"));
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 3 nan 5 6 7 8\n"); }),
              HasSubstr("file.relations:1: 'nan' is no finite number"));
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 3 4x 5 6 7 8\n"); }),
              HasSubstr("'4x' is no finite number"));
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 3 1e999 5 6 7 8\n"); }),
              HasSubstr("'1e999' is no finite number"));
  EXPECT_THAT(Refusal([] { ParseRelations("1 2 -1e308 4 5 6 7 8\n"); }),
              HasSubstr("'-1e308' is absurd"));
  EXPECT_THAT(Refusal([] { ParseRelations("# nothing\n"); }),
              HasSubstr("file.relations: holds no relation"));
  EXPECT_THAT(Refusal([] { ParseRelations("\x1f\x8b\x08"); }),
              HasSubstr("gzip data breaks off"));
}

TEST(RelationsTest, WritesErrors) {
  std::ostringstream output;
  Relation relation = Displacement(1, 2.5, 1, 0, 0);
  relation.line = 7;
  WriteRelationErrors(
      EvaluateRelations({At(1, 0, 0, 0), At(2.5, 4, 4, 0)}, {relation}),
      output);
  EXPECT_EQ(output.str(),
            "line,t1,t2,error_x_m,error_y_m,error_theta_deg,translation_m,"
            "rotation_deg\n"
            "7,1.000000,2.500000,3,4,0,5,0\n");
}

// Raw odometry against the published relations: known numbers.
TEST(RelationsTest, RawOdometryOfPublicLogs) {
  const char* const folder = std::getenv("PLUMBLINE_DATASETS");
  struct Case {
    std::string name;
    std::size_t relations;
    double mean;
    double standard_deviation;
  };
  int found = 0;
  for (const Case& c : {Case{"intel", 2984, 7.370, 14.349},
                        Case{"mit-killian", 4677, 50.319, 128.141},
                        Case{"fr079", 1685, 6.504, 13.664}}) {
    if (folder == nullptr) break;
    const std::string base = std::string(folder) + "/" + c.name;
    if (!std::ifstream(base + ".clf.bz2")) continue;
    ++found;
    const Log log = ReadCarmenLog(base + ".clf.bz2", {});
    std::vector<TimedPose> trajectory;
    for (const Scan& scan : log.scans) {
      trajectory.push_back(
          {scan.timestamp, scan.timestamp_text, scan.odometry});
    }
    const RelationEvaluation evaluation =
        EvaluateRelations(trajectory, ReadRelations(base + ".relations"));
    EXPECT_EQ(evaluation.errors.size(), c.relations) << c.name;
    EXPECT_EQ(evaluation.unmatched.size(), 0u) << c.name;
    EXPECT_NEAR(evaluation.translation.mean, c.mean, 6e-4) << c.name;
    // The known figure divides by n.
    const double n = static_cast<double>(c.relations);
    EXPECT_NEAR(
        evaluation.translation.standard_deviation * std::sqrt((n - 1) / n),
        c.standard_deviation, 6e-4)
        << c.name;
  }
  if (found == 0)
    GTEST_SKIP() << "PLUMBLINE_DATASETS names no folder with the public logs";
}

}  // namespace
}  // namespace plumbline
