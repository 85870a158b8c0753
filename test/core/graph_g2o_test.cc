#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>

#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

class GraphG2oTest : public ::testing::Test {
 protected:
  GraphG2oTest() { RegisterBuiltinRelations(&registry_); }

  G2oFile Read(const std::string& text, Graph* graph) const {
    std::istringstream input(text);
    return ReadG2o(input, "map.g2o", registry_, graph);
  }

  static std::string Write(const Graph& graph, const G2oFile* file) {
    std::ostringstream output;
    WriteG2o(graph, file, output);
    return output.str();
  }

  // What is written after reading.
  std::string RoundTrip(const std::string& text) const {
    Graph graph;
    const G2oFile file = Read(text, &graph);
    return Write(graph, &file);
  }

  // The message with which `text` is refused.
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

  Registry registry_;
};

TEST_F(GraphG2oTest, ReadsStandardTags) {
  Graph graph;
  const G2oFile file = Read(
      "VERTEX_SE2 10 1 2 0.5\n"
      "VERTEX_XY 7 -3.25 +4e-1\n"
      "FIX 10\n"
      "VERTEX_SE2 11 2 2 -0.5\r\n"
      "\n"
      "  EDGE_SE2\t10 11  1 0.25 -1   4 1 0.5 3 0.25 2\n",
      &graph);
  ASSERT_EQ(graph.num_features(), 3u);
  EXPECT_EQ(file.file_ids, (std::vector<std::int64_t>{10, 7, 11}));
  EXPECT_TRUE(file.unknown_lines.empty());
  const Feature& pose = graph.GetFeature(0);
  EXPECT_EQ(pose.type->name, "pose");
  EXPECT_TRUE(pose.fixed);
  EXPECT_FALSE(pose.is_virtual);
  EXPECT_EQ(pose.level, 0);
  EXPECT_EQ(pose.source, "g2o");
  EXPECT_EQ(pose.parameters[2], 0.5);
  const Feature& point = graph.GetFeature(1);
  EXPECT_EQ(point.type->name, "point");
  EXPECT_FALSE(point.fixed);
  EXPECT_EQ(point.parameters[0], -3.25);
  EXPECT_EQ(point.parameters[1], 0.4);
  ASSERT_EQ(graph.num_constraints(), 1u);
  const Constraint& edge = graph.GetConstraint(0);
  EXPECT_EQ(edge.type->name, "pose_pose");
  EXPECT_EQ(edge.features, (std::vector<FeatureId>{0, 2}));
  EXPECT_EQ(edge.expected, Eigen::Vector3d(1.0, 0.25, -1.0));
  Eigen::Matrix3d information;
  information << 4, 1, 0.5, 1, 3, 0.25, 0.5, 0.25, 2;
  EXPECT_EQ(edge.information, information);
  EXPECT_EQ(edge.kind, ConstraintClass::kMeasurement);
  EXPECT_EQ(edge.state, ConstraintState::kLive);
  EXPECT_EQ(edge.delta, 1.0);
}

TEST_F(GraphG2oTest, WritesWhatItReads) {
  const std::string text =
      "VERTEX_SE2 10 1 2 0.5\n"
      "FIX 10\n"
      "VERTEX_XY 7 -3.25 0.4\n"
      "VERTEX_SE2 11 2 2 -0.5\n"
      "EDGE_SE2 10 11 1 0.25 -1 4 1 0.5 3 0.25 2\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 7 11 0.1 100\n";
  EXPECT_EQ(RoundTrip(text), text);
}

TEST_F(GraphG2oTest, EdgesMayComeFirst) {
  Graph graph;
  Read(
      "FIX 1 2\n"
      "EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"
      "VERTEX_SE2 2 0 0 0\n"
      "VERTEX_SE2 1 0 0 0\n",
      &graph);
  EXPECT_EQ(graph.GetConstraint(0).features, (std::vector<FeatureId>{1, 0}));
  EXPECT_TRUE(graph.GetFeature(0).fixed);
  EXPECT_TRUE(graph.GetFeature(1).fixed);
}

TEST_F(GraphG2oTest, EverythingComesBack) {
  Graph graph;
  Transaction transaction;
  Feature segment = MakeFeature("segment", {0.1, 1.0 / 3.0, 1e-300});
  segment.extent_begin = -1.25;
  segment.extent_end = 2.0 / 7.0;
  segment.observations = 12;
  segment.source = "front end %1\n";
  segment.fixed = true;
  const FeatureId a = transaction.AddFeature(segment);
  Feature line = MakeFeature("line", {123456.789, -0.0});
  line.anchor = {1e7, -1e-7};
  line.level = 1;
  line.is_virtual = true;
  line.source = "-";
  const FeatureId b = transaction.AddFeature(line);
  transaction.AddFeature(MakeFeature("circle", {1, 2, 3}));
  Feature orientation = MakeFeature("orientation", {M_PI});
  orientation.level = 2;
  orientation.is_virtual = true;
  orientation.source = "orientation_mixture";
  const FeatureId c = transaction.AddFeature(orientation);
  Constraint tie;
  tie.type = &registry_.GetRelation("segment_orientation");
  tie.features = {a, c};
  tie.expected = Eigen::VectorXd::Zero(1);
  tie.information = Eigen::MatrixXd::Constant(1, 1, 1.0 / 3.0);
  tie.kind = ConstraintClass::kStructure;
  tie.delta = 0.3;
  tie.source = "orientation_mixture";
  transaction.AddConstraint(tie);
  tie.type = &registry_.GetRelation("line_orientation");
  tie.features = {b, c};
  tie.state = ConstraintState::kBroken;
  tie.delta = 1e-12;
  transaction.AddConstraint(tie);
  graph.Apply(transaction);

  const std::string text = Write(graph, nullptr);
  Graph copy;
  const G2oFile file = Read(text, &copy);
  EXPECT_TRUE(file.unknown_lines.empty());
  EXPECT_EQ(Write(copy, &file), text);
  EXPECT_EQ(Write(copy, nullptr), text);

  ASSERT_EQ(copy.num_features(), 4u);
  for (FeatureId id = 0; id < 4; ++id) {
    const Feature& expected = graph.GetFeature(id);
    const Feature& feature = copy.GetFeature(id);
    EXPECT_EQ(feature.type, expected.type);
    EXPECT_EQ(feature.parameters, expected.parameters);
    EXPECT_EQ(feature.anchor, expected.anchor);
    EXPECT_EQ(feature.level, expected.level);
    EXPECT_EQ(feature.is_virtual, expected.is_virtual);
    EXPECT_EQ(feature.fixed, expected.fixed);
    EXPECT_EQ(feature.extent_begin, expected.extent_begin);
    EXPECT_EQ(feature.extent_end, expected.extent_end);
    EXPECT_EQ(feature.observations, expected.observations);
    EXPECT_EQ(feature.source, expected.source);
  }
  EXPECT_TRUE(std::signbit(copy.GetFeature(1).parameters[1]));
  EXPECT_EQ(copy.VirtualFeatures(1), (std::vector<FeatureId>{1}));
  ASSERT_EQ(copy.num_constraints(), 2u);
  for (ConstraintId id = 0; id < 2; ++id) {
    const Constraint& expected = graph.GetConstraint(id);
    const Constraint& constraint = copy.GetConstraint(id);
    EXPECT_EQ(constraint.type, expected.type);
    EXPECT_EQ(constraint.features, expected.features);
    EXPECT_EQ(constraint.expected, expected.expected);
    EXPECT_EQ(constraint.information, expected.information);
    EXPECT_EQ(constraint.kind, expected.kind);
    EXPECT_EQ(constraint.state, expected.state);
    EXPECT_EQ(constraint.delta, expected.delta);
    EXPECT_EQ(constraint.source, expected.source);
  }
  EXPECT_NE(text.find("PLUMBLINE_FEATURE 0 0 0 0 0 -1.25 0.2857142857142857 12 "
                      "front%20end%20%251%0A\n"),
            std::string::npos);
  EXPECT_NE(text.find("PLUMBLINE_CONSTRAINT structure broken 1e-12 "
                      "orientation_mixture\n"),
            std::string::npos);
}

// Built in code, a feature has no source.
TEST_F(GraphG2oTest, EmptySource) {
  Graph graph;
  Transaction transaction;
  transaction.AddFeature(MakeFeature("point", {1.0, 2.0}));
  graph.Apply(transaction);
  const std::string text = Write(graph, nullptr);
  EXPECT_EQ(text, "VERTEX_XY 0 1 2\nPLUMBLINE_FEATURE 0 0 0 0 0 0 0 0 -\n");
  EXPECT_EQ(RoundTrip(text), text);
}

TEST_F(GraphG2oTest, IdsAfterRemovalAndAddition) {
  Graph graph;
  const G2oFile file = Read(
      "VERTEX_XY 5 0 0\nVERTEX_XY 100 1 1\nVERTEX_XY 6 2 2\n"
      "VERTEX_MYSTERY 500 1 2 3\n",
      &graph);
  Transaction transaction;
  transaction.RemoveFeature(1);
  Feature point = MakeFeature("point", {3.0, 3.0});
  point.source = "g2o";
  transaction.AddFeature(point);
  graph.Apply(transaction);
  EXPECT_EQ(Write(graph, &file),
            "VERTEX_XY 5 0 0\nVERTEX_XY 6 2 2\nVERTEX_MYSTERY 500 1 2 3\n"
            "VERTEX_XY 501 3 3\n");
  EXPECT_EQ(Write(graph, nullptr),
            "VERTEX_XY 0 0 0\nVERTEX_XY 1 2 2\nVERTEX_XY 2 3 3\n");
}

TEST_F(GraphG2oTest, UnknownLinesAreKept) {
  const std::string text =
      "# made by hand\n"
      "PARAMS_SE2OFFSET 0 0 0 0\n"
      "VERTEX_SE2 0 0 0 0\n"
      "ROBOTLASER1 0  -1.5   3.1 # odd   blanks\t\n"
      "VERTEX_SE2 1 1 0 0\n"
      "VERTEX_MYSTERY 2 1 2\n"
      "PLUMBLINE_FEATURE 2 0 0 0 0 0 0 3 somebody\n"
      "EDGE_MYSTERY 0 1 2 3\n"
      "PLUMBLINE_CONSTRAINT structure live 1 somebody\n"
      "# before the edges\n"
      "FIX 2\n"
      "EDGE_SE2 0 2 1 0 0 1 0 0 1 0 1\n"
      "PLUMBLINE_CONSTRAINT structure live 0.5 somebody\n"
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
  Graph graph;
  const G2oFile file = Read(text, &graph);
  EXPECT_EQ(graph.num_features(), 2u);
  EXPECT_EQ(graph.num_constraints(), 1u);
  EXPECT_EQ(file.unknown_tags,
            (std::map<std::string, int>{{"EDGE_MYSTERY", 1},
                                        {"PARAMS_SE2OFFSET", 1},
                                        {"ROBOTLASER1", 1},
                                        {"VERTEX_MYSTERY", 1}}));
  const std::string written = Write(graph, &file);
  EXPECT_EQ(written.substr(0, written.find("VERTEX_MYSTERY")),
            text.substr(0, text.find("VERTEX_MYSTERY")));
  // All lines, each once, and the same bytes from then on.
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_NE(written.find(line + "\n"), std::string::npos) << line;
  }
  EXPECT_EQ(written.size(), text.size());
  EXPECT_EQ(RoundTrip(written), written);
}

TEST_F(GraphG2oTest, EmptyInput) {
  EXPECT_EQ(RoundTrip(""), "");
  EXPECT_EQ(RoundTrip("\n  \n"), "");
  EXPECT_EQ(Write(Graph(), nullptr), "");
}

TEST_F(GraphG2oTest, NeedsAnEmptyGraph) {
  Graph graph;
  Read("VERTEX_XY 0 0 0\n", &graph);
  std::istringstream input("VERTEX_XY 0 0 0\n");
  EXPECT_THROW(ReadG2o(input, "map.g2o", registry_, &graph), Error);
  EXPECT_EQ(graph.num_features(), 1u);
}

// A graph that was emptied hands out later ids.
TEST_F(GraphG2oTest, EmptiedGraph) {
  const std::string text =
      "# first\nVERTEX_XY 4 0 0\n# second\nVERTEX_XY 3 0 1\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 4 3 1 1\n";
  Graph graph;
  Read("VERTEX_XY 0 0 0\n", &graph);
  Transaction transaction;
  transaction.RemoveFeature(0);
  graph.Apply(transaction);
  const G2oFile file = Read(text, &graph);
  EXPECT_EQ(file.file_ids, (std::vector<std::int64_t>{kNoId, 4, 3}));
  EXPECT_EQ(Write(graph, &file), text);
}

// Each broken line stands third, after two sound ones.
TEST_F(GraphG2oTest, BrokenLinesAreNamed) {
  const std::string head = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n";
  const std::string tail = "VERTEX_XY 9 0 0\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"VERTEX_SE2 2 0 0", "VERTEX_SE2 has 3 fields: expected 4"},
      {"VERTEX_SE2 2 0 0 0 0", "VERTEX_SE2 has 5 fields: expected 4"},
      {"VERTEX_SE2", "VERTEX_SE2 has 0 fields: expected 4"},
      {"VERTEX_SE2 2 0 nan 0", "\"nan\": expected a finite number"},
      {"VERTEX_SE2 2 0 -inf 0", "\"-inf\": expected a finite number"},
      {"VERTEX_SE2 2 0 1e999 0", "\"1e999\": expected a finite number"},
      {"VERTEX_SE2 2 0 1,5 0", "\"1,5\": expected a finite number"},
      {"VERTEX_SE2 2 0 +-1 0", "\"+-1\": expected a finite number"},
      {"VERTEX_SE2 2.5 0 0 0", "id is \"2.5\": expected a whole number"},
      {"VERTEX_SE2 -1 0 0 0", "id is \"-1\": expected a whole number"},
      {"VERTEX_SE2 99999999999999999999 0 0 0", "expected a whole number"},
      {"VERTEX_XY 1 0 0", "id 1 is taken: expected each vertex once"},
      {"FIX", "FIX without an id"},
      {"FIX 3", "no vertex 3: expected the id of a vertex"},
      {"FIX x", "id is \"x\""},
      {"EDGE_SE2 0 1 1 0 0 1 0 0 1 0", "EDGE_SE2 has 10 fields: expected 11"},
      {"EDGE_SE2 0 3 1 0 0 1 0 0 1 0 1", "no vertex 3"},
      {"EDGE_SE2 0 1 1 0 nan 1 0 0 1 0 1", "\"nan\": expected"},
      {"EDGE_SE2 0 0 1 0 0 1 0 0 1 0 1", "pose_pose from a feature to itself"},
      {"EDGE_SE2 0 9 1 0 0 1 0 0 1 0 1",
       "feature 2 of pose_pose is of type point: expected pose or segment"},
      {"EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1",
       "information of pose_pose is not valid"},
      {"EDGE_SE2 0 1 1 0 0 -1 0 0 1 0 1",
       "information of pose_pose is not valid"},
      {"PLUMBLINE_FEATURE 1 0 0 0 0 0 0 0",
       "PLUMBLINE_FEATURE has 8 fields: expected 9"},
      {"PLUMBLINE_FEATURE 3 0 0 0 0 0 0 0 a", "no vertex 3"},
      {"PLUMBLINE_FEATURE 1 -1 0 0 0 0 0 0 a", "level is \"-1\""},
      {"PLUMBLINE_FEATURE 1 0 2 0 0 0 0 0 a", "virtual is \"2\""},
      {"PLUMBLINE_FEATURE 1 0 0 0 nan 0 0 0 a", "\"nan\""},
      {"PLUMBLINE_FEATURE 1 0 0 0 0 0 0 1.5 a", "observations is \"1.5\""},
      {"PLUMBLINE_FEATURE 1 0 0 0 0 0 0 0 a%2", "source \"a%2\""},
      {"PLUMBLINE_FEATURE 1 0 0 0 0 0 0 0 %-1", "source \"%-1\""},
      {"PLUMBLINE_CONSTRAINT structure live 1 a",
       "PLUMBLINE_CONSTRAINT without an edge"},
  };
  for (const auto& [line, message] : cases) {
    const std::string refusal = Refusal(head + line + "\n" + tail);
    EXPECT_EQ(refusal.rfind("map.g2o:3: ", 0), 0u) << line << "\n" << refusal;
    EXPECT_NE(refusal.find(message), std::string::npos) << line << "\n"
                                                        << refusal;
  }
  EXPECT_EQ(Refusal(head + tail), "nothing was refused");
}

TEST_F(GraphG2oTest, BrokenConstraintLinesAreNamed) {
  const std::string head =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"structure live 1", "has 3 fields: expected 4"},
      {"guess live 1 a", "class \"guess\": expected measurement or structure"},
      {"structure dead 1 a", "state \"dead\": expected live or broken"},
      {"structure live 1.5 a", "delta 1.5: expected a number in [0, 1]"},
      {"structure live nan a", "\"nan\": expected a finite number"},
      {"structure live 1 %G0", "source \"%G0\""},
  };
  for (const auto& [fields, message] : cases) {
    const std::string refusal =
        Refusal(head + "PLUMBLINE_CONSTRAINT " + fields + "\n");
    EXPECT_EQ(refusal.rfind("map.g2o:4: ", 0), 0u) << refusal;
    EXPECT_NE(refusal.find(message), std::string::npos) << refusal;
  }
  // Each belongs to one edge, and follows it.
  const std::string own = "PLUMBLINE_CONSTRAINT structure live 1 a\n";
  EXPECT_EQ(Refusal(head + own), "nothing was refused");
  EXPECT_EQ(Refusal(head + own + own).rfind("map.g2o:5: ", 0), 0u);
  EXPECT_EQ(Refusal(head + "VERTEX_XY 3 0 0\n" + own).rfind("map.g2o:5: ", 0),
            0u);
  const std::string twice = "PLUMBLINE_FEATURE 1 0 0 0 0 0 0 0 a\n";
  EXPECT_EQ(Refusal(head + twice + twice).rfind("map.g2o:5: ", 0), 0u);
}

TEST_F(GraphG2oTest, SemidefiniteInformationIsFine) {
  Graph graph;
  Read(
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
      "EDGE_SE2 0 1 1 0 0 0 0 0 1 0 1\n"
      "EDGE_SE2 0 1 1 0 0 1 1 0 1 0 0\n",
      &graph);
  EXPECT_EQ(graph.num_constraints(), 2u);
}

}  // namespace
}  // namespace plumbline
