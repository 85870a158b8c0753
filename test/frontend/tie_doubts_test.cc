#include <gtest/gtest.h>
#include <plumbline/frontend/tie_doubts.h>

#include <vector>

#include "frontend/long_hall.h"

namespace plumbline {
namespace {

using testing::SeeHall;

std::vector<int> PartsOf(const TrackSearch& search) {
  std::vector<int> parts;
  for (const SeenKey& key : search.seen()) {
    if (parts.empty() || parts.back() != key.part) parts.push_back(key.part);
  }
  return parts;
}

// Three visits of the hall; the second one lies wrong by a metre.
class TieDoubtsTest : public ::testing::Test {
 protected:
  void See(const Pose2& second, const Pose2& third) {
    SeeHall(-12.0, 40, 0, Pose2::Zero(), 0.2, &search_);
    SeeHall(-12.0, 40, 0, second, -0.2, &search_);
    SeeHall(-12.0, 40, 0, third, 0.0, &search_);
  }

  const Pose2 off_ = Pose2(1.0, 0.0, 0.0);
  TrackSearch search_{TrackingOptions(), ScanMatcherOptions()};
  std::vector<int> loose_of_;
};

TEST_F(TieDoubtsTest, OnlyTheWrongOneIsCut) {
  See(off_, Pose2::Zero());
  const CutTies cut =
      CutDoubtfulTies({{800, 100, 5}, {400, 390, 3}}, &search_, &loose_of_);
  ASSERT_EQ(cut.doubts.size(), 1u);
  EXPECT_EQ(cut.doubts.begin()->first, 3);
  EXPECT_GT(cut.doubts.begin()->second, 0.7);
  EXPECT_EQ(PartsOf(search_), (std::vector<int>{0, 1, 0}));
  EXPECT_EQ(loose_of_, std::vector<int>{3});
  // The poses are as they were.
  EXPECT_EQ(search_.seen()[40].pose, Pose2(-11.0, -0.2, 0.0));
}

TEST_F(TieDoubtsTest, WhatHangsOnTheWrongOneGoesWithIt) {
  See(off_, off_);
  const CutTies cut =
      CutDoubtfulTies({{400, 390, 0}, {800, 410, 1}}, &search_, &loose_of_);
  ASSERT_EQ(cut.doubts.size(), 1u);
  EXPECT_EQ(cut.doubts.begin()->first, 0);
  EXPECT_EQ(PartsOf(search_), (std::vector<int>{0, 1}));
  EXPECT_EQ(loose_of_, std::vector<int>{0});
}

TEST_F(TieDoubtsTest, RightOnesStay) {
  See(Pose2::Zero(), Pose2::Zero());
  EXPECT_TRUE(
      CutDoubtfulTies({{400, 390, 0}, {800, 410, 1}}, &search_, &loose_of_)
          .doubts.empty());
  EXPECT_EQ(PartsOf(search_), std::vector<int>{0});
  EXPECT_TRUE(loose_of_.empty());
}

// A loose part between them keeps its entry, whatever its number is then.
TEST_F(TieDoubtsTest, PartsAreNumberedAsTheyBegin) {
  SeeHall(-12.0, 40, 0, Pose2::Zero(), 0.2, &search_);
  SeeHall(-12.0, 40, 0, off_, -0.2, &search_);
  SeeHall(-12.0, 10, 1, Pose2(3.0, 0.0, 0.0), 0.0, &search_);
  SeeHall(-12.0, 10, 0, Pose2::Zero(), 0.1, &search_);
  loose_of_ = {7};
  const CutTies cut =
      CutDoubtfulTies({{400, 390, 6}, {900, 100, 8}}, &search_, &loose_of_);
  EXPECT_EQ(cut.doubts.size(), 1u);
  EXPECT_EQ(cut.before, (std::vector<int>{0, 0, 1}));
  EXPECT_EQ(PartsOf(search_), (std::vector<int>{0, 1, 2, 0}));
  EXPECT_EQ(loose_of_, (std::vector<int>{6, 7}));
}

TEST_F(TieDoubtsTest, StoppedItCutsNothing) {
  See(off_, off_);
  search_.set_stop([] { return true; });
  EXPECT_TRUE(
      CutDoubtfulTies({{400, 390, 0}}, &search_, &loose_of_).doubts.empty());
  EXPECT_EQ(PartsOf(search_), std::vector<int>{0});
}

}  // namespace
}  // namespace plumbline
