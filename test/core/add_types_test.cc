// Types of somebody else that describe themselves: a pose in space, which the
// plane has no room for, and relations of it.
#include <ceres/autodiff_cost_function.h>
#include <ceres/manifold.h>
#include <ceres/product_manifold.h>
#include <ceres/sized_cost_function.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/add_types.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/session.h>
#include <plumbline/factors/blocks.h>

#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Position and quaternion (w, x, y, z).
struct SpacePoseBlock : DescribedBlock {
  static constexpr char kName[] = "space_pose";
  static constexpr char kG2oTag[] = "MINE_SPACE_POSE";
  static constexpr char kDescription[] = "Pose in space";
  static constexpr Quantity kParameters[] = {
      Quantity::Length("x"),  Quantity::Length("y"),  Quantity::Length("z"),
      Quantity::Number("qw"), Quantity::Number("qx"), Quantity::Number("qy"),
      Quantity::Number("qz")};
  using Manifold = ceres::ProductManifold<ceres::EuclideanManifold<3>,
                                          ceres::QuaternionManifold>;
};

// A horizontal plane at the height h above its anchor.
struct FloorBlock : DescribedBlock {
  static constexpr char kName[] = "floor";
  static constexpr char kG2oTag[] = "MINE_FLOOR";
  static constexpr char kDescription[] = "Floor: height above its anchor";
  static constexpr Quantity kParameters[] = {Quantity::Length("h")};
  static constexpr int kAnchorSize = 3;
};

// How high a pose is above a floor.
class HeightAboveFloor {
 public:
  static constexpr char kName[] = "height_above_floor";
  static constexpr char kG2oTag[] = "MINE_HEIGHT_ABOVE_FLOOR";
  static constexpr char kDescription[] = "z - h - anchor - u; m";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {
      Quantity::Length("height", "height tolerance")};
  using Blocks = BlockList<SpacePoseBlock, FloorBlock>;

  HeightAboveFloor(double expected, const Eigen::Vector3d& anchor,
                   double sqrt_information)
      : expected_(expected),
        anchor_(anchor),
        sqrt_information_(sqrt_information) {}

  template <typename T>
  bool operator()(const T* pose, const T* floor, T* residual) const {
    residual[0] =
        sqrt_information_ * (pose[2] - floor[0] - anchor_[2] - expected_);
    return true;
  }

  static void PlaceSecond(const double* expected, const double* pose,
                          const double* anchor, double* floor) {
    floor[0] = pose[2] - anchor[2] - expected[0];
  }

 private:
  double expected_;
  Eigen::Vector3d anchor_;
  double sqrt_information_;
};

// The same between a floor and itself as it should be, with derivatives by
// hand.
class FloorPrior : public ceres::SizedCostFunction<1, 1> {
 public:
  static constexpr char kName[] = "floor_prior";
  static constexpr char kG2oTag[] = "MINE_FLOOR_PRIOR";
  static constexpr char kDescription[] = "h - u; m";
  static constexpr RelationRole kRole = RelationRole::kOther;
  static constexpr Quantity kRows[] = {Quantity::Length("height")};
  using Blocks = BlockList<FloorBlock>;

  FloorPrior(double expected, double sqrt_information)
      : expected_(expected), sqrt_information_(sqrt_information) {}

  bool Evaluate(const double* const* blocks, double* residual,
                double** jacobians) const override {
    residual[0] = sqrt_information_ * (blocks[0][0] - expected_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = sqrt_information_;
    }
    return true;
  }

 private:
  double expected_;
  double sqrt_information_;
};

class AddTypesTest : public ::testing::Test {
 protected:
  AddTypesTest() {
    RegisterBuiltinRelations(&registry_);
    AddFeature<SpacePoseBlock>(&registry_);
    AddFeature<FloorBlock>(&registry_);
    AddRelation<HeightAboveFloor>(&registry_);
    AddRelation<FloorPrior>(&registry_);
  }

  // A fixed pose at a height of 3 m that says that it is 2 m above a floor with
  // the anchor (5, 6, 0.5), so that h is 0.5 m.
  void MakeGraph(Graph* graph) const {
    Transaction transaction;
    Feature pose;
    pose.type = &registry_.GetFeature("space_pose");
    pose.parameters = {1.0, 2.0, 3.0, 1.0};
    pose.fixed = true;
    Feature floor;
    floor.type = &registry_.GetFeature("floor");
    floor.anchor = {5.0, 6.0, 0.5};
    Constraint height;
    height.type = &registry_.GetRelation("height_above_floor");
    height.features = {transaction.AddFeature(pose),
                       transaction.AddFeature(floor)};
    height.expected = Eigen::VectorXd::Constant(1, 2.0);
    height.information = Eigen::MatrixXd::Constant(1, 1, 4.0);
    transaction.AddConstraint(height);
    graph->Apply(std::move(transaction));
  }

  Registry registry_;
};

TEST_F(AddTypesTest, TypesSayWhatTheirStructsSay) {
  const FeatureType& pose = registry_.GetFeature("space_pose");
  EXPECT_EQ(pose.size, 7);
  EXPECT_EQ(pose.parameters[6].name, "qz");
  EXPECT_TRUE(pose.Is(FeatureRole::kOther));
  EXPECT_FALSE(pose.HasPosition());
  EXPECT_EQ(pose.frame, nullptr);
  EXPECT_EQ(pose.make_manifold()->TangentSize(), 6);
  const RelationType& height = registry_.GetRelation("height_above_floor");
  EXPECT_EQ(height.residual_size, 1);
  EXPECT_EQ(height.rows[0].tolerance, "height tolerance");
  EXPECT_THAT(height.feature_types,
              ElementsAre(ElementsAre("space_pose"), ElementsAre("floor")));
  // What is there is not replaced.
  EXPECT_THROW(AddRelation<FloorPrior>(&registry_), Error);
  EXPECT_THROW(AddFeature<FloorBlock>(&registry_), Error);
}

TEST_F(AddTypesTest, SolvesAndPlaces) {
  Graph graph;
  MakeGraph(&graph);
  EXPECT_NEAR(ErrorOf(graph, graph.GetConstraint(0))[0], 0.5, 1e-12);
  {
    SolverSession session(&graph, registry_, {});
    EXPECT_TRUE(session.SolveGlobal().usable);
  }
  EXPECT_NEAR(graph.GetFeature(1).parameters[0], 0.5, 1e-9);

  Graph placed;
  MakeGraph(&placed);
  InitialGuessOptions options;
  options.method = InitialGuessMethod::kSpanningTree;
  EXPECT_EQ(MakeInitialGuess(options, &placed).landmarks, 1);
  EXPECT_NEAR(placed.GetFeature(1).parameters[0], 0.5, 1e-12);
}

TEST_F(AddTypesTest, DerivativesByHand) {
  Graph graph;
  MakeGraph(&graph);
  Constraint prior;
  prior.type = &registry_.GetRelation("floor_prior");
  prior.features = {1};
  prior.expected = Eigen::VectorXd::Constant(1, -2.0);
  prior.information = Eigen::MatrixXd::Constant(1, 1, 9.0);
  Transaction transaction;
  transaction.AddConstraint(prior);
  const ConstraintId id = graph.Apply(std::move(transaction)).constraints[0];
  const Constraint& added = graph.GetConstraint(id);
  const LinearizedConstraint linearized =
      Linearize(graph, added,
                *MakeCost(added, Eigen::MatrixXd::Constant(1, 1, 3.0),
                          FeaturesOf(graph, added)));
  EXPECT_NEAR(linearized.residual[0], 6.0, 1e-12);
  EXPECT_NEAR(linearized.jacobians[0](0, 0), 3.0, 1e-12);
}

TEST_F(AddTypesTest, FilesKeepThreeCoordinatesOfAnAnchor) {
  Graph graph;
  MakeGraph(&graph);
  std::ostringstream json;
  WriteGraphJson(graph, json);
  EXPECT_THAT(json.str(), HasSubstr("\"anchor\": [5, 6, 0.5]"));
  std::istringstream json_input(json.str());
  Graph from_json;
  ReadGraphJson(json_input, "map.json", registry_, &from_json);
  EXPECT_EQ(from_json.GetFeature(1).anchor, graph.GetFeature(1).anchor);
  EXPECT_EQ(from_json.GetFeature(0).parameters, graph.GetFeature(0).parameters);

  std::ostringstream text;
  WriteG2o(graph, nullptr, text);
  EXPECT_THAT(text.str(), HasSubstr("PLUMBLINE_FEATURE 1 0 0 5 6 0.5 0 0 0 "));
  std::istringstream text_input(text.str());
  Graph from_text;
  ReadG2o(text_input, "graph.g2o", registry_, &from_text);
  EXPECT_EQ(from_text.GetFeature(1).anchor, graph.GetFeature(1).anchor);

  const auto refusal = [&](const std::string& line) {
    std::istringstream input(line);
    Graph refused;
    try {
      ReadG2o(input, "graph.g2o", registry_, &refused);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(refusal("MINE_FLOOR 1 0\nPLUMBLINE_FEATURE 1 0 0 5 6 0 0 0 -\n"),
              HasSubstr("graph.g2o:2: PLUMBLINE_FEATURE has an anchor of 2 "
                        "coordinates: expected 3 for a floor"));
  EXPECT_THAT(
      refusal("VERTEX_XY 1 0 0\nPLUMBLINE_FEATURE 1 0 0 5 6 7 0 0 0 -\n"),
      HasSubstr("expected 2 for a point"));
}

// Blocks of a size that no kind of the relation has.
TEST_F(AddTypesTest, RefusesBlocksThatDoNotFit) {
  Graph graph;
  MakeGraph(&graph);
  RelationArguments arguments;
  arguments.expected = Eigen::VectorXd::Zero(1);
  arguments.sqrt_information = Eigen::MatrixXd::Identity(1, 1);
  arguments.features = {&graph.GetFeature(1), &graph.GetFeature(1)};
  const auto message = [&](const std::string& relation) {
    try {
      registry_.GetRelation(relation).make_cost(arguments);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message("height_above_floor"),
              HasSubstr("feature 1 of height_above_floor has 1 parameters"));
  EXPECT_THAT(message("pose_pose"),
              HasSubstr("arguments do not fit pose_pose: expected 2 features "
                        "and 3 rows"));
}

}  // namespace
}  // namespace plumbline
