#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>
#include <plumbline/outputs/marginals_output.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class MarginalsOutputTest : public ::testing::Test {
 protected:
  MarginalsOutputTest() { RegisterBuiltinRelations(&registry_); }

  // A pose at the origin that looks along y sees a tree; variances of 4 m^2
  // ahead and 1 m^2 to the side.
  void Make(bool fixed) {
    Transaction transaction;
    Feature pose;
    pose.type = &registry_.GetFeature("pose");
    pose.parameters = {0.0, 0.0, kPi / 2};
    pose.fixed = fixed;
    Feature tree;
    tree.type = &registry_.GetFeature("point");
    tree.parameters = {1.0, 5.0};
    Constraint seen;
    seen.type = &registry_.GetRelation("pose_point");
    seen.features = {transaction.AddFeature(pose),
                     transaction.AddFeature(tree)};
    seen.expected = Eigen::Vector2d(5.0, -1.0);
    seen.information = Eigen::Vector2d(0.25, 1.0).asDiagonal();
    transaction.AddConstraint(seen);
    // Nothing is known of this one.
    transaction.AddFeature(tree);
    graph_.Apply(transaction);
  }

  FeatureCovariances Compute(const std::string& list, bool hold_gauge = false) {
    return ComputeMarginals(graph_, nullptr,
                            ParseMarginalsSelection(list, registry_),
                            hold_gauge, &missing_);
  }
  std::string Refusal(const std::string& list) {
    try {
      Compute(list);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  }

  Registry registry_;
  Graph graph_;
  // Of the last Compute().
  std::vector<std::string> missing_;
};

TEST_F(MarginalsOutputTest, Selections) {
  EXPECT_TRUE(ParseMarginalsSelection("", registry_).empty());
  EXPECT_TRUE(ParseMarginalsSelection("none", registry_).empty());
  const MarginalsSelection selection =
      ParseMarginalsSelection("point,17,line,3", registry_);
  EXPECT_EQ(selection.types,
            (std::set<const FeatureType*>{registry_.FindFeature("line"),
                                          registry_.FindFeature("point")}));
  EXPECT_EQ(selection.ids, (std::set<FeatureId>{3, 17}));
  EXPECT_TRUE(ParseMarginalsSelection("all", registry_).all);
  const std::string refusal = Refusal("point,tree");
  EXPECT_THAT(refusal, HasSubstr("--marginals: unknown word 'tree'"));
  EXPECT_THAT(refusal, HasSubstr("segment"));
}

TEST_F(MarginalsOutputTest, ByHand) {
  Make(/*fixed=*/true);
  const FeatureCovariances covariances = Compute("all");
  // The third has no constraint.
  ASSERT_EQ(covariances.size(), 2u);
  EXPECT_TRUE(covariances.at(0).isZero(0.0));
  EXPECT_NEAR(covariances.at(1)(0, 0), 1.0, 1e-9);
  EXPECT_NEAR(covariances.at(1)(1, 1), 4.0, 1e-9);
  EXPECT_NEAR(covariances.at(1)(0, 1), 0.0, 1e-9);
  EXPECT_EQ(Compute("point").count(0), 0u);
  EXPECT_EQ(Compute("0").size(), 1u);
  EXPECT_TRUE(Compute("none").empty());

  // Of 3 sigma: 6 m along y, 3 m along x; the fixed pose has none.
  const std::vector<DrawnEllipse> ellipses =
      EllipsesOf(graph_, covariances, 3.0);
  ASSERT_EQ(ellipses.size(), 1u);
  EXPECT_EQ(ellipses[0].id, 1);
  EXPECT_EQ(ellipses[0].x, 1.0);
  EXPECT_EQ(ellipses[0].y, 5.0);
  EXPECT_NEAR(ellipses[0].major, 6.0, 1e-8);
  EXPECT_NEAR(ellipses[0].minor, 3.0, 1e-8);
  EXPECT_NEAR(std::abs(std::sin(ellipses[0].direction)), 1.0, 1e-8);
}

TEST_F(MarginalsOutputTest, GaugeThatIsNotFixed) {
  Make(/*fixed=*/false);
  EXPECT_THAT(Refusal("point"), HasSubstr("gauge"));
  EXPECT_THAT(Refusal("point"), HasSubstr("not fixed"));
  const FeatureCovariances held = Compute("all", /*hold_gauge=*/true);
  EXPECT_TRUE(held.at(0).isZero(0.0));
  EXPECT_NEAR(held.at(1)(1, 1), 4.0, 1e-9);
}

TEST_F(MarginalsOutputTest, GaugeIsCheckedBeforehand) {
  const auto refusal = [&](const std::string& list) -> std::string {
    try {
      CheckGauge(graph_, ParseMarginalsSelection(list, registry_));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  Make(/*fixed=*/true);
  EXPECT_EQ(refusal("all"), "");
  Make(/*fixed=*/false);
  EXPECT_THAT(refusal("all"), HasSubstr("the gauge of pose 3 is not fixed"));
  EXPECT_THAT(refusal("4"), HasSubstr("point 4"));
  // Those of the part that is tied, those without relations, and none.
  EXPECT_EQ(refusal("0,1,2,5"), "");
  EXPECT_EQ(refusal("none"), "");
  // A prior ties the second part.
  Constraint prior;
  prior.type = &registry_.GetRelation("pose_prior");
  prior.features = {3};
  prior.expected = Eigen::Vector3d::Zero();
  prior.information = Eigen::Matrix3d::Identity();
  Transaction transaction;
  transaction.AddConstraint(prior);
  const ConstraintId id = graph_.Apply(transaction).constraints[0];
  EXPECT_EQ(refusal("all"), "");
  Transaction broken;
  broken.BreakConstraint(id);
  graph_.Apply(broken);
  EXPECT_THAT(refusal("point"), HasSubstr("FIX"));
}

TEST_F(MarginalsOutputTest, FeaturesThatHaveNone) {
  // What can be had is there all the same.
  Make(/*fixed=*/true);
  EXPECT_EQ(Compute("line,segment,1,2,99").size(), 1u);
  EXPECT_THAT(
      missing_,
      ElementsAre("no line that was measured", "no segment that was measured",
                  "no live constraint on point 2", "no feature 99"));
  EXPECT_EQ(Compute("point,0").size(), 2u);
  EXPECT_THAT(missing_, IsEmpty());
  EXPECT_TRUE(Compute("circle").empty());
  EXPECT_THAT(missing_, ElementsAre("no circle that was measured"));
  EXPECT_TRUE(ComputeMarginals(Graph(), nullptr,
                               ParseMarginalsSelection("all", registry_), false,
                               &missing_)
                  .empty());
  EXPECT_THAT(missing_, ElementsAre("nothing that was measured"));
}

TEST_F(MarginalsOutputTest, MapJson) {
  Make(/*fixed=*/true);
  FeatureCovariances covariances;
  covariances[1] = (Eigen::Matrix2d() << 1.0, 0.5, 0.5, 4.0).finished();
  std::ostringstream output;
  WriteGraphJson(graph_, output, &covariances);
  const auto json = nlohmann::json::parse(output.str());
  using Rows = std::vector<std::vector<double>>;
  EXPECT_EQ(json["features"][1]["covariance"].get<Rows>(),
            (Rows{{1.0, 0.5}, {0.5, 4.0}}));
  EXPECT_FALSE(json["features"][0].contains("covariance"));
  Graph again;
  std::istringstream input(output.str());
  ReadGraphJson(input, "map.json", registry_, &again);
  EXPECT_EQ(again.num_features(), 3u);
  // Without any, nothing changes.
  std::ostringstream plain;
  WriteGraphJson(graph_, plain);
  EXPECT_EQ(plain.str().find("covariance"), std::string::npos);
}

}  // namespace
}  // namespace plumbline
