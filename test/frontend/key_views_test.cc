#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/key_views.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "frontend/synthetic_world.h"

namespace plumbline {
namespace {

TEST(KeyViewsTest, AreThoseOfTheKeyScans) {
  testing::Noise noise(1);
  testing::Laser laser;
  laser.offset = Pose2(0.2, 0.0, 0.0);
  std::vector<Scan> scans;
  for (int i = 0; i < 3; ++i) {
    scans.push_back(testing::MakeScan(testing::Room(6.0, 4.0),
                                      Pose2(0.3 * i, 0.0, 0.0), laser, &noise));
  }
  const std::vector<Pose2> poses = {Pose2::Zero(), Pose2(0.6, 0.0, 0.0)};
  const std::vector<KeyView> views = MakeKeyViews(scans, {0, 2}, poses, {});
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[1].pose, poses[1]);
  EXPECT_EQ(views[1].laser, Eigen::Vector2d(0.2, 0.0));
  ASSERT_GT(views[1].points.size(), 30u);
  // Thinned out, and on the wall ahead or beside.
  for (std::size_t i = 1; i < views[1].points.size(); ++i) {
    const Eigen::Vector2d& point = views[1].points[i].position;
    EXPECT_GE((point - views[1].points[i - 1].position).norm(), kViewSpacing);
    EXPECT_TRUE(std::abs(point.x() - 2.4) < 0.02 ||
                std::abs(std::abs(point.y()) - 2.0) < 0.02)
        << point.transpose();
  }
  EXPECT_THROW(MakeKeyViews(scans, {0, 2}, {Pose2::Zero()}, {}), Error);
}

TEST(KeyViewsTest, TheNearOnesAndOfManyAFew) {
  std::vector<KeyView> map(40);
  for (std::size_t k = 0; k < map.size(); ++k) {
    map[k].pose = Pose2(static_cast<double>(k), 5.0, 1.0);
  }
  const Pose2 place(20.0, 5.0, 0.0);
  EXPECT_EQ(ViewsNear(map, place, 1.5, 60),
            (std::vector<std::size_t>{19, 20, 21}));
  EXPECT_EQ(ViewsNear(map, place, 100.0, 4),
            (std::vector<std::size_t>{0, 10, 20, 30}));
  EXPECT_TRUE(ViewsNear(map, Pose2(20.0, 9.0, 0.0), 1.5, 60).empty());
}

}  // namespace
}  // namespace plumbline
