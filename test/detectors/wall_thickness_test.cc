#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/factors/segment_segment_collinearity.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "detectors/face_world.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr char kThicknessTie[] = "segment_segment_thickness";

// Rooms in a row along x, 4 m wide and 4 m deep, with walls between them, and a
// way of the robot through all of them.
class RowOfRooms {
 public:
  explicit RowOfRooms(const Pose2& motion = Pose2::Zero(),
                      std::uint64_t seed = 1)
      : world(motion, seed) {}

  // `thicknesses`: of the walls between rooms, from the left.
  void Build(const std::vector<double>& thicknesses) {
    double x = 0.0;
    for (std::size_t room = 0; room <= thicknesses.size(); ++room) {
      for (const double along : {0.7, 2.0, 3.3}) {
        world.AddPose(x + along, 0.1, 0.05);
      }
      if (room > 0) left.push_back(world.AddFace(x, 2.0, x, -2.0));
      world.AddFace(x, -2.0, x + 4.0, -2.0);
      x += 4.0;
      if (room == thicknesses.size()) break;
      right.push_back(world.AddFace(x, -2.0, x, 2.0));
      x += thicknesses[room];
    }
  }

  void See() { world.SeeAll(5.0, 0.006, DegToRad(0.4)); }

  FaceWorld world;
  // Of each wall between rooms the face in the room before it, and that in the
  // room behind it.
  std::vector<FeatureId> right;
  std::vector<FeatureId> left;
};

TEST(WallThicknessTest, WallsOfOneThickness) {
  for (const Pose2& motion :
       {Pose2(Pose2::Zero()), Pose2(3.0, -4.0, 2.0), Pose2(5.0, 0.0, -kPi),
        Pose2(-10000.0, 7000.0, -3.0)}) {
    RowOfRooms rooms(motion);
    rooms.Build(std::vector<double>(6, 0.12));
    rooms.See();
    const Transaction transaction = rooms.world.Detect("wall_thickness");
    ASSERT_EQ(transaction.added_features().size(), 1u);
    const Feature& thickness = transaction.added_features()[0];
    EXPECT_EQ(thickness.type->name, "thickness");
    EXPECT_EQ(thickness.level, 1);
    EXPECT_TRUE(thickness.is_virtual);
    EXPECT_EQ(thickness.source, "wall_thickness");
    EXPECT_NEAR(thickness.parameters[0], 0.12, 1e-6);
    std::vector<std::vector<FeatureId>> ties, expected;
    for (const Constraint& constraint : transaction.added_constraints()) {
      EXPECT_EQ(constraint.expected, Eigen::Vector2d(0.0, kPi));
      ties.push_back(constraint.features);
    }
    for (std::size_t i = 0; i < rooms.left.size(); ++i) {
      expected.push_back(
          {rooms.right[i], rooms.left[i], Transaction::ProvisionalId(0)});
    }
    std::sort(ties.begin(), ties.end());
    EXPECT_EQ(ties, expected);
  }
}

TEST(WallThicknessTest, TolerancesHoldWhereTheFacesOverlap) {
  RowOfRooms rooms;
  rooms.Build(std::vector<double>(5, 0.2));
  rooms.See();
  const Transaction transaction =
      rooms.world.Detect("wall_thickness", {{"sigma", 0.02},
                                            {"sigma_deg", 0.5},
                                            {"own_direction_noise_deg", 3.0},
                                            {"innovation_gate", 9.0}});
  ASSERT_EQ(transaction.added_constraints().size(), 5u);
  const double own = 3.0 / std::pow(4.0, 1.5);
  const double sigma_angle = DegToRad(std::hypot(0.5, std::hypot(own, own)));
  // Positions are a third of the way along the second face, 4 m long.
  const Eigen::Matrix2d expected =
      CollinearityInformation(0.02, sigma_angle, 2.0 / 3.0);
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_LT((constraint.information - expected).norm(),
              1e-6 * expected.norm());
    EXPECT_DOUBLE_EQ(constraint.break_below, ChiSquarePValue(9.0, 2));
  }
}

TEST(WallThicknessTest, SeveralThicknesses) {
  RowOfRooms rooms;
  rooms.Build({0.1, 0.3, 0.1, 0.1, 0.3, 0.3, 0.1, 0.2, 0.3, 0.1, 0.3});
  rooms.See();
  const Transaction transaction = rooms.world.Detect("wall_thickness");
  ASSERT_EQ(transaction.added_features().size(), 2u);
  EXPECT_NEAR(transaction.added_features()[0].parameters[0], 0.1, 1e-3);
  EXPECT_NEAR(transaction.added_features()[1].parameters[0], 0.3, 1e-3);
  // The one of 0.2 m shares its thickness with none.
  EXPECT_EQ(transaction.added_constraints().size(), 10u);
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_NE(constraint.features[0], rooms.right[7]);
  }
}

TEST(WallThicknessTest, WithoutEvidenceThereIsNone) {
  // All different; and three that are alike are too few.
  for (const std::vector<double>& thicknesses :
       {std::vector<double>{0.08, 0.13, 0.19, 0.26, 0.34, 0.43, 0.53},
        std::vector<double>(3, 0.15)}) {
    RowOfRooms rooms;
    rooms.Build(thicknesses);
    rooms.See();
    EXPECT_TRUE(rooms.world.Detect("wall_thickness").empty());
  }
}

// Walls are judged by what is known of them: one that is 4 cm too thick is of
// the class only where that may be an error.
TEST(WallThicknessTest, WallsAreJudgedByTheirInnovation) {
  for (const bool is_sure : {true, false}) {
    RowOfRooms rooms;
    rooms.Build({0.12, 0.12, 0.12, 0.12, 0.12, 0.12, 0.165});
    rooms.See();
    const FeatureId face = rooms.left.back();
    if (!is_sure) {
      Transaction forget;
      for (const ConstraintId id : rooms.world.graph().ConstraintsOf(face)) {
        forget.RemoveConstraint(id);
      }
      rooms.world.graph().Apply(std::move(forget));
      rooms.world.See(rooms.world.poses().back(), face, 0.04, DegToRad(1.0));
    }
    DetectionCounts counts;
    const Transaction transaction =
        rooms.world.Detect("wall_thickness", {}, nullptr, &counts);
    EXPECT_EQ(transaction.added_constraints().size(), is_sure ? 6u : 7u);
    EXPECT_EQ(counts["walls refused: no thickness fits"], is_sure ? 1 : 0);
    EXPECT_EQ(counts["thicknesses found"], 1);
  }
}

TEST(WallThicknessTest, WallsJoinWhatIsThere) {
  RowOfRooms rooms;
  rooms.Build({0.12, 0.12, 0.12, 0.12, 0.12});
  rooms.See();
  ASSERT_TRUE(rooms.world.RunEm("wall_thickness"));
  const std::vector<FeatureId> classes = rooms.world.graph().VirtualFeatures(1);
  ASSERT_EQ(classes.size(), 1u);
  EXPECT_EQ(rooms.world.Tied(kThicknessTie).size(), 5u);
  EXPECT_TRUE(rooms.world.Detect("wall_thickness").empty());
  const double x = 4.0 * 6.0 + 0.12 * 5.0;
  const FeatureId first = rooms.world.AddFace(x, -2.0, x, 2.0);
  const FeatureId second = rooms.world.AddFace(x + 0.12, 2.0, x + 0.12, -2.0);
  const FeatureId pose = rooms.world.AddPose(x + 2.0, 0.0, 0.0);
  rooms.world.See(rooms.world.poses()[rooms.world.poses().size() - 2], first,
                  0.006, DegToRad(0.2));
  rooms.world.See(pose, second, 0.006, DegToRad(0.2));
  const Transaction transaction = rooms.world.Detect("wall_thickness");
  EXPECT_THAT(transaction.added_features(), IsEmpty());
  ASSERT_EQ(transaction.added_constraints().size(), 1u);
  EXPECT_THAT(transaction.added_constraints()[0].features,
              ElementsAre(first, second, classes[0]));
}

// Of the faces behind a face the nearest one makes the wall with it: what lies
// behind that belongs to another one.
TEST(WallThicknessTest, TheNearestFaceCounts) {
  RowOfRooms rooms;
  rooms.Build(std::vector<double>(5, 0.12));
  // A shaft behind each wall, 0.3 m on, seen from the room.
  const std::vector<FeatureId> left = rooms.left;
  for (std::size_t i = 0; i < left.size(); ++i) {
    const double x = 4.0 + static_cast<double>(i) * 4.12 + 0.42;
    rooms.world.AddFace(x, 2.0, x, -2.0);
  }
  rooms.See();
  DetectionCounts counts;
  const Transaction transaction =
      rooms.world.Detect("wall_thickness", {}, nullptr, &counts);
  EXPECT_EQ(counts["walls with two faces"], 5);
  ASSERT_EQ(transaction.added_constraints().size(), 5u);
  for (const Constraint& constraint : transaction.added_constraints()) {
    EXPECT_EQ(std::count(left.begin(), left.end(), constraint.features[1]), 1);
  }
}

TEST(WallThicknessTest, OnlyWhatPosesHaveSeen) {
  RowOfRooms unseen;
  unseen.Build(std::vector<double>(6, 0.12));
  EXPECT_TRUE(unseen.world.Detect("wall_thickness").empty());
  unseen.See();
  EXPECT_FALSE(unseen.world.Detect("wall_thickness").empty());
  EXPECT_TRUE(
      unseen.world.Detect("wall_thickness", {}, &unseen.world.faces()).empty());
}

TEST(WallThicknessTest, RefusesParametersOutOfRange) {
  Registry registry;
  RegisterBuiltins(&registry);
  const DetectorType& type = registry.GetDetector("wall_thickness");
  EXPECT_THROW(type.make({{"sigma", 0.0}}), Error);
  EXPECT_THROW(type.make({{"min_support", 1.0}}), Error);
  EXPECT_THROW(type.make({{"min_thickness", 0.5}, {"max_thickness", 0.3}}),
               Error);
  EXPECT_THROW(type.make({{"thickness", 0.1}}), Error);
}

// Rows of rooms with walls of two thicknesses and some of any, measured with
// noise: what is tied has the thickness, nearly everything that has is tied,
// and thicknesses come out better.
TEST(WallThicknessTest, PrecisionAndRecallInFiftyBuildings) {
  int tied = 0, right = 0, there = 0, classes = 0;
  double before = 0.0, after = 0.0;
  for (std::uint64_t trial = 1; trial <= 50; ++trial) {
    RowOfRooms rooms(Pose2(0.1 * static_cast<double>(trial), -3.0,
                           0.13 * static_cast<double>(trial)),
                     trial);
    FaceWorld& world = rooms.world;
    world.set_noise(1.0);
    const double thin = world.Uniform(0.08, 0.14);
    const double thick = world.Uniform(0.22, 0.35);
    std::vector<double> truth;
    std::vector<bool> is_shared;
    for (int wall = 0; wall < 20; ++wall) {
      const double kind = world.Uniform(0.0, 1.0);
      is_shared.push_back(kind < 0.85);
      truth.push_back(kind < 0.45   ? thin
                      : kind < 0.85 ? thick
                                    : world.Uniform(0.05, 0.55));
    }
    rooms.Build(truth);
    world.SeeAll(5.0, 0.012, DegToRad(0.6));
    world.Solve();
    std::map<FeatureId, std::size_t> wall_of;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      wall_of[rooms.right[i]] = i;
    }
    // Of walls that share their thickness: how much it is off, between the
    // middles of the faces.
    const auto error = [&] {
      double sum = 0.0;
      int count = 0;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        if (!is_shared[i]) continue;
        // Faces that move apart, each to its own side, make the wall thicker.
        const double off =
            world.ErrorOf(rooms.right[i])[0] + world.ErrorOf(rooms.left[i])[0];
        sum += off * off;
        ++count;
      }
      return sum / count;
    };
    before += error();
    EXPECT_TRUE(world.RunEm("wall_thickness")) << trial;
    after += error();
    classes += static_cast<int>(world.graph().VirtualFeatures(1).size());
    for (const Constraint* constraint :
         std::as_const(world.graph()).Constraints()) {
      if (constraint->state != ConstraintState::kLive ||
          constraint->type->name != kThicknessTie) {
        continue;
      }
      ++tied;
      const std::size_t wall = wall_of.at(constraint->features[0]);
      const double shared =
          world.graph().GetFeature(constraint->features[2]).parameters[0];
      // Some of the others are as thick by chance.
      right += std::abs(truth[wall] - shared) < 0.02;
    }
    there +=
        static_cast<int>(std::count(is_shared.begin(), is_shared.end(), true));
  }
  RecordProperty("right", right);
  RecordProperty("tied", tied);
  RecordProperty("there", there);
  RecordProperty("classes", classes);
  RecordProperty("before_um", static_cast<int>(1e6 * std::sqrt(before / 50)));
  RecordProperty("after_um", static_cast<int>(1e6 * std::sqrt(after / 50)));
  EXPECT_GE(right, 0.975 * tied) << right << " of " << tied;
  EXPECT_GE(right, 0.9 * there) << right << " of " << there;
  // Two in each; what has too few walls or too much noise is not found.
  EXPECT_GE(classes, 85);
  EXPECT_LE(classes, 102);
  EXPECT_LT(after, 0.7 * before);
}

}  // namespace
}  // namespace plumbline
