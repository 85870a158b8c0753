#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/proposal_filter.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;

class ProposalFilterTest : public WallsTest {
 protected:
  ProposalFilterTest()
      : detector_("directions", 2, nullptr),
        hierarchy_(MakeTestHierarchy()),
        memory_(&graph_, EmOptions()),
        support_(&graph_, hierarchy_, registry_) {}

  // Has a detector of the name of detector_.
  Hierarchy MakeTestHierarchy() {
    RegisterTestDetector("directions", &registry_);
    Hierarchy hierarchy(1);
    hierarchy[0].push_back(
        std::make_unique<TestDetector>("directions", 2, nullptr));
    return hierarchy;
  }

  Transaction Filter(Transaction proposal) const {
    return ProposalFilter(&graph_, priors_, &memory_, &support_)
        .Filter(std::move(proposal), detector_);
  }

  // Adds a direction with these walls to a proposal.
  void Propose(double degrees, const std::vector<FeatureId>& walls,
               Transaction* proposal) const {
    Feature feature = Orientation(registry_, DegToRad(degrees));
    feature.is_virtual = false;
    const FeatureId orientation = proposal->AddFeature(feature);
    for (const FeatureId wall : walls) {
      proposal->AddConstraint(Structure(registry_, "segment_orientation", wall,
                                        orientation, 0.0, 0.5));
    }
  }

  TestDetector detector_;
  Hierarchy hierarchy_;
  std::map<std::string, RelationPrior> priors_;
  HypothesisMemory memory_;
  SupportPolicy support_;
};

TEST_F(ProposalFilterTest, ANewProposalPassesWithItsMakersName) {
  Transaction proposal;
  Propose(0.0, {AddSegment(0.0), AddSegment(0.0)}, &proposal);
  const Transaction accepted = Filter(std::move(proposal));
  ASSERT_EQ(accepted.added_features().size(), 1u);
  EXPECT_TRUE(accepted.added_features()[0].is_virtual);
  EXPECT_EQ(accepted.added_features()[0].source, "directions");
  EXPECT_EQ(accepted.added_features()[0].maker,
            registry_.FindDetector("directions"));
  ASSERT_EQ(accepted.added_constraints().size(), 2u);
  EXPECT_EQ(accepted.added_constraints()[1].source, "directions");
  graph_.Apply(accepted);
}

TEST_F(ProposalFilterTest, TooLittleSupportTakesConstraintsAlong) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(90.0);
  const FeatureId c = AddSegment(90.0);
  Transaction proposal;
  Propose(0.0, {a}, &proposal);
  Propose(90.0, {b, c}, &proposal);
  // A relation to what is left out goes with it.
  proposal.AddConstraint(Structure(
      registry_, "orientation_orientation", Transaction::ProvisionalId(0),
      Transaction::ProvisionalId(1), kPi / 2, 0.1));
  const Transaction accepted = Filter(std::move(proposal));
  ASSERT_EQ(accepted.added_features().size(), 1u);
  EXPECT_NEAR(accepted.added_features()[0].parameters[0], kPi / 2, 1e-12);
  ASSERT_EQ(accepted.added_constraints().size(), 2u);
  EXPECT_THAT(accepted.added_constraints()[0].features,
              ElementsAre(b, Transaction::ProvisionalId(0)));
}

TEST_F(ProposalFilterTest, WhatIsThereIsLeftOut) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a});
  Transaction proposal;
  for (const FeatureId wall : {a, b}) {
    proposal.AddConstraint(Structure(registry_, "segment_orientation", wall,
                                     orientation, 0.0, 0.5));
  }
  const Transaction accepted = Filter(std::move(proposal));
  ASSERT_EQ(accepted.added_constraints().size(), 1u);
  EXPECT_EQ(accepted.added_constraints()[0].features[0], b);
}

TEST_F(ProposalFilterTest, WhatWasBrokenIsLeftOut) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId b = AddSegment(5.0);
  const FeatureId orientation = AddOrientation(0.0, {a, b});
  const ConstraintId broken = Between(b, orientation);
  Break(broken);
  memory_.Remember(graph_.GetConstraint(broken));
  memory_.MeasureRelaxedErrors();
  Transaction proposal;
  proposal.AddConstraint(
      Structure(registry_, "segment_orientation", b, orientation, 0.0, 0.5));
  EXPECT_TRUE(Filter(std::move(proposal)).empty());
}

TEST_F(ProposalFilterTest, PriorsSayWhatIsExpectedAndHowExactly) {
  const std::vector<FeatureId> walls = {AddSegment(0.0), AddSegment(0.0)};
  Transaction proposal;
  Propose(0.0, walls, &proposal);
  priors_["segment_orientation"].sigmas = {0.25};
  EXPECT_NEAR(Filter(proposal).added_constraints()[0].information(0, 0), 16.0,
              1e-12);
  priors_["segment_orientation"].is_expected = false;
  EXPECT_TRUE(Filter(proposal).empty());
  priors_["segment_orientation"] = {true, {0.1, 0.1}};
  EXPECT_THROW(Filter(proposal), Error);
}

TEST_F(ProposalFilterTest, WhatADetectorTakesBackPasses) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a});
  Transaction proposal;
  proposal.RemoveConstraint(Between(a, orientation));
  proposal.RemoveFeature(orientation);
  const Transaction accepted = Filter(std::move(proposal));
  EXPECT_EQ(accepted.removed_constraints().size(), 1u);
  EXPECT_EQ(accepted.removed_features().size(), 1u);
}

// The graph says what is wrong with it.
TEST_F(ProposalFilterTest, WhatIsNotWellFormedPasses) {
  const FeatureId a = AddSegment(0.0);
  const FeatureId orientation = AddOrientation(0.0, {a});
  Transaction proposal;
  Constraint constraint =
      Structure(registry_, "segment_orientation", a, orientation, 0.0, 0.5);
  constraint.expected = Eigen::Vector2d::Zero();
  proposal.AddConstraint(constraint);
  const Transaction accepted = Filter(std::move(proposal));
  ASSERT_EQ(accepted.added_constraints().size(), 1u);
  EXPECT_THROW(graph_.Apply(accepted), Error);
}

}  // namespace
}  // namespace plumbline
