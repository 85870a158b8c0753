#include <gtest/gtest.h>
#include <plumbline/factors/angle.h>
#include <plumbline/pipeline/placement_tie.h>

namespace plumbline {
namespace {

// 0.1 m + 40 m of 0.02 are 0.9 m; 1 degree + 40 m of 0.1 are 5 degrees.
TEST(PlacementTieTest, GrowsWithTheWay) {
  const Pose2 mean(3.0, -2.0, 0.5);
  const UncertainPose2 tie = PlacementTie(mean, 40.0);
  EXPECT_EQ(tie.mean, mean);
  EXPECT_NEAR(tie.covariance(0, 0), 0.81, 1e-12);
  EXPECT_NEAR(tie.covariance(1, 1), 0.81, 1e-12);
  EXPECT_NEAR(tie.covariance(2, 2), DegToRad(5.0) * DegToRad(5.0), 1e-12);
  EXPECT_EQ(tie.covariance(0, 1), 0.0);
  EXPECT_NEAR(PlacementTie(mean, 0.0).covariance(0, 0), 0.01, 1e-12);
}

}  // namespace
}  // namespace plumbline
