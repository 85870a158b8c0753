#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>

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
  EXPECT_TRUE(file.unknown_tags.empty());
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

TEST_F(GraphG2oTest, LinesLiveAsLongAsACopyOfTheFile) {
  const std::string text =
      "VERTEX_SE2 10 1 2 0.5\n"
      "VERTEX_XY 7 -3.25 0.4\n"
      "# a comment that is too long to lie within a string\n"
      "VERTEX_SE2 11 2 2 -0.5";
  Graph graph;
  G2oFile copy;
  {
    const G2oFile file = ReadG2o(text, "map.g2o", registry_, &graph);
    copy = file;
  }
  EXPECT_EQ(Write(graph, &copy), text);
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

TEST_F(GraphG2oTest, EdgesAloneNameTheirVertices) {
  const std::string text =
      "\xEF\xBB\xBF"
      "EDGE_SE2 12 7 1 0 0 1 0 0 1 0 1\n"
      "FIX 7\n"
      "EDGE_SE2_XY 12 3 1 2 1 0 1\n"
      "EDGE2 7 9 1 0 0 1 0 1 1 0 0\n";
  Graph graph;
  const G2oFile file = Read(text, &graph);
  ASSERT_EQ(graph.num_features(), 4u);
  ASSERT_EQ(graph.num_constraints(), 3u);
  EXPECT_EQ(file.file_ids, (std::vector<std::int64_t>{3, 7, 9, 12}));
  EXPECT_EQ(file.named_by_edges, (std::vector<FeatureId>{0, 1, 2, 3}));
  EXPECT_EQ(graph.GetFeature(0).type->name, "point");
  for (const FeatureId pose : {1, 2, 3}) {
    EXPECT_EQ(graph.GetFeature(pose).type->name, "pose");
    EXPECT_EQ(graph.GetFeature(pose).fixed, pose == 1);
  }
  EXPECT_EQ(graph.GetConstraint(0).features, (std::vector<FeatureId>{3, 1}));
  // Written back as it was, and with all vertices once one has moved.
  EXPECT_EQ(Write(graph, &file), text.substr(3));
  graph.MutableFeatures()[3]->parameters = {1.0, 2.0, 0.5};
  EXPECT_EQ(Write(graph, &file),
            "VERTEX_XY 3 0 0\nVERTEX_SE2 7 0 0 0\nVERTEX_SE2 9 0 0 0\n"
            "VERTEX_SE2 12 1 2 0.5\n" +
                text.substr(3));
}

TEST_F(GraphG2oTest, EdgesAloneThatDoNotTellTheTypes) {
  const auto message = [&](const std::string& text) -> std::string {
    Graph graph;
    try {
      Read(text, &graph);
    } catch (const Error& error) {
      EXPECT_EQ(graph.num_features(), 0u);
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message("EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"
                    "EDGE_SE2_XY 1 2 1 2 1 0 1\n")
                .find(":2: vertex 2 is a point here and a pose above"),
            std::string::npos);
  EXPECT_NE(message("EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\nFIX 9\n").find(":2: "),
            std::string::npos);
  // Whatever bytes a field has, the message is whole.
  EXPECT_NE(message(std::string("VERTEX_SE2 1 0 0 \0\x1b[2J\n", 22))
                .find(":1: \"\xEF\xBF\xBD\xEF\xBF\xBD[2J\": expected a finite"),
            std::string::npos);
  // One vertex, and the others are missed.
  EXPECT_NE(message("VERTEX_SE2 1 0 0 0\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n")
                .find(":2: no vertex 2"),
            std::string::npos);
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
  tie.break_below = 0.0027;
  transaction.AddConstraint(tie);
  graph.Apply(transaction);

  const std::string text = Write(graph, nullptr);
  Graph copy;
  const G2oFile file = Read(text, &copy);
  EXPECT_TRUE(file.unknown_tags.empty());
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
    EXPECT_EQ(constraint.break_below, expected.break_below);
    EXPECT_EQ(constraint.source, expected.source);
  }
  EXPECT_NE(text.find("PLUMBLINE_FEATURE 0 0 0 0 0 -1.25 0.2857142857142857 12 "
                      "front%20end%20%251%0A\n"),
            std::string::npos);
  EXPECT_NE(text.find("PLUMBLINE_CONSTRAINT structure broken 1e-12 "
                      "orientation_mixture 0.0027\n"),
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
      "ROBOTSONAR1 0  -1.5   3.1 # odd   blanks\t\n"
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
                                        {"ROBOTSONAR1", 1},
                                        {"VERTEX_MYSTERY", 1}}));
  EXPECT_EQ(Write(graph, &file), text);
}

TEST_F(GraphG2oTest, AFileThatBreaksOffWithinATag) {
  const std::string text = "VERTEX_SE2 0 0 0 0\n";
  for (const std::string tag :
       {"P", "PLU", "VERTEX_SE", "EDGE_SE2_X", "FI", "PLUMBLINE_CONSTR"}) {
    Graph graph;
    const G2oFile file = Read(text + tag, &graph);
    EXPECT_EQ(file.cut_tag, tag);
    EXPECT_EQ(Write(graph, &file), text + tag);
  }
  for (const char* const end :
       {"", "PLU\n", "PLU 1", "QUX", "# PLU", "VERTEX_SE2 1 1 1 0"}) {
    Graph graph;
    EXPECT_EQ(Read(text + end, &graph).cut_tag, "") << end;
  }
}

// Edges alone, vertices alone, both: in three dimensions nothing is known.
TEST_F(GraphG2oTest, GraphsWithoutAKnownElementAreRefused) {
  const std::string vertices =
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n";
  const std::string edges =
      "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 "
      "0 1\n";
  EXPECT_EQ(Refusal("# a cube\n" + edges),
            "map.g2o:2: no vertex or edge of the file has a known tag; the "
            "first is EDGE_SE3:QUAT: expected a graph of the plane "
            "(VERTEX_SE2, EDGE_SE2 and others); graphs in three dimensions are "
            "not solved");
  EXPECT_THAT(Refusal(vertices), testing::HasSubstr("VERTEX_SE3:QUAT"));
  EXPECT_THAT(Refusal(vertices + edges), testing::HasSubstr("map.g2o:1: "));
  EXPECT_THAT(Refusal("VERTEX3 1 0 0 0 0 0 0\nEDGE3 1 2 1 0 0 0 0 0\n"),
              testing::HasSubstr("VERTEX3"));
  EXPECT_EQ(Refusal("VERTEX_SE2 7 0 0 0\n" + vertices), "nothing was refused");
}

TEST_F(GraphG2oTest, EmptyInput) {
  EXPECT_EQ(RoundTrip(""), "");
  EXPECT_EQ(RoundTrip("\n  \n"), "\n  \n");
  EXPECT_EQ(Write(Graph(), nullptr), "");
}

// Whatever the order of lines, the way of writing numbers, blanks and line
// ends: what is not changed comes back as it was.
TEST_F(GraphG2oTest, ForeignFilesComeBackByteForByte) {
  for (const std::string& text : std::vector<std::string>{
           // TORO, with its order of the entries of the information.
           "VERTEX2 0 0.000000 0.000000 0.000000\n"
           "VERTEX2 1 1.000000 0.000000 0.500000\n"
           "EDGE2 0 1 1.000000 0.000000 0.500000 4.0 1.0 3.0 2.0 0.5 0.25\n",
           // Edges first, Windows' line ends, no line end at the end.
           "FIX 1 2\r\n\r\nEDGE_SE2 1 2 1 0 0  1.0 0 0 1.0 0 1.0 \r\n"
           "VERTEX_SE2 2 0.50 0 0\r\nVERTEX_SE2 1 0 0 0\r\n# end",
           "VERTEX_XY 3 1e-3 +4\nFIX 3\nFIX 3\nVERTEX_XY 4 -0 .5\n"
           "EDGE_PRIOR_XY 3 0 0 1 0.0 1\n",
           "VERTEX_SE2 0 0 0 0\n"
           "ROBOTLASER1 0 -1.570796 3.141593 0.017453 30.0 0.1 0 3 1.5 2.25 "
           "30.0 0 0.1 0 0 0 0 0 0 0 0 0 0 1.5 host 1.5\n"
           "VERTEX_SE2 1 1 0 0\nROBOTLASER1 0 0 0 0 0 0 0 0 0 1 2 3 1 2 3\n",
           "VERTEX_SE2 0 0 0 0\n"
           "VERTEX_EXTREME_XY 1 1.97956 -4.53735 1\n"
           "VERTEX_EXTREME_XY 2 2.97956 -4.53735 0.567511\n"
           "VERTEX_LINE2D 3 -1.5708 4.53735 1 2\n"
           "VERTEX_LINE2D 4 -1.5708 -4.53735 -1 -1\n"
           "EDGE_SE2_XY 0 1 1.97956 -4.53735 10 0 10\n"
           "EDGE_SE2_LINE2D 0 3 -1.5708 4.53735 1000 0.5 2000\n"
           "EDGE_LINE2D 3 4 0 -9 1000 0.5 2000\n"
           "EDGE_LINE2D_POINTXY 3 1 0 1000.0\n"}) {
    EXPECT_EQ(RoundTrip(text), text);
  }
}

TEST_F(GraphG2oTest, ChangedElementsKeepTheirPlaceAndTag) {
  Graph graph;
  const G2oFile file = Read(
      "# top\n"
      "EDGE2 0 1 1.0 0.0 0.5 4 1 3 2 0.5 0.25\n"
      "VERTEX2 0 0.0 0.0 0.0\n"
      "VERTEX2 1 1.0 0.0 0.5\n"
      "VERTEX_LINE2D 5 0.0 4.5 -1   7\n"
      "EDGE_SE2_LINE2D 0 5 0.0 4.25 10 1 20\n"
      "VERTEX_XY 7 1.0 0.0",
      &graph);
  graph.GetFeature(1).parameters[0] = 1.25;
  graph.GetFeature(2).parameters = {4.25, 0.0};
  graph.GetFeature(2).fixed = true;
  graph.GetFeature(3).observations = 2;
  Eigen::Matrix3d information;
  information << 4, 1, 0.5, 1, 3, 0.25, 0.5, 0.25, 8;
  graph.UpdateConstraint(0, Eigen::Vector3d(1.0, 2.0, 0.5), information);
  graph.UpdateConstraint(1, Eigen::Vector2d(4.25, 0.0),
                         Eigen::Vector2d(30.0, 40.0).asDiagonal());
  EXPECT_EQ(Write(graph, &file),
            "# top\n"
            "EDGE2 0 1 1 2 0.5 4 1 3 8 0.5 0.25\n"
            "VERTEX2 0 0.0 0.0 0.0\n"
            "VERTEX2 1 1.25 0 0.5\n"
            "VERTEX_LINE2D 5 1.5707963267948966 4.25 -1   7\n"
            "FIX 5\n"
            "EDGE_SE2_LINE2D 0 5 1.5707963267948966 4.25 40 0 30\n"
            "VERTEX_XY 7 1.0 0.0\n"
            "PLUMBLINE_FEATURE 7 0 0 0 0 0 0 2 g2o");
  // Reading that and writing it again changes nothing.
  EXPECT_EQ(RoundTrip(Write(graph, &file)), Write(graph, &file));
}

TEST_F(GraphG2oTest, WhatIsGoneIsLeftOut) {
  Graph graph;
  const G2oFile file = Read(
      "VERTEX_XY 0 0.0 0\nFIX 0 1 9\nVERTEX_XY 1 1.0 0\nVERTEX_THING 9\n"
      "PLUMBLINE_FEATURE 1 0 0 0 0 0 0 1 a\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 0 1 1 1\n"
      "PLUMBLINE_CONSTRAINT structure live 0.5 a\nVERTEX_XY 2 1 0.0\n",
      &graph);
  Transaction transaction;
  transaction.RemoveConstraint(0);
  transaction.RemoveFeature(1);
  Feature point = MakeFeature("point", {3.0, 3.0});
  point.source = "g2o";
  point.fixed = true;
  transaction.AddFeature(point);
  graph.Apply(transaction);
  EXPECT_EQ(Write(graph, &file),
            "VERTEX_XY 0 0.0 0\nFIX 0 9\nVERTEX_THING 9\nVERTEX_XY 2 1 0.0\n"
            "VERTEX_XY 10 3 3\nFIX 10\n");
}

TEST_F(GraphG2oTest, WeightsAndStatesOfReadConstraints) {
  Graph graph;
  const G2oFile file = Read(
      "VERTEX_XY 0 0 0\nVERTEX_XY 1 1 0\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 0 1 1 1\n"
      "# between\n"
      "PLUMBLINE_CONSTRAINT structure live 0.50 a\n"
      "PLUMBLINE_POINT_POINT_DISTANCE 1 0 1 1\n",
      &graph);
  graph.GetConstraint(0).delta = 0.25;
  Transaction transaction;
  transaction.BreakConstraint(1);
  graph.Apply(transaction);
  EXPECT_EQ(Write(graph, &file),
            "VERTEX_XY 0 0 0\nVERTEX_XY 1 1 0\n"
            "PLUMBLINE_POINT_POINT_DISTANCE 0 1 1 1\n"
            "# between\n"
            "PLUMBLINE_CONSTRAINT structure live 0.25 a\n"
            "PLUMBLINE_POINT_POINT_DISTANCE 1 0 1 1\n"
            "PLUMBLINE_CONSTRAINT measurement broken 1 g2o\n");
}

// TORO: I_ff I_fs I_ss I_rr I_fr I_sr.
TEST_F(GraphG2oTest, ToroEntries) {
  Graph graph;
  Read(
      "VERTEX2 3 1 2 0.5\nVERTEX2 4 0 0 0\n"
      "EDGE2 4 3 1 2 0.5 11 12 22 33 13 23\n",
      &graph);
  EXPECT_EQ(graph.GetFeature(0).type->name, "pose");
  EXPECT_EQ(graph.GetFeature(0).parameters[2], 0.5);
  const Constraint& edge = graph.GetConstraint(0);
  EXPECT_EQ(edge.type->name, "pose_pose");
  EXPECT_EQ(edge.features, (std::vector<FeatureId>{1, 0}));
  EXPECT_EQ(edge.expected, Eigen::Vector3d(1.0, 2.0, 0.5));
  Eigen::Matrix3d information;
  information << 11, 12, 13, 12, 22, 23, 13, 23, 33;
  EXPECT_EQ(edge.information, information);
}

// A line by its normal: theta = alpha + pi/2, rho = d.
TEST_F(GraphG2oTest, LinesByTheirNormals) {
  Graph graph;
  Read(
      "VERTEX_SE2 0 1 1 0\n"
      "VERTEX_EXTREME_XY 1 5 4.5 1\nVERTEX_XY 2 -3 4.5\n"
      "VERTEX_LINE2D 3 1.5707963267948966 4.5 1 2\n"
      "VERTEX_LINE2D 4 -3 2 -1 1\n"
      "EDGE_SE2_LINE2D 0 3 1.5707963267948966 3.5 100 5 400\n"
      "EDGE_LINE2D 3 4 0.25 -1 100 5 400\n"
      "EDGE_LINE2D_POINTXY 3 2 0.5 9\n",
      &graph);
  ASSERT_EQ(graph.num_features(), 5u);
  EXPECT_EQ(graph.GetFeature(1).type->name, "point");
  const Feature& line = graph.GetFeature(3);
  EXPECT_EQ(line.type->name, "line");
  EXPECT_EQ(line.parameters[0], 4.5);
  EXPECT_EQ(line.parameters[1], 0.0);
  // Between the points at its ends.
  EXPECT_EQ(line.extent_begin, -3.0);
  EXPECT_EQ(line.extent_end, 5.0);
  const Feature& other = graph.GetFeature(4);
  EXPECT_NEAR(other.parameters[1], 1.7123889803846897, 1e-15);  // 3 pi/2 - 3
  EXPECT_EQ(other.extent_begin, other.extent_end);

  ASSERT_EQ(graph.num_constraints(), 3u);
  const Constraint& seen = graph.GetConstraint(0);
  EXPECT_EQ(seen.type->name, "pose_line");
  EXPECT_EQ(seen.expected, Eigen::Vector2d(3.5, 0.0));
  Eigen::Matrix2d information;
  information << 400, 5, 5, 100;
  EXPECT_EQ(seen.information, information);
  const Constraint& difference = graph.GetConstraint(1);
  EXPECT_EQ(difference.type->name, "line_line");
  EXPECT_EQ(difference.expected, Eigen::Vector2d(-1.0, 0.25));
  EXPECT_EQ(difference.information, information);
  const Constraint& on = graph.GetConstraint(2);
  EXPECT_EQ(on.type->name, "point_line_distance");
  EXPECT_EQ(on.features, (std::vector<FeatureId>{2, 3}));
  EXPECT_EQ(on.expected[0], 0.5);
  // The pose sees the line where it is.
  const SolverSession session(&graph, registry_, SessionOptions());
  EXPECT_NEAR(session.SquaredResidual(seen), 0.0, 1e-20);
  // n p - rho = 4.5 - 4.5, 0.5 less than expected.
  EXPECT_NEAR(session.Error(on)[0], -0.5, 1e-14);
}

// Turned by a right angle, what lies ahead of one pose lies to the side of the
// other.
TEST_F(GraphG2oTest, InformationAtTheSecondPose) {
  const std::string text =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 1.5707963267948966\n"
      "EDGE_SE2 0 1 1.0 0 1.5707963267948966 4 0 0.5 9 0.25 16\n";
  G2oOptions options;
  options.information_at_second = true;
  Graph graph;
  std::istringstream input(text);
  const G2oFile file = ReadG2o(input, "map.g2o", registry_, &graph, options);
  Eigen::Matrix3d information;
  information << 9, 0, -0.25, 0, 4, 0.5, -0.25, 0.5, 16;
  EXPECT_LT((graph.GetConstraint(0).information - information).norm(), 1e-14);
  EXPECT_EQ(Write(graph, &file), text);
  // A new edge is written in the frame of the file.
  Constraint edge = graph.GetConstraint(0);
  edge.source = "g2o";
  Transaction transaction;
  transaction.AddConstraint(edge);
  graph.Apply(transaction);
  const std::string written = Write(graph, &file);
  std::istringstream again(written);
  Graph copy;
  ReadG2o(again, "map.g2o", registry_, &copy, options);
  ASSERT_EQ(copy.num_constraints(), 2u);
  EXPECT_LT((copy.GetConstraint(1).information - information).norm(), 1e-14);
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
  const std::string tail =
      "VERTEX_XY 9 0 0\nVERTEX_LINE2D 8 0 1 -1 -1\n"
      "VERTEX_LINE2D 7 0 1 -1 -1\nVERTEX_SEGMENT2D 6 0 0 1 1\n";
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
      {"VERTEX2 2 0 0", "VERTEX2 has 3 fields: expected 4 (id, 3 numbers)"},
      {"VERTEX2 2 0 0 0 0", "VERTEX2 has 5 fields: expected 4"},
      {"VERTEX2 2 0 0 nan", "\"nan\": expected a finite number"},
      {"VERTEX2 1 0 0 0", "id 1 is taken"},
      {"EDGE2 0 1 1 0 0 1 0 1 1 0", "EDGE2 has 10 fields: expected 11"},
      {"EDGE2 0 1 1 0 0 1 0 1 1 0 0 0", "EDGE2 has 12 fields: expected 11"},
      {"EDGE2 0 1 1 0 0 1 0 1 -1 0 0", "information of pose_pose is not valid"},
      {"EDGE2 0 3 1 0 0 1 0 1 1 0 0", "no vertex 3"},
      {"EDGE2 0 1 1 0 nan 1 0 1 1 0 0", "\"nan\""},
      {"VERTEX_XY 2 0", "VERTEX_XY has 2 fields: expected 3 (id, x m, y m)"},
      {"VERTEX_XY 2 0 0 0", "VERTEX_XY has 4 fields"},
      {"VERTEX_XY 2 0 inf", "\"inf\""},
      {"VERTEX_EXTREME_XY 2 0 0",
       "VERTEX_EXTREME_XY has 3 fields: expected 4 (id, 2 numbers, weight)"},
      {"VERTEX_EXTREME_XY 2 0 0 nan", "\"nan\""},
      {"VERTEX_LINE2D 2 0 0",
       "VERTEX_LINE2D has 3 fields: expected 5 (id, 2 numbers, p1Id, p2Id)"},
      {"VERTEX_LINE2D 2 0 0 -1 -1 -1", "VERTEX_LINE2D has 6 fields"},
      {"VERTEX_LINE2D 2 nan 0 -1 -1", "\"nan\""},
      {"VERTEX_LINE2D 2 0 0 0.5 -1", "p1Id is \"0.5\""},
      {"VERTEX_LINE2D 2 0 0 -2 -1", "p1Id is \"-2\": expected a whole number"},
      {"VERTEX_LINE2D 0 0 0 -1 -1", "id 0 is taken"},
      {"VERTEX_SEGMENT2D 2 0 0 1",
       "VERTEX_SEGMENT2D has 4 fields: expected 5 (id, x1 m, y1 m, x2 m, y2 "
       "m)"},
      {"VERTEX_SEGMENT2D 2 0 0 1 1 1", "VERTEX_SEGMENT2D has 6 fields"},
      {"VERTEX_SEGMENT2D 2 0 0 1 nan", "\"nan\""},
      {"VERTEX_SEGMENT2D 0 0 0 1 1", "id 0 is taken"},
      {"EDGE_SE2_XY 0 9 1 0 1 0",
       "EDGE_SE2_XY has 6 fields: expected 7 (2 ids, 2 expected values, the "
       "upper triangle of the information)"},
      {"EDGE_SE2_XY 0 9 1 0 1 0 1 1", "EDGE_SE2_XY has 8 fields"},
      {"EDGE_SE2_XY 0 9 1 nan 1 0 1", "\"nan\""},
      {"EDGE_SE2_XY 0 9 1 0 1 2 1", "information of pose_point is not valid"},
      {"EDGE_SE2_XY 0 3 1 0 1 0 1", "no vertex 3"},
      {"EDGE_SE2_XY 9 0 1 0 1 0 1",
       "feature 1 of pose_point is of type point: expected pose"},
      {"EDGE_BEARING_SE2_XY 0 9 1",
       "EDGE_BEARING_SE2_XY has 3 fields: expected 4 (2 ids, 1 expected value"},
      {"EDGE_BEARING_SE2_XY 0 9 1 1 1", "EDGE_BEARING_SE2_XY has 5 fields"},
      {"EDGE_BEARING_SE2_XY 0 9 nan 1", "\"nan\""},
      {"EDGE_BEARING_SE2_XY 0 9 1 -1",
       "information of pose_point_bearing is not valid"},
      {"EDGE_BEARING_SE2_XY 0 3 1 1", "no vertex 3"},
      {"EDGE_SE2_LINE2D 0 8 0 1 1 0", "EDGE_SE2_LINE2D has 6 fields"},
      {"EDGE_SE2_LINE2D 0 8 0 1 1 0 1 1", "EDGE_SE2_LINE2D has 8 fields"},
      {"EDGE_SE2_LINE2D 0 8 nan 1 1 0 1", "\"nan\""},
      {"EDGE_SE2_LINE2D 0 8 0 1 1 2 1",
       "information of pose_line is not valid"},
      {"EDGE_SE2_LINE2D 0 3 0 1 1 0 1", "no vertex 3"},
      {"EDGE_SE2_LINE2D 0 9 0 1 1 0 1",
       "feature 2 of pose_line is of type point: expected line"},
      {"EDGE_LINE2D 8 7 0 1 1 0", "EDGE_LINE2D has 6 fields"},
      {"EDGE_LINE2D 8 7 0 1 1 0 1 1", "EDGE_LINE2D has 8 fields"},
      {"EDGE_LINE2D 8 7 0 nan 1 0 1", "\"nan\""},
      {"EDGE_LINE2D 8 7 0 1 1 2 1", "information of line_line is not valid"},
      {"EDGE_LINE2D 8 3 0 1 1 0 1", "no vertex 3"},
      {"EDGE_LINE2D 8 8 0 1 1 0 1", "line_line from a feature to itself"},
      {"EDGE_LINE2D_POINTXY 8 9 0", "EDGE_LINE2D_POINTXY has 3 fields"},
      {"EDGE_LINE2D_POINTXY 8 9 0 1 1", "EDGE_LINE2D_POINTXY has 5 fields"},
      {"EDGE_LINE2D_POINTXY 8 9 nan 1", "\"nan\""},
      {"EDGE_LINE2D_POINTXY 8 9 0 -1",
       "information of point_line_distance is not valid"},
      {"EDGE_LINE2D_POINTXY 8 3 0 1", "no vertex 3"},
      {"EDGE_LINE2D_POINTXY 9 8 0 1",
       "feature 1 of point_line_distance is of type line"},
      {"EDGE_SE2_SEGMENT2D 0 6 1 1 2 2 1 0 0 0 1 0 0 1 0",
       "EDGE_SE2_SEGMENT2D has 15 fields: expected 16 (2 ids, 4 expected "
       "values"},
      {"EDGE_SE2_SEGMENT2D 0 6 1 1 2 2 1 0 0 0 1 0 0 1 0 1 1",
       "EDGE_SE2_SEGMENT2D has 17 fields"},
      {"EDGE_SE2_SEGMENT2D 0 6 1 1 nan 2 1 0 0 0 1 0 0 1 0 1", "\"nan\""},
      {"EDGE_SE2_SEGMENT2D 0 6 1 1 2 2 1 0 0 0 1 0 0 1 0 -1",
       "information of pose_end_points is not valid"},
      {"EDGE_SE2_SEGMENT2D 0 3 1 1 2 2 1 0 0 0 1 0 0 1 0 1", "no vertex 3"},
      {"EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0",
       "EDGE_PRIOR_SE2 has 9 fields: expected 10 (1 id, 3 expected values"},
      {"EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1 1", "EDGE_PRIOR_SE2 has 11 fields"},
      {"EDGE_PRIOR_SE2 0 0 0 nan 1 0 0 1 0 1", "\"nan\""},
      {"EDGE_PRIOR_SE2 0 0 0 0 1 2 0 1 0 1",
       "information of pose_prior is not valid"},
      {"EDGE_PRIOR_SE2 3 0 0 0 1 0 0 1 0 1", "no vertex 3"},
      {"EDGE_PRIOR_SE2_XY 0 0 0 1 0",
       "EDGE_PRIOR_SE2_XY has 5 fields: expected 6"},
      {"EDGE_PRIOR_SE2_XY 0 0 0 1 0 1 1", "EDGE_PRIOR_SE2_XY has 7 fields"},
      {"EDGE_PRIOR_SE2_XY 0 nan 0 1 0 1", "\"nan\""},
      {"EDGE_PRIOR_SE2_XY 0 0 0 1 2 1",
       "information of pose_position_prior is not valid"},
      {"EDGE_PRIOR_SE2_XY 9 0 0 1 0 1",
       "feature 1 of pose_position_prior is of type point: expected pose"},
      {"EDGE_PRIOR_XY 9 0 0 1 0", "EDGE_PRIOR_XY has 5 fields: expected 6"},
      {"EDGE_PRIOR_XY 9 0 0 1 0 1 1", "EDGE_PRIOR_XY has 7 fields"},
      {"EDGE_PRIOR_XY 9 0 nan 1 0 1", "\"nan\""},
      {"EDGE_PRIOR_XY 9 0 0 1 2 1", "information of point_prior is not valid"},
      {"EDGE_PRIOR_XY 3 0 0 1 0 1", "no vertex 3"},
      {"ROBOTLASER1 0 0 0 0 0 0 0 2 1 1 0 1 2 3 1 2",
       "ROBOTLASER1 has 16 fields: expected 7 numbers, ranges and remissions"},
      {"ROBOTLASER1 0 0 0 0 0 0 0 -2 1 1 0 1 2 3 1 2 3",
       "number of readings is \"-2\""},
      {"ROBOTLASER1 0 0 0 0 0 0 0 9 1 1 0 1 2 3 1 2 3",
       "ROBOTLASER1 has 17 fields"},
      {"ROBOTLASER1 0 0 0 0 0 0 0 2 1 nan 0 1 2 3 1 2 3", "\"nan\""},
      {"ROBOTLASER1", "ROBOTLASER1 has 0 fields"},
      {"PLUMBLINE_FEATURE 1 0 0 0 0 0 0 0",
       "PLUMBLINE_FEATURE has 8 fields: expected 9"},
      {"PLUMBLINE_FEATURE 3 0 0 0 0 0 0 0 a", "no vertex 3"},
      {"PLUMBLINE_FEATURE 1 -1 0 0 0 0 0 0 a", "level is \"-1\""},
      {"PLUMBLINE_FEATURE 1 2147483647 1 0 0 0 0 0 a",
       "level is \"2147483647\""},
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
      {"structure live 1 a 1.5",
       "break_below 1.5: expected a number in [0, 1]"},
      {"structure live 1 a 0.1 0", "has 6 fields: expected 4"},
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
