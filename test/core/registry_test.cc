#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

FeatureType Dot() {
  FeatureType type;
  type.name = "dot";
  type.g2o_tag = "VERTEX_DOT";
  type.parameters = {Quantity::Length("x"), Quantity::Length("y")};
  return type;
}

RelationType Link() {
  RelationType type;
  type.name = "link";
  type.g2o_tag = "EDGE_LINK";
  type.feature_types = {{"dot"}, {"dot"}};
  type.rows = {Quantity::Length("distance", "distance tolerance")};
  type.make_cost = [](const RelationArguments&) {
    return std::unique_ptr<ceres::CostFunction>();
  };
  return type;
}

template <typename Function>
std::string MessageOf(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(RegistryTest, FindsWhatWasRegistered) {
  Registry registry;
  const FeatureType& dot = registry.Register(Dot());
  const RelationType& link = registry.Register(Link());
  EXPECT_EQ(registry.FindFeature("dot"), &dot);
  EXPECT_EQ(&registry.GetFeature("dot"), &dot);
  EXPECT_EQ(registry.FindFeatureByTag("VERTEX_DOT"), &dot);
  EXPECT_EQ(registry.FindRelation("link"), &link);
  EXPECT_EQ(registry.FindRelationByTag("EDGE_LINK"), &link);
  EXPECT_EQ(registry.FindFeatureByTag("EDGE_LINK"), nullptr);
  EXPECT_EQ(registry.FindFeature("dots"), nullptr);
  EXPECT_EQ(registry.FindLoss("dot"), nullptr);
  EXPECT_EQ(registry.FindDetector("dot"), nullptr);
}

TEST(RegistryTest, RefusesNamesThatAreTakenOrBad) {
  Registry registry;
  registry.Register(Dot());
  EXPECT_THAT(MessageOf([&] { registry.Register(Dot()); }), HasSubstr("taken"));
  FeatureType other = Dot();
  other.name = "other";
  EXPECT_THAT(MessageOf([&] { registry.Register(other); }),
              HasSubstr("'VERTEX_DOT' is registered already"));
  RelationType link = Link();
  link.g2o_tag = "VERTEX_DOT";
  EXPECT_THROW(registry.Register(link), Error);
  for (const char* const bad : {"", "two words", "tab\t", "line\n"}) {
    FeatureType type = Dot();
    type.g2o_tag = "VERTEX_OTHER";
    type.name = bad;
    EXPECT_THROW(registry.Register(type), Error) << bad;
    type.name = "other";
    type.g2o_tag = bad;
    EXPECT_THROW(registry.Register(type), Error) << bad;
  }
  EXPECT_EQ(registry.features().size(), 1u);
}

TEST(RegistryTest, RefusesIncompleteTypes) {
  Registry registry;
  FeatureType large = Dot();
  large.parameters.resize(kMaxFeatureSize + 1, Quantity::Length("x"));
  EXPECT_THAT(MessageOf([&] { registry.Register(large); }),
              HasSubstr("'dot' has 11 parameters: expected 1 to 10"));
  FeatureType miscounted = Dot();
  miscounted.size = 3;
  EXPECT_THAT(MessageOf([&] { registry.Register(miscounted); }),
              HasSubstr("describes 2 parameters of 3"));
  FeatureType undescribed = Dot();
  undescribed.parameters.clear();
  EXPECT_THAT(MessageOf([&] { registry.Register(undescribed); }),
              HasSubstr("expected parameters: the name and unit of each"));
  FeatureType unnamed = Dot();
  unnamed.parameters[1].name = "";
  EXPECT_THAT(MessageOf([&] { registry.Register(unnamed); }),
              HasSubstr("parameters without a name"));
  FeatureType anchored = Dot();
  anchored.anchor_size = kMaxAnchorSize + 1;
  EXPECT_THAT(MessageOf([&] { registry.Register(anchored); }),
              HasSubstr("anchor_size of 4: expected 0 to 3"));
  RelationType costless = Link();
  costless.make_cost = nullptr;
  EXPECT_THROW(registry.Register(costless), Error);
  RelationType rowless = Link();
  rowless.rows.clear();
  EXPECT_THAT(MessageOf([&] { registry.Register(rowless); }),
              HasSubstr("relation 'link' has no rows: expected rows: "));
  RelationType misplaced = Link();
  misplaced.role = RelationRole::kPosition;
  EXPECT_THAT(MessageOf([&] { registry.Register(misplaced); }),
              HasSubstr("expected 2 rows, x and y, and 2 features"));
  RelationType unrelated = Link();
  unrelated.feature_types[1].clear();
  EXPECT_THROW(registry.Register(unrelated), Error);
  // Tags of other formats, and orders that leave something out.
  registry.Register(Dot());
  RelationType alias = Link();
  alias.name = "alias";
  alias.g2o_tag = "EDGE_ALIAS";
  alias.other_g2o_formats.resize(1);
  alias.other_g2o_formats[0].tag = "VERTEX_DOT";
  EXPECT_THROW(registry.Register(alias), Error);
  alias.other_g2o_formats[0].tag = "EDGE_ALIAS";
  EXPECT_THROW(registry.Register(alias), Error);
  alias.other_g2o_formats[0].tag = "EDGE_OTHER";
  alias.other_g2o_formats[0].feature_places = {1, 1};
  EXPECT_THROW(registry.Register(alias), Error);
  alias.other_g2o_formats[0].feature_places = {1, 0};
  alias.other_g2o_formats[0].row_places = {1};
  EXPECT_THROW(registry.Register(alias), Error);
  alias.other_g2o_formats[0].row_places = {};
  alias.other_g2o_formats[0].information_order = {{0, 1}};
  EXPECT_THROW(registry.Register(alias), Error);
  alias.other_g2o_formats[0].information_order = {};
  EXPECT_NO_THROW(registry.Register(alias));
  LossType loss;
  loss.name = "nothing";
  EXPECT_THROW(registry.Register(loss), Error);
  DetectorType detector;
  detector.name = "nothing";
  EXPECT_THAT(MessageOf([&] { registry.Register(detector); }),
              HasSubstr("detector 'nothing' makes nothing: expected make"));
  detector.make = [](const DetectorParameters&) {
    return std::unique_ptr<StructureDetector>();
  };
  EXPECT_THAT(MessageOf([&] { registry.Register(detector); }),
              HasSubstr("does not say what it reads: expected reads: the names "
                        "of the feature types"));
  detector.reads = {"dot"};
  detector.parameters = {{"sigma", 0.1, "m"}, {"sigma", 0.2, "m"}};
  EXPECT_THAT(MessageOf([&] { registry.Register(detector); }),
              HasSubstr("parameter 'sigma' is registered already"));
  detector.parameters.pop_back();
  EXPECT_NO_THROW(registry.Register(detector));
}

// A role promises what the parameters begin with.
TEST(RegistryTest, RefusesTraitsThatDoNotFit) {
  Registry registry;
  FeatureType type = Dot();
  type.traits.role = FeatureRole::kPoint;
  EXPECT_THAT(MessageOf([&] { registry.Register(type); }),
              HasSubstr("expected traits.leading to be Leading::kPosition"));
  type.traits.leading = Leading::kFrame;
  type.traits.role = FeatureRole::kPose;
  EXPECT_THAT(MessageOf([&] { registry.Register(type); }),
              HasSubstr("2 parameters, too few for its traits: expected at "
                        "least 3"));
  type.traits = {FeatureRole::kWall};
  EXPECT_THAT(MessageOf([&] { registry.Register(type); }),
              HasSubstr("is a wall and has no frame: expected frame"));
  type.frame = [](const Feature& feature) {
    return Eigen::Vector3d(feature.parameters[0], feature.parameters[1], 0.5);
  };
  EXPECT_NO_THROW(registry.Register(type));
}

TEST(RegistryTest, FindsTheRelationThatSaysIt) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const FeatureType& segment = registry.GetFeature("segment");
  const FeatureType& line = registry.GetFeature("line");
  const FeatureType& orientation = registry.GetFeature("orientation");
  const auto name = [&](RelationRole role, const FeatureType& first,
                        const FeatureType& second) {
    const RelationType* type = registry.FindRelation(role, first, second);
    return type == nullptr ? std::string("none") : type->name;
  };
  EXPECT_EQ(name(RelationRole::kDirection, segment, orientation),
            "segment_orientation");
  EXPECT_EQ(name(RelationRole::kDirection, line, orientation),
            "line_orientation");
  EXPECT_EQ(name(RelationRole::kAngle, orientation, orientation),
            "orientation_orientation");
  EXPECT_EQ(name(RelationRole::kSide, line, registry.GetFeature("rectangle")),
            "line_rectangle");
  EXPECT_EQ(name(RelationRole::kSameWall, segment, segment),
            "segment_segment_collinearity");
  EXPECT_EQ(name(RelationRole::kSameWall, line, line), "none");
  EXPECT_THAT(MessageOf([&] {
                registry.GetRelation(RelationRole::kDirection, orientation,
                                     segment);
              }),
              HasSubstr("of the types orientation and segment: expected what "
                        "one of these relates: line_orientation, "));
}

TEST(RegistryTest, UnknownNamesListTheNearestFirst) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  EXPECT_THAT(MessageOf([&] { registry.GetFeature("segmant"); }),
              HasSubstr("unknown feature type 'segmant': expected one of "
                        "segment, "));
  EXPECT_THAT(MessageOf([&] { registry.GetRelation("pose_poes"); }),
              HasSubstr("expected one of pose_pose, "));
  EXPECT_THAT(MessageOf([&] { registry.GetLoss("hubert"); }),
              HasSubstr("expected one of huber, "));
  EXPECT_THAT(MessageOf([&] { registry.GetDetector("lines"); }),
              HasSubstr("none is"));
}

TEST(RegistryTest, EverythingComesInTheOrderOfNames) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  std::vector<std::string> names;
  for (const FeatureType* type : registry.features()) {
    names.push_back(type->name);
  }
  EXPECT_THAT(
      names, ::testing::ElementsAre("circle", "corridor", "end_points", "line",
                                    "orientation", "point", "pose", "rectangle",
                                    "segment", "thickness"));
}

// A kind that core has never heard of.
struct Flavour {
  static constexpr char kKind[] = "flavour";
  static constexpr char kTitle[] = "Flavours";

  std::string name;
  std::string description;
  int sweetness = 0;
};

TEST(RegistryTest, KindsThatCoreDoesNotKnow) {
  Registry registry;
  EXPECT_EQ(registry.Find<Flavour>("salt"), nullptr);
  EXPECT_THAT(MessageOf([&] { registry.Get<Flavour>("salt"); }),
              HasSubstr("unknown flavour 'salt': expected one that is "
                        "registered, and none is"));
  EXPECT_TRUE(registry.All<Flavour>().empty());
  EXPECT_EQ(registry.lists().size(), 4u);

  const Flavour& honey = registry.Register(Flavour{"honey", "of bees", 9});
  registry.Register(Flavour{"cocoa", "of beans", 2});
  EXPECT_EQ(registry.Find<Flavour>("honey"), &honey);
  EXPECT_EQ(registry.Get<Flavour>("cocoa").sweetness, 2);
  EXPECT_THAT(MessageOf([&] { registry.Get<Flavour>("hony"); }),
              HasSubstr("unknown flavour 'hony': expected one of honey, "));
  EXPECT_THAT(MessageOf([&] {
                registry.Register(Flavour{"honey", "", 0});
              }),
              HasSubstr("flavour 'honey' is registered already"));
  EXPECT_THROW(registry.Register(Flavour{"two words", "", 0}), Error);
  // Kinds do not share names.
  EXPECT_EQ(registry.FindFeature("honey"), nullptr);

  ASSERT_EQ(registry.All<Flavour>().size(), 2u);
  EXPECT_EQ(registry.All<Flavour>()[1], &honey);
  const PluginList& list = *registry.lists().back();
  EXPECT_EQ(list.title(), "Flavours");
  ASSERT_EQ(list.entries().size(), 2u);
  EXPECT_EQ(list.entries()[0].name, "cocoa");
  EXPECT_EQ(list.entries()[1].description, "of bees");
}

TEST(RegistryTest, ListsOfCoresOwnKinds) {
  Registry registry;
  RegisterBuiltinRelations(&registry);
  std::vector<std::string> titles;
  for (const PluginList* list : registry.lists()) {
    titles.push_back(list->title());
  }
  EXPECT_THAT(titles, ::testing::ElementsAre("Feature types", "Relations",
                                             "Losses (--delta_mode)",
                                             "Detectors (--hierarchy)"));
  EXPECT_EQ(registry.lists()[0]->entries().front().name, "circle");
}

TEST(RegistryTest, GlobalIsOneInstance) {
  EXPECT_EQ(&Registry::Global(), &Registry::Global());
}

class BuiltinsTest : public ::testing::Test {
 protected:
  BuiltinsTest() { RegisterBuiltinRelations(&registry_); }

  Feature Make(const std::string& type, std::vector<double> parameters) const {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      feature.parameters[i] = parameters[i];
    }
    return feature;
  }

  // Residual of a relation with the information's root the identity.
  Eigen::VectorXd Residual(const std::string& name, const Eigen::VectorXd& u,
                           const std::vector<Feature>& features) const {
    const RelationType& relation = registry_.GetRelation(name);
    RelationArguments arguments;
    arguments.expected = u;
    arguments.sqrt_information = Eigen::MatrixXd::Identity(
        relation.residual_size, relation.residual_size);
    std::vector<const double*> blocks;
    for (const Feature& feature : features) {
      arguments.features.push_back(&feature);
      blocks.push_back(feature.data());
    }
    const auto cost = relation.make_cost(arguments);
    EXPECT_EQ(cost->num_residuals(), relation.residual_size);
    EXPECT_EQ(cost->parameter_block_sizes().size(), features.size());
    for (std::size_t i = 0; i < features.size(); ++i) {
      EXPECT_EQ(cost->parameter_block_sizes()[i], features[i].type->size);
    }
    Eigen::VectorXd residual(relation.residual_size);
    EXPECT_TRUE(cost->Evaluate(blocks.data(), residual.data(), nullptr));
    return residual;
  }

  static Eigen::VectorXd Numbers(const std::vector<double>& numbers) {
    return Eigen::Map<const Eigen::VectorXd>(
        numbers.data(), static_cast<Eigen::Index>(numbers.size()));
  }

  Registry registry_;
};

TEST_F(BuiltinsTest, RegisteringTwiceDoesNothing) {
  const FeatureType* point = registry_.FindFeature("point");
  const std::size_t relations = registry_.relations().size();
  RegisterBuiltinRelations(&registry_);
  EXPECT_EQ(registry_.FindFeature("point"), point);
  EXPECT_GT(relations, 0u);
  EXPECT_EQ(registry_.relations().size(), relations);
  EXPECT_EQ(registry_.losses().size(), 7u);
}

TEST_F(BuiltinsTest, TagsOfG2o) {
  EXPECT_EQ(registry_.FindFeatureByTag("VERTEX_XY"),
            registry_.FindFeature("point"));
  EXPECT_EQ(registry_.FindFeatureByTag("VERTEX_SE2"),
            registry_.FindFeature("pose"));
  EXPECT_EQ(registry_.FindRelationByTag("EDGE_SE2"),
            registry_.FindRelation("pose_pose"));
  EXPECT_EQ(registry_.FindRelationByTag("PLUMBLINE_SEGMENT_ORIENTATION"),
            registry_.FindRelation("segment_orientation"));
  // Those of other formats.
  EXPECT_EQ(registry_.FindFeatureByTag("VERTEX2"),
            registry_.FindFeature("pose"));
  EXPECT_EQ(registry_.FindFeatureByTag("VERTEX_LINE2D"),
            registry_.FindFeature("line"));
  EXPECT_EQ(registry_.FindRelationByTag("EDGE2"),
            registry_.FindRelation("pose_pose"));
  EXPECT_EQ(registry_.FindRelationByTag("EDGE3"), nullptr);
}

TEST_F(BuiltinsTest, RelationsNameKnownFeatureTypes) {
  for (const RelationType* relation : registry_.relations()) {
    EXPECT_FALSE(relation->description.empty()) << relation->name;
    for (const auto& names : relation->feature_types) {
      for (const std::string& name : names) {
        EXPECT_NE(registry_.FindFeature(name), nullptr)
            << relation->name << ": " << name;
      }
    }
  }
}

TEST_F(BuiltinsTest, EveryCombinationOfTypesMakesACost) {
  for (const RelationType* relation : registry_.relations()) {
    // All choices of types, one after the other like the digits of a number.
    const auto& types = relation->feature_types;
    std::vector<std::size_t> choice(types.size(), 0);
    bool is_done = false;
    while (!is_done) {
      std::string trace = relation->name;
      std::vector<Feature> features;
      for (std::size_t i = 0; i < types.size(); ++i) {
        const std::string& name = types[i][choice[i]];
        trace += " " + name;
        const double shift = static_cast<double>(i);
        features.push_back(
            Make(name, {0.1 + shift, 0.2 + shift, 0.3, 1.0, 2.0}));
      }
      SCOPED_TRACE(trace);
      const Eigen::VectorXd residual =
          Residual(relation->name,
                   Eigen::VectorXd::Zero(relation->residual_size), features);
      EXPECT_TRUE(residual.allFinite());
      is_done = true;
      for (std::size_t i = 0; i < choice.size() && is_done; ++i) {
        is_done = ++choice[i] == types[i].size();
        if (is_done) choice[i] = 0;
      }
    }
  }
}

// Where the relation says that the second feature is, its residual is zero.
TEST_F(BuiltinsTest, PlacesOfTheSecondFeature) {
  const std::map<std::string, std::vector<double>> expected = {
      {"pose_pose", {2.0, -1.0, 0.5}},
      {"pose_point", {2.0, -1.0}},
      {"pose_line", {1.5, -2.0}},
      {"pose_end_points", {2.0, -1.0, 3.0, 4.0}}};
  std::size_t found = 0;
  for (const RelationType* relation : registry_.relations()) {
    if (relation->place_second == nullptr) {
      // A prior says where its only feature is.
      EXPECT_EQ(relation->Is(RelationRole::kPose) ||
                    relation->Is(RelationRole::kPosition),
                relation->name == "pose_prior")
          << relation->name;
      continue;
    }
    SCOPED_TRACE(relation->name);
    ASSERT_EQ(expected.count(relation->name), 1u);
    ++found;
    const Eigen::VectorXd value = Numbers(expected.at(relation->name));
    const Feature first = Make("pose", {3.0, 4.0, 2.5});
    Feature second = Make(relation->feature_types[1][0], {});
    second.anchor = {10.0, -20.0};
    relation->place_second(value, first, &second);
    EXPECT_LT(Residual(relation->name, value, {first, second}).norm(), 1e-12);
  }
  EXPECT_EQ(found, expected.size());
}

TEST_F(BuiltinsTest, ValuesByHand) {
  // A 3-4-5 triangle.
  EXPECT_NEAR(
      Residual("point_point_distance", Numbers({4.0}),
               {Make("point", {1.0, 1.0}), Make("circle", {4.0, 5.0, 9.0})})[0],
      1.0, 1e-12);
  const Eigen::VectorXd coincidence =
      Residual("point_point_coincidence", Numbers({0.0, 1.0}),
               {Make("pose", {1.0, 1.0, 7.0}), Make("point", {4.0, 5.0})});
  EXPECT_NEAR(coincidence[0], 3.0, 1e-12);
  EXPECT_NEAR(coincidence[1], 3.0, 1e-12);
  EXPECT_NEAR(
      Residual("point_circle_distance", Numbers({0.0}),
               {Make("point", {3.0, 4.0}), Make("circle", {0.0, 0.0, 2.0})})[0],
      3.0, 1e-12);
  // A quarter turn to the left, then one metre ahead is one metre along y.
  const Eigen::VectorXd pose = Residual(
      "pose_pose", Numbers({0.0, 0.0, 0.0}),
      {Make("pose", {2.0, 3.0, kPi / 2}), Make("segment", {2.0, 4.0, kPi})});
  EXPECT_NEAR(pose[0], 1.0, 1e-12);
  EXPECT_NEAR(pose[1], 0.0, 1e-12);
  EXPECT_NEAR(pose[2], kPi / 2, 1e-12);
  // A wall seen from the other side has the same orientation.
  EXPECT_NEAR(Residual("segment_orientation", Numbers({0.0}),
                       {Make("segment", {5.0, 5.0, 0.1}),
                        Make("orientation", {0.3 + kPi})})[0],
              0.2, 1e-12);
  EXPECT_NEAR(Residual("orientation_orientation", Numbers({kPi / 2}),
                       {Make("orientation", {0.1}),
                        Make("orientation", {0.15 - kPi / 2})})[0],
              0.05, 1e-12);
}

TEST_F(BuiltinsTest, SidesOfARectangle) {
  // Half sizes 3 and 2 about (4, 5): the side on the right is at x = 7.
  const Feature rectangle = Make("rectangle", {4.0, 5.0, 0.0, 3.0, 2.0});
  const Eigen::VectorXd segment =
      Residual("segment_rectangle", Numbers({0.0, kPi / 2}),
               {Make("segment", {7.5, 4.0, kPi / 2 + 0.1}), rectangle});
  EXPECT_NEAR(segment[0], 0.5, 1e-12);
  EXPECT_NEAR(segment[1], 0.1, 1e-12);
  // The line x = 7.5, downwards: d = (x - 100) for the anchor (100, 10).
  Feature line = Make("line", {-92.5, -kPi / 2});
  line.anchor = {100.0, 10.0};
  const Eigen::VectorXd of_line =
      Residual("line_rectangle", Numbers({0.0, kPi / 2}), {line, rectangle});
  EXPECT_NEAR(of_line[0], 0.5, 1e-12);
  EXPECT_NEAR(of_line[1], 0.0, 1e-12);
  EXPECT_NEAR(Residual("rectangle_orientation", Numbers({kPi / 2}),
                       {rectangle, Make("orientation", {0.2 - kPi / 2})})[0],
              0.2, 1e-12);
}

TEST_F(BuiltinsTest, CorridorsAndThicknesses) {
  // Beside the anchor the axis is 1 m to its left, and the left side 2.25 m.
  Feature corridor = Make("corridor", {1.0, -0.1, 1.25});
  corridor.anchor = {100.0, 5.0};
  const Eigen::VectorXd side =
      Residual("segment_corridor", Numbers({0.0, kPi}),
               {Make("segment", {97.0, 7.75, kPi}), corridor});
  EXPECT_NEAR(side[0], 0.5, 1e-12);
  EXPECT_NEAR(side[1], 0.1, 1e-12);
  corridor.parameters[1] = 0.0;
  EXPECT_EQ(corridor.type->frame(corridor), Eigen::Vector3d(100.0, 6.0, 0.0));
  const Eigen::VectorXd thickness = Residual(
      "segment_segment_thickness", Numbers({0.0, kPi}),
      {Make("segment", {1.0, 2.0, 0.0}),
       Make("segment", {4.0, 1.8, -kPi + 0.1}), Make("thickness", {0.15})});
  EXPECT_NEAR(thickness[0], 0.05, 1e-12);
  EXPECT_NEAR(thickness[1], 0.1, 1e-12);
}

// Frames that say the same of a wall given in two ways.
TEST_F(BuiltinsTest, FramesOfWalls) {
  const Feature segment = Make("segment", {3.0, 4.0, 0.5});
  EXPECT_EQ(segment.type->frame(segment), Eigen::Vector3d(3.0, 4.0, 0.5));
  // Two metres to the left of the anchor (100, 10), along x.
  Feature line = Make("line", {2.0, 0.0});
  line.anchor = {100.0, 10.0};
  EXPECT_EQ(line.type->frame(line), Eigen::Vector3d(100.0, 12.0, 0.0));
  EXPECT_TRUE(segment.type->traits.is_one_sided);
  EXPECT_FALSE(line.type->traits.is_one_sided);
  for (const FeatureType* type : registry_.features()) {
    EXPECT_EQ(type->Is(FeatureRole::kWall),
              type->name == "segment" || type->name == "line")
        << type->name;
  }
}

TEST_F(BuiltinsTest, LinesAreRelativeToTheirAnchor) {
  // The horizontal line y = 10 + 2 = 12, anchored at (100, 10).
  Feature line = Make("line", {2.0, 0.0});
  line.anchor = {100.0, 10.0};
  EXPECT_NEAR(std::abs(Residual("point_line_distance", Numbers({0.0}),
                                {Make("point", {3.0, 12.5}), line})[0]),
              0.5, 1e-12);
}

TEST_F(BuiltinsTest, LossesAreScaledByTheChiSquareQuantile) {
  const auto rho = [this](const std::string& name, double delta, int degrees,
                          double s) {
    const auto loss = registry_.GetLoss(name).make_loss(&delta, degrees);
    std::array<double, 3> values{};
    loss->Evaluate(s, values.data());
    return values;
  };
  EXPECT_NEAR(rho("frozen", 0.25, 1, 8.0)[0], 2.0, 1e-12);
  // Two degrees of freedom: weight exp(-s/2).
  EXPECT_NEAR(rho("continuous", 1.0, 2, 3.0)[1], std::exp(-1.5), 1e-12);
  // chi^2_1(0.95) = 3.841459: the weight of Huber falls below one there.
  EXPECT_NEAR(rho("huber", 1.0, 1, 3.84)[1], 1.0, 1e-12);
  EXPECT_NEAR(rho("huber", 1.0, 1, 4 * 3.841459)[1], 0.5, 1e-6);
  EXPECT_NEAR(rho("cauchy", 1.0, 1, 3.841459)[1], 0.5, 1e-6);
  // chi^2_2(0.95) = 5.991465.
  EXPECT_NEAR(rho("cauchy", 1.0, 2, 5.991465)[1], 0.5, 1e-6);
  EXPECT_NEAR(rho("geman_mcclure", 1.0, 1, 3.841459)[1], 0.25, 1e-6);
  EXPECT_NEAR(rho("dcs", 1.0, 1, 3.84)[1], 1.0, 1e-6);
  EXPECT_NEAR(rho("dcs", 1.0, 1, 3 * 3.841459)[1], 0.25, 1e-6);
  // Tukey's biweight rejects past chi^2_1(1 - 1e-5) = 19.511421.
  EXPECT_GT(rho("tukey", 1.0, 1, 19.5)[1], 0.0);
  EXPECT_EQ(rho("tukey", 1.0, 1, 19.52)[1], 0.0);
}

TEST_F(BuiltinsTest, NoDegreesOfFreedomNoLoss) {
  const double delta = 1.0;
  for (const LossType* type : registry_.losses()) {
    const auto loss = type->make_loss(&delta, 0);
    if (loss == nullptr) continue;
    std::array<double, 3> values{};
    loss->Evaluate(0.0, values.data());
    EXPECT_EQ(values[0], 0.0) << type->name;
  }
}

}  // namespace
}  // namespace plumbline
