#include <gtest/gtest.h>
#include <plumbline/frontend/part_evidence.h>

#include <numeric>
#include <vector>

#include "frontend/long_hall.h"

namespace plumbline {
namespace {

using testing::SeeHall;

std::vector<std::size_t> Keys(std::size_t begin, std::size_t end) {
  std::vector<std::size_t> keys(end - begin);
  std::iota(keys.begin(), keys.end(), begin);
  return keys;
}

TEST(PartEvidenceTest, CountsWhatAgreesAndWhatDoesNot) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-12.0, 40, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-12.0, 40, 0, Pose2::Zero(), -0.2, &search);
  SeeHall(-12.0, 40, 0, Pose2(1.0, 0.0, 0.0), -0.2, &search);
  const PartEvidence right = CompareParts(search, Keys(0, 40), Keys(40, 80));
  // One for each 1.2 m of the 12 m of either.
  EXPECT_GE(right.agreeing, 18);
  EXPECT_LE(right.agreeing, 22);
  EXPECT_EQ(right.contradicting, 0);
  EXPECT_EQ(right.Doubt(), 0.0);
  const PartEvidence wrong = CompareParts(search, Keys(0, 40), Keys(80, 120));
  EXPECT_GE(wrong.contradicting, 15);
  EXPECT_GT(wrong.Doubt(), 0.7);
  EXPECT_LE(wrong.Doubt(), 1.0);
}

TEST(PartEvidenceTest, WhatIsFarAwaySaysNothing) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-12.0, 20, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-12.0, 20, 0, Pose2(0.0, 60.0, 0.0), 0.2, &search);
  const PartEvidence apart = CompareParts(search, Keys(0, 20), Keys(20, 40));
  EXPECT_EQ(apart.agreeing, 0);
  EXPECT_EQ(apart.contradicting, 0);
  EXPECT_EQ(apart.Doubt(), 0.0);
}

TEST(PartEvidenceTest, AFewAreNoDoubt) {
  PartEvidence evidence;
  evidence.agreeing = 4;
  evidence.contradicting = 4;
  EXPECT_EQ(evidence.Doubt(), 0.0);
  PartEvidence more;
  more.agreeing = 1;
  more.contradicting = 2;
  evidence.Add(more);
  EXPECT_EQ(evidence.agreeing, 5);
  EXPECT_EQ(evidence.contradicting, 6);
  EXPECT_DOUBLE_EQ(evidence.Doubt(), 6.0 / 11.0);
}

TEST(PartEvidenceTest, NothingIsComparedOnceItIsStopped) {
  TrackSearch search{TrackingOptions(), ScanMatcherOptions()};
  SeeHall(-12.0, 20, 0, Pose2::Zero(), 0.2, &search);
  SeeHall(-12.0, 20, 0, Pose2::Zero(), -0.2, &search);
  search.set_stop([] { return true; });
  EXPECT_EQ(CompareParts(search, Keys(0, 20), Keys(20, 40)).agreeing, 0);
}

}  // namespace
}  // namespace plumbline
