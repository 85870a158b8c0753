#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class GraphJsonTest : public ::testing::Test {
 protected:
  GraphJsonTest() { RegisterBuiltinRelations(&registry_); }

  void Read(const std::string& text, Graph* graph) const {
    std::istringstream input(text);
    ReadGraphJson(input, "map.json", registry_, graph);
  }

  static std::string Write(const Graph& graph) {
    std::ostringstream output;
    WriteGraphJson(graph, output);
    return output.str();
  }

  std::string Refusal(const std::string& text) const {
    Graph graph;
    try {
      Read(text, &graph);
    } catch (const Error& error) {
      EXPECT_EQ(graph.num_features(), 0u);
      EXPECT_EQ(graph.num_constraints(), 0u);
      return error.what();
    }
    return "nothing was refused";
  }

  Feature MakeFeature(const std::string& type,
                      const std::vector<double>& parameters) const {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    return feature;
  }

  // Two segments on one orientation, tied by a live and a broken constraint,
  // and related by a measurement.
  void Fill(Graph* graph) const {
    Transaction transaction;
    Feature segment = MakeFeature("segment", {0.1, -2.5, 1.0 / 3.0});
    segment.extent_begin = -1.0;
    segment.extent_end = 2.5;
    segment.observations = 7;
    segment.source = "front \"end\"";
    segment.fixed = true;
    segment.anchor = {1e6, -0.5};
    const FeatureId a = transaction.AddFeature(segment);
    const FeatureId b =
        transaction.AddFeature(MakeFeature("segment", {1.0, 2.0, 3.0}));
    Feature orientation = MakeFeature("orientation", {0.25});
    orientation.level = 1;
    orientation.is_virtual = true;
    const FeatureId c = transaction.AddFeature(orientation);
    Constraint relative;
    relative.type = &registry_.GetRelation("pose_pose");
    relative.features = {a, b};
    relative.expected = Eigen::Vector3d(1.0, 0.5, -1e-9);
    relative.information.resize(3, 3);
    relative.information << 4, 1, 0, 1, 2, 0, 0, 0, 0;
    transaction.AddConstraint(relative);
    Constraint tie;
    tie.type = &registry_.GetRelation("segment_orientation");
    tie.features = {a, c};
    tie.expected = Eigen::VectorXd::Zero(1);
    tie.information = Eigen::MatrixXd::Constant(1, 1, 100.0);
    tie.kind = ConstraintClass::kStructure;
    tie.delta = 0.75;
    tie.source = "orientation_mixture";
    transaction.AddConstraint(tie);
    tie.features = {b, c};
    tie.state = ConstraintState::kBroken;
    tie.delta = 0.1;
    tie.break_below = 0.0625;
    transaction.AddConstraint(tie);
    graph->Apply(std::move(transaction));
  }

  Registry registry_;
};

TEST_F(GraphJsonTest, Format) {
  Graph graph;
  Fill(&graph);
  EXPECT_EQ(
      Write(graph),
      "{\n\"features\": [\n"
      "{\"id\": 0, \"type\": \"segment\", \"level\": 0, \"virtual\": false, "
      "\"fixed\": true, \"parameters\": [0.1, -2.5, 0.3333333333333333], "
      "\"anchor\": [1e+06, -0.5], \"extent\": [-1, 2.5], \"observations\": 7, "
      "\"source\": \"front \\\"end\\\"\", \"support\": []},\n"
      "{\"id\": 1, \"type\": \"segment\", \"level\": 0, \"virtual\": false, "
      "\"fixed\": false, \"parameters\": [1, 2, 3], \"anchor\": [0, 0], "
      "\"extent\": [0, 0], \"observations\": 0, \"source\": \"\", "
      "\"support\": []},\n"
      "{\"id\": 2, \"type\": \"orientation\", \"level\": 1, \"virtual\": true, "
      "\"fixed\": false, \"parameters\": [0.25], \"anchor\": [0, 0], "
      "\"extent\": [0, 0], \"observations\": 0, \"source\": \"\", "
      "\"support\": [1]}\n"
      "],\n\"constraints\": [\n"
      "{\"id\": 0, \"type\": \"pose_pose\", \"features\": [0, 1], "
      "\"expected\": [1, 0.5, -1e-09], "
      "\"information\": [[4, 1, 0], [1, 2, 0], [0, 0, 0]], "
      "\"class\": \"measurement\", \"delta\": 1, \"state\": \"live\", "
      "\"source\": \"\"},\n"
      "{\"id\": 1, \"type\": \"segment_orientation\", \"features\": [0, 2], "
      "\"expected\": [0], \"information\": [[100]], "
      "\"class\": \"structure\", \"delta\": 0.75, \"state\": \"live\", "
      "\"source\": \"orientation_mixture\"},\n"
      "{\"id\": 2, \"type\": \"segment_orientation\", \"features\": [1, 2], "
      "\"expected\": [0], \"information\": [[100]], "
      "\"class\": \"structure\", \"delta\": 0.1, \"state\": \"broken\", "
      "\"source\": \"orientation_mixture\", \"break_below\": 0.0625}\n"
      "]\n}\n");
}

TEST_F(GraphJsonTest, RoundTrip) {
  Graph graph, copy;
  Fill(&graph);
  const std::string text = Write(graph);
  Read(text, &copy);
  EXPECT_EQ(Write(copy), text);
  EXPECT_EQ(copy.VirtualFeatures(1), (std::vector<FeatureId>{2}));
  EXPECT_EQ(copy.GetConstraint(2).state, ConstraintState::kBroken);
}

TEST_F(GraphJsonTest, NumbersComeBackAsTheSameDoubles) {
  Graph graph, copy;
  Transaction transaction;
  const std::vector<double> numbers = {M_PI,      1e-310,
                                       -0.0,      1.7976931348623157e308,
                                       0.1 + 0.2, 4503599627370497.5};
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
    transaction.AddFeature(MakeFeature("point", {numbers[i], numbers[i + 1]}));
  }
  graph.Apply(std::move(transaction));
  Read(Write(graph), &copy);
  for (FeatureId id = 0; id < 3; ++id) {
    EXPECT_EQ(copy.GetFeature(id).parameters, graph.GetFeature(id).parameters);
  }
  EXPECT_TRUE(std::signbit(copy.GetFeature(1).parameters[0]));
}

TEST_F(GraphJsonTest, IdsAreMadeDense) {
  Graph graph, copy;
  Fill(&graph);
  Transaction transaction;
  transaction.RemoveConstraint(0);
  transaction.RemoveConstraint(1);
  transaction.RemoveFeature(0);
  graph.Apply(std::move(transaction));
  Read(Write(graph), &copy);
  ASSERT_EQ(copy.num_features(), 2u);
  EXPECT_EQ(copy.GetFeature(0).type->name, "segment");
  EXPECT_EQ(copy.GetFeature(1).type->name, "orientation");
  ASSERT_EQ(copy.num_constraints(), 1u);
  EXPECT_EQ(copy.GetConstraint(0).features, (std::vector<FeatureId>{0, 1}));
}

TEST_F(GraphJsonTest, EmptyGraph) {
  Graph copy;
  EXPECT_EQ(Write(Graph()),
            "{\n\"features\": [\n],\n\"constraints\": [\n]\n}\n");
  Read(Write(Graph()), &copy);
  EXPECT_EQ(copy.num_features(), 0u);
}

TEST_F(GraphJsonTest, BytesThatAreNotTextDoNotBreakTheFile) {
  Graph graph, copy;
  Transaction transaction;
  Feature point = MakeFeature("point", {1.0, 2.0});
  point.source = "a\xff\n";
  transaction.AddFeature(point);
  graph.Apply(std::move(transaction));
  Read(Write(graph), &copy);
  EXPECT_EQ(copy.GetFeature(0).source, "a\xef\xbf\xbd\n");
}

TEST_F(GraphJsonTest, NotJson) {
  EXPECT_EQ(Refusal("").rfind("map.json:1: not JSON", 0), 0u);
  EXPECT_EQ(Refusal("{\n\"features\": [\n{]}").rfind("map.json:3: ", 0), 0u)
      << Refusal("{\n\"features\": [\n{]}");
  EXPECT_NE(Refusal("[]").find("document is of type array"), std::string::npos);
  EXPECT_NE(Refusal("{}").find("document has no \"features\""),
            std::string::npos);
  EXPECT_NE(Refusal("{\"features\": 3}").find("features is 3"),
            std::string::npos);
  // Deep nesting does not run out of stack.
  EXPECT_EQ(Refusal(std::string(100000, '[')).rfind("map.json:1: ", 0), 0u);
}

// Each case replaces a piece of a sound map by a broken one.
TEST_F(GraphJsonTest, BrokenPlacesAreNamed) {
  Graph graph;
  Fill(&graph);
  const std::string sound = Write(graph);
  struct Case {
    std::string piece, broken, message;
  };
  const std::vector<Case> cases = {
      {"\"id\": 1, \"type\": \"segment\"", "\"id\": 0, \"type\": \"segment\"",
       "features[1].id is 0, which is taken"},
      {"\"id\": 0,", "\"id\": -1,", "features[0].id is -1"},
      {"\"id\": 0,", "\"id\": 0.5,", "features[0].id is 0.5"},
      {"\"id\": 0,", "\"id\": 18446744073709551615,", "features[0].id is 1844"},
      {"\"id\": 0,", "", "features[0] has no \"id\""},
      {"\"orientation\"", "\"planet\"",
       "features[2].type is \"planet\": expected one of circle, "},
      {"\"orientation\"", "7", "features[2].type is 7: expected a string"},
      {"\"level\": 1", "\"level\": 3000000000", "features[2].level is 3000000"},
      {"\"level\": 1", "\"level\": 2147483647",
       "features[2].level is 2147483647: expected a whole number from 0 to "
       "1000"},
      {"\"virtual\": true", "\"virtual\": 1",
       "features[2].virtual is 1: expected true or false"},
      {"\"parameters\": [1, 2, 3]", "\"parameters\": [1, 2]",
       "features[1].parameters has 2 elements: expected 3"},
      {"\"parameters\": [1, 2, 3]", "\"parameters\": [1, null, 3]",
       "features[1].parameters[1] is of type null: expected a finite number"},
      {"\"anchor\": [1e+06, -0.5]", "\"anchor\": {}",
       "features[0].anchor is of type object: expected an array"},
      {"\"extent\": [-1, 2.5]", "\"extent\": [-1, \"2.5\"]",
       "features[0].extent[1] is of type string"},
      {"\"observations\": 7", "\"observations\": -7",
       "features[0].observations is -7"},
      {"\"pose_pose\"", "\"pose_planet\"",
       "constraints[0].type is \"pose_planet\""},
      {"\"features\": [0, 1]", "\"features\": [0, 5]",
       "constraints[0].features[1] is 5: expected the id of a feature"},
      {"\"features\": [0, 1]", "\"features\": [0]",
       "constraints[0].features has 1 elements: expected 2"},
      {"\"features\": [0, 1]", "\"features\": [0, 0]",
       "constraints[0] does not fit: pose_pose from a feature to itself"},
      {"\"features\": [0, 1]", "\"features\": [0, 2]",
       "constraints[0] does not fit: feature 2 of pose_pose is of type "
       "orientation"},
      {"\"expected\": [1, 0.5, -1e-09]", "\"expected\": [1, 0.5]",
       "constraints[0].expected has 2 elements: expected 3"},
      {"[4, 1, 0]", "[4, 1]",
       "constraints[0].information[0] has 2 elements: expected 3"},
      {"[4, 1, 0]", "[4, 2, 0]",
       "constraints[0] does not fit: information of pose_pose is not valid"},
      {"[4, 1, 0]", "[-4, 1, 0]",
       "constraints[0] does not fit: information of pose_pose is not valid"},
      {"\"class\": \"structure\"", "\"class\": \"guess\"",
       "constraints[1].class is \"guess\": expected structure or measurement"},
      {"\"state\": \"broken\"", "\"state\": \"dead\"",
       "constraints[2].state is \"dead\": expected broken or live"},
      {"\"delta\": 0.75", "\"delta\": 1.75",
       "constraints[1] does not fit: delta of segment_orientation"},
      {"\"delta\": 0.75", "\"delta\": 1e999", "map.json"},
      {"\"break_below\": 0.0625", "\"break_below\": 2",
       "constraints[2].break_below is no p-value"},
  };
  for (const Case& c : cases) {
    std::string text = sound;
    const std::size_t at = text.find(c.piece);
    ASSERT_NE(at, std::string::npos) << c.piece;
    text.replace(at, c.piece.size(), c.broken);
    const std::string refusal = Refusal(text);
    EXPECT_EQ(refusal.rfind("map.json: ", 0) == 0 || c.message == "map.json",
              true)
        << refusal;
    EXPECT_NE(refusal.find(c.message), std::string::npos) << c.broken << "\n"
                                                          << refusal;
  }
}

TEST_F(GraphJsonTest, NeedsAnEmptyGraph) {
  Graph graph;
  Fill(&graph);
  const std::string text = Write(graph);
  std::istringstream input(text);
  EXPECT_THROW(ReadGraphJson(input, "map.json", registry_, &graph), Error);
  EXPECT_EQ(graph.num_features(), 3u);
}

}  // namespace
}  // namespace plumbline
