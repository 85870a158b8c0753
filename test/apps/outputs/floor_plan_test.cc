#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/floor_plan.h>
#include <plumbline/outputs/floor_plan_dxf.h>
#include <plumbline/outputs/floor_plan_geojson.h>
#include <plumbline/outputs/floor_plan_svg.h>
#include <plumbline/outputs/map_json.h>
#include <plumbline/outputs/rooms_csv.h>

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>
#ifdef PLUMBLINE_TEST_DXFLIB
#include <dxflib/dl_creationadapter.h>
#include <dxflib/dl_dxf.h>
#endif

namespace plumbline {
namespace {

using Eigen::Vector2d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class FloorPlanTest : public ::testing::Test {
 protected:
  FloorPlanTest() { RegisterBuiltinRelations(&registry_); }

  // A face seen from the left on the way from (x1, y1) to (x2, y2).
  FeatureId AddWall(double x1, double y1, double x2, double y2,
                    FeatureId orientation = kNoId) {
    Feature feature;
    feature.type = &registry_.GetFeature("segment");
    feature.parameters = {x1, y1, std::atan2(y2 - y1, x2 - x1)};
    feature.extent_end = std::hypot(x2 - x1, y2 - y1);
    const FeatureId id = Add(feature);
    if (orientation != kNoId) {
      Tie("segment_orientation", id, orientation, 0.0);
    }
    return id;
  }

  FeatureId AddOrientation(double degrees) {
    Feature feature;
    feature.type = &registry_.GetFeature("orientation");
    feature.level = 1;
    feature.is_virtual = true;
    feature.parameters = {DegToRad(degrees)};
    return Add(feature);
  }

  void Tie(const std::string& relation, FeatureId a, FeatureId b,
           double expected) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = {a, b};
    constraint.expected = Eigen::VectorXd::Constant(1, expected);
    constraint.information = Eigen::MatrixXd::Identity(1, 1);
    constraint.kind = ConstraintClass::kStructure;
    Transaction transaction;
    transaction.AddConstraint(constraint);
    graph_.Apply(std::move(transaction));
  }

  FeatureId Add(const Feature& feature) {
    Transaction transaction;
    transaction.AddFeature(feature);
    return graph_.Apply(std::move(transaction)).features[0];
  }

  FloorPlan Plan() { return MakeFloorPlan(graph_, {}); }

  static void ExpectWall(const FloorPlanWall& wall, double x1, double y1,
                         double x2, double y2) {
    EXPECT_NEAR(wall.begin[0], x1, 1e-9);
    EXPECT_NEAR(wall.begin[1], y1, 1e-9);
    EXPECT_NEAR(wall.end[0], x2, 1e-9);
    EXPECT_NEAR(wall.end[1], y2, 1e-9);
  }

  // Two rooms' worth of everything that a plan can hold.
  FloorPlan Sample() {
    const FeatureId level = AddOrientation(0.0);
    const FeatureId upright = AddOrientation(90.0);
    AddWall(0, 0, 8, 0, level);
    AddWall(8, 0, 8, 6, upright);
    AddWall(4, -0.2, 0, -0.2, level);
    AddWall(1, 3, 2, 4);
    Feature column;
    column.type = &registry_.GetFeature("circle");
    column.parameters = {5.0, 3.0, 0.25};
    Add(column);
    FloorPlan plan = MakeFloorPlan(
        graph_, {Pose2(1, 1, 0), Pose2(1.01, 1, 0), Pose2(2, 1, 0)});
    plan.title = "a <b> & \"c\"";
    return plan;
  }

  Registry registry_;
  Graph graph_;
};

TEST_F(FloorPlanTest, WallSeenTwiceIsOne) {
  // 4 m and 2 m of wall, 6 cm apart: the line is a third of the way over.
  const FeatureId a = AddWall(0, 0, 4, 0);
  const FeatureId b = AddWall(1, 0.06, 3, 0.06);
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 1u);
  ExpectWall(plan.walls[0], 0, 0.02, 4, 0.02);
  EXPECT_THAT(plan.walls[0].features, ElementsAre(a, b));
  EXPECT_EQ(plan.walls[0].direction, -1);
}

TEST_F(FloorPlanTest, PiecesInLineAreOneUpToAGap) {
  AddWall(0, 0, 2, 0);
  AddWall(2.2, 0, 4, 0);
  AddWall(4.9, 0, 6, 0);  // a door between
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 2u);
  ExpectWall(plan.walls[0], 0, 0, 4, 0);
  ExpectWall(plan.walls[1], 4.9, 0, 6, 0);
}

TEST_F(FloorPlanTest, SetBackDoorStaysWhereItIs) {
  AddWall(0, 0, 2, 0);
  AddWall(2.05, -0.08, 2.95, -0.08);
  AddWall(3, 0, 5, 0);
  EXPECT_EQ(Plan().walls.size(), 3u);
}

TEST_F(FloorPlanTest, TwoFacesAreOneWallWithAThickness) {
  AddWall(0, 0.1, 4, 0.1);
  AddWall(3, 0, 1, 0);
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 2u);
  ASSERT_EQ(plan.solids.size(), 1u);
  const Vector2d corners[] = {{1, 0.1}, {3, 0.1}, {3, 0}, {1, 0}};
  for (int i = 0; i < 4; ++i) {
    EXPECT_LT((plan.solids[0][i] - corners[i]).norm(), 1e-9) << i;
  }
}

TEST_F(FloorPlanTest, ACorridorIsNoWall) {
  // The room is between the faces.
  AddWall(4, 0.3, 0, 0.3);
  AddWall(0, 0, 4, 0);
  EXPECT_TRUE(Plan().solids.empty());
  // Nor are faces that are too far apart.
  AddWall(0, 5, 4, 5);
  AddWall(4, 4.5, 0, 4.5);
  EXPECT_TRUE(Plan().solids.empty());
}

TEST_F(FloorPlanTest, EndsThatMeetAreJoined) {
  // One ends short of the corner, the other goes past it.
  AddWall(0, 0, 3.9, 0);
  AddWall(4, -0.2, 4, 3);
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 2u);
  ExpectWall(plan.walls[0], 0, 0, 4, 0);
  ExpectWall(plan.walls[1], 4, 0, 4, 3);
}

TEST_F(FloorPlanTest, EndThatMeetsAWallStopsThere) {
  AddWall(0, 0, 4, 0);
  AddWall(2, 0.25, 2, 3);
  AddWall(3, 0.5, 3, 3);  // too far
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 3u);
  ExpectWall(plan.walls[0], 0, 0, 4, 0);
  ExpectWall(plan.walls[1], 2, 0, 2, 3);
  ExpectWall(plan.walls[2], 3, 0.5, 3, 3);
}

TEST_F(FloorPlanTest, WallsThatCrossKeepTheLongerPart) {
  AddWall(0, 0, 4, 0);
  AddWall(2, -0.31, 2, 0.28);  // crosses: the longer part stays
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 2u);
  ExpectWall(plan.walls[1], 2, -0.31, 2, 0);
}

TEST_F(FloorPlanTest, SharedDirectionsAreExact) {
  const FeatureId a = AddOrientation(1.0);
  const FeatureId b = AddOrientation(90.97);
  Tie("orientation_orientation", a, b, DegToRad(90.0));
  AddWall(0, 0, 10, 0.2, a);  // 1.15 degrees
  AddWall(20, 0, 20, 5, b);
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.directions.size(), 2u);
  EXPECT_NEAR(plan.directions[0], DegToRad(1.0), 1e-12);
  EXPECT_NEAR(plan.directions[1], DegToRad(91.0), 1e-12);
  EXPECT_EQ(FloorPlanLayerName(plan, 0), "WALLS-1-1.0DEG");
  EXPECT_EQ(FloorPlanLayerName(plan, 1), "WALLS-2-91.0DEG");
  EXPECT_EQ(FloorPlanLayerName(plan, -1), "WALLS-OTHER");
  for (const FloorPlanWall& wall : plan.walls) {
    const Vector2d along = (wall.end - wall.begin).normalized();
    const double direction = plan.directions[wall.direction];
    EXPECT_NEAR(std::abs(along[0] * std::cos(direction) +
                         along[1] * std::sin(direction)),
                1.0, 1e-12);
  }
  // Turned about its middle.
  EXPECT_LT(
      (0.5 * (plan.walls[0].begin + plan.walls[0].end) - Vector2d(5.0, 0.1))
          .norm(),
      1e-9);
}

TEST_F(FloorPlanTest, BrokenRelationsSquareNothing) {
  const FeatureId a = AddOrientation(0.0);
  const FeatureId b = AddOrientation(88.0);
  Tie("orientation_orientation", a, b, DegToRad(90.0));
  AddWall(0, 0, 10, 0, a);
  AddWall(20, 0, 20, 5, b);
  Transaction transaction;
  transaction.BreakConstraint(0);
  graph_.Apply(std::move(transaction));
  EXPECT_NEAR(Plan().directions[1], DegToRad(88.0), 1e-12);
}

TEST_F(FloorPlanTest, SameFarFromTheOrigin) {
  AddWall(0, 0, 4, 0);
  AddWall(1, 0.06, 3, 0.06);
  AddWall(4.1, 0.1, 4.1, 3);
  const FloorPlan near = Plan();
  Graph far;
  Transaction transaction;
  for (const Feature* feature : std::as_const(graph_).Features()) {
    Feature moved = *feature;
    moved.id = kNoId;
    moved.parameters[0] += 10000.0;
    moved.parameters[1] -= 10000.0;
    transaction.AddFeature(moved);
  }
  far.Apply(std::move(transaction));
  const FloorPlan moved = MakeFloorPlan(far, {});
  ASSERT_EQ(moved.walls.size(), near.walls.size());
  for (std::size_t i = 0; i < near.walls.size(); ++i) {
    const Vector2d shift(10000.0, -10000.0);
    EXPECT_LT((moved.walls[i].begin - near.walls[i].begin - shift).norm(),
              1e-8);
    EXPECT_LT((moved.walls[i].end - near.walls[i].end - shift).norm(), 1e-8);
  }
}

TEST_F(FloorPlanTest, LinesKnowNoSide) {
  // The same line twice, described from either end: d = y cos(alpha) - x
  // sin(alpha).
  for (const double alpha : {0.0, kPi}) {
    Feature line;
    line.type = &registry_.GetFeature("line");
    line.parameters = {alpha == 0.0 ? 1.0 : -1.0, alpha};
    line.extent_begin = -2.0;
    line.extent_end = 2.0;
    Add(line);
  }
  const FloorPlan plan = Plan();
  ASSERT_EQ(plan.walls.size(), 1u);
  EXPECT_EQ(plan.walls[0].features.size(), 2u);
  EXPECT_NEAR(plan.walls[0].begin[1], 1.0, 1e-9);
  EXPECT_TRUE(plan.solids.empty());
}

TEST_F(FloorPlanTest, WhatIsNoPlaceIsPassedOver) {
  AddWall(0, 0, 4, 0);
  AddWall(1e9, 0, 1e9, 4);
  AddWall(0, 0, 2e4, 0);  // 20 km of wall
  AddWall(5, 5, 5.1, 5);  // too short to be shown
  for (Feature* feature : graph_.MutableFeatures()) {
    if (feature->id == 3) feature->parameters[0] = std::nan("");
  }
  FloorPlan plan = MakeFloorPlan(
      graph_, {Pose2(std::nan(""), 0, 0), Pose2(0, 0, 0), Pose2(1e9, 0, 0)});
  EXPECT_EQ(plan.walls.size(), 1u);
  EXPECT_EQ(plan.path.size(), 1u);
}

// -- Files --------------------------------------------------------------------

// A room and a corridor with a door between them.
FloorPlan PlanWithRooms() {
  FloorPlan plan;
  plan.directions = {0.0};
  plan.walls.resize(2);
  plan.walls[0].end = {4.0, 0.0};
  plan.walls[0].direction = 0;
  plan.walls[1].begin = {30.0, 0.0};
  plan.walls[1].end = {34.0, 0.0};
  plan.walls[1].direction = 0;
  plan.building.rooms.resize(2);
  PlanRoom& corridor = plan.building.rooms[0];
  corridor.outline.shell = {{0, -2}, {20, -2}, {20, 0}, {0, 0}};
  corridor.kind = PlanRoom::Kind::kCorridor;
  corridor.area = 40.0;
  corridor.is_entered = true;
  corridor.neighbors = {1};
  PlanRoom& room = plan.building.rooms[1];
  room.outline.shell = {{0, 0.2}, {5, 0.2}, {5, 4.2}, {0, 4.2}};
  room.area = 20.0;
  room.neighbors = {0};
  PlanDoor door;
  door.begin = {1.0, 0.1};
  door.end = {1.9, 0.1};
  door.thickness = 0.2;
  door.rooms = {1, 0};
  door.is_driven = true;
  plan.building.doors = {door};
  door.begin = {18.0, 0.1};
  door.end = {18.8, 0.1};
  door.rooms = {-1, 0};
  door.is_driven = false;
  plan.building.doors.push_back(door);
  plan.building.walls = {{{0, 0.1}, {1, 0.1}, 0.1, 0.1},
                         {{1.9, 0.1}, {18.0, 0.1}, 0.1, 0.1}};
  return plan;
}

std::string Dxf(const FloorPlan& plan) {
  std::ostringstream text;
  WriteFloorPlanDxf(plan, text);
  return text.str();
}
std::string Svg(const FloorPlan& plan) {
  std::ostringstream text;
  WriteFloorPlanSvg(plan, text);
  return text.str();
}
std::string GeoJson(const FloorPlan& plan) {
  std::ostringstream text;
  WriteFloorPlanGeoJson(plan, text);
  return text.str();
}

// Codes and values of a DXF file.
std::vector<std::pair<int, std::string>> Groups(const std::string& dxf) {
  std::vector<std::pair<int, std::string>> groups;
  std::istringstream lines(dxf);
  std::string code, value;
  while (std::getline(lines, code)) {
    EXPECT_TRUE(std::getline(lines, value)) << "no value behind " << code;
    groups.push_back({std::stoi(code), value});
  }
  return groups;
}

void ExpectWholeDxf(const FloorPlan& plan) {
  const auto groups = Groups(Dxf(plan));
  std::vector<std::string> sections;
  std::set<std::string> handles;
  std::set<std::string> owners;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (groups[i] == std::make_pair(0, std::string("SECTION"))) {
      sections.push_back(groups[i + 1].second);
    }
    // $HANDSEED is the handle to come.
    const bool is_seed = i > 0 && groups[i - 1].second == "$HANDSEED";
    if ((groups[i].first == 5 && !is_seed) || groups[i].first == 105) {
      EXPECT_TRUE(handles.insert(groups[i].second).second)
          << groups[i].second << " twice";
    }
    if (groups[i].first == 330) owners.insert(groups[i].second);
  }
  EXPECT_THAT(sections,
              ElementsAre("HEADER", "TABLES", "BLOCKS", "ENTITIES", "OBJECTS"));
  owners.erase("0");
  for (const std::string& owner : owners) {
    EXPECT_EQ(handles.count(owner), 1u) << "owner " << owner;
  }
  EXPECT_EQ(groups.back(), std::make_pair(0, std::string("EOF")));
}

TEST_F(FloorPlanTest, DxfHasItsPartsInOrderAndHandlesOnce) {
  ExpectWholeDxf(Sample());
  ExpectWholeDxf(PlanWithRooms());
}

TEST_F(FloorPlanTest, GeoJsonOfRooms) {
  const auto json = nlohmann::json::parse(GeoJson(PlanWithRooms()));
  std::map<std::string, std::vector<nlohmann::json>> of_kind;
  for (const auto& feature : json["features"]) {
    of_kind[feature["properties"]["kind"]].push_back(feature);
  }
  ASSERT_EQ(of_kind["room"].size(), 1u);
  ASSERT_EQ(of_kind["corridor"].size(), 1u);
  ASSERT_EQ(of_kind["door"].size(), 2u);
  ASSERT_EQ(of_kind["wall"].size(), 2u);
  EXPECT_EQ(of_kind["face"].size(), 2u);
  const auto& corridor = of_kind["corridor"][0];
  EXPECT_EQ(corridor["properties"]["id"], 1);
  EXPECT_EQ(corridor["properties"]["area_m2"], 40.0);
  EXPECT_EQ(corridor["properties"]["entered"], true);
  EXPECT_EQ(corridor["properties"]["neighbors"], nlohmann::json({2}));
  EXPECT_EQ(corridor["geometry"]["coordinates"][0].size(), 5u);
  const auto& door = of_kind["door"][0]["properties"];
  EXPECT_EQ(door["id"], 1);
  EXPECT_EQ(door["width_m"], 0.9);
  EXPECT_EQ(door["rooms"], nlohmann::json({2, 1}));
  EXPECT_EQ(door["driven"], true);
  EXPECT_EQ(of_kind["door"][1]["properties"]["rooms"],
            nlohmann::json({nullptr, 1}));
  const auto& wall = of_kind["wall"][0];
  EXPECT_EQ(wall["properties"]["thickness_m"], 0.2);
  EXPECT_EQ(wall["geometry"]["coordinates"][0][0],
            nlohmann::json::parse("[0.0, 0.0]"));
}

TEST_F(FloorPlanTest, SvgOfRooms) {
  const std::string svg = Svg(PlanWithRooms());
  EXPECT_THAT(svg, HasSubstr("<path data-room=\"2\""));
  EXPECT_THAT(svg, HasSubstr(">20.0 m\u00b2</text>"));
  EXPECT_THAT(svg, HasSubstr("<g id=\"WALLS\""));
  EXPECT_THAT(svg, HasSubstr("<g id=\"room-dimensions\""));
  // The face at the wall of the corridor is shown by it, the other is not.
  EXPECT_THAT(svg, HasSubstr("x1=\"30.0000\""));
  EXPECT_THAT(svg, Not(HasSubstr("x2=\"4.0000\"")));
}

TEST_F(FloorPlanTest, SvgWithoutScrapsFarOutside) {
  const auto svg_with = [](double length, double y) {
    FloorPlan plan = PlanWithRooms();
    FloorPlanWall wall;
    wall.begin = {3.0, y};
    wall.end = {3.0 + length, y};
    wall.features = {4711};
    plan.walls.push_back(wall);
    return Svg(plan);
  };
  const std::string feature = "data-features=\"4711\"";
  EXPECT_THAT(svg_with(1.4, 60.0), Not(HasSubstr(feature)));
  EXPECT_THAT(svg_with(1.4, 60.0), HasSubstr("Scale 1:100;"));
  EXPECT_THAT(svg_with(1.6, 60.0), HasSubstr(feature));
  EXPECT_THAT(svg_with(1.6, 60.0), Not(HasSubstr("Scale 1:100;")));
  EXPECT_THAT(svg_with(1.4, 7.0), HasSubstr(feature));
  // Without a building nothing is outside of it.
  FloorPlan plan;
  plan.walls.resize(2);
  plan.walls[0].end = {5.0, 0.0};
  plan.walls[1].begin = {50.0, 0.0};
  plan.walls[1].end = {50.5, 0.0};
  plan.walls[1].features = {4711};
  EXPECT_THAT(Svg(plan), HasSubstr(feature));
}

TEST_F(FloorPlanTest, MapJsonOfRooms) {
  Feature wall;
  wall.type = &registry_.GetFeature("segment");
  wall.parameters = {1.0, 2.0, 0.5};
  wall.extent_end = 4.0;
  Transaction transaction;
  transaction.AddFeature(wall);
  graph_.Apply(std::move(transaction));
  FloorPlan plan = PlanWithRooms();
  plan.building.rooms[1].outline.holes = {{{1, 1}, {1, 2}, {2, 2}}};
  std::ostringstream text;
  WriteMapJson(graph_, nullptr, &plan.building, nullptr, text);
  const auto json = nlohmann::json::parse(text.str());
  ASSERT_EQ(json["rooms"].size(), 2u);
  const auto& corridor = json["rooms"][0];
  EXPECT_EQ(corridor["id"], 1);
  EXPECT_EQ(corridor["kind"], "corridor");
  EXPECT_EQ(corridor["area_m2"], 40.0);
  EXPECT_EQ(corridor["entered"], true);
  EXPECT_EQ(corridor["outline"].size(), 4u);
  EXPECT_EQ(corridor["outline"][1], nlohmann::json::parse("[20.0, -2.0]"));
  EXPECT_EQ(corridor["neighbors"], nlohmann::json({2}));
  EXPECT_EQ(corridor["doors"], nlohmann::json({1, 2}));
  EXPECT_EQ(json["rooms"][1]["holes"][0].size(), 3u);
  EXPECT_EQ(json["rooms"][1]["doors"], nlohmann::json({1}));
  ASSERT_EQ(json["doors"].size(), 2u);
  EXPECT_EQ(json["doors"][0]["id"], 1);
  EXPECT_EQ(json["doors"][0]["width_m"], 0.9);
  EXPECT_EQ(json["doors"][0]["thickness_m"], 0.2);
  EXPECT_EQ(json["doors"][0]["begin"], nlohmann::json::parse("[1.0, 0.1]"));
  EXPECT_EQ(json["doors"][0]["rooms"], nlohmann::json({2, 1}));
  EXPECT_EQ(json["doors"][0]["driven"], true);
  EXPECT_EQ(json["doors"][1]["rooms"], nlohmann::json({nullptr, 1}));
  // The graph is read as ever, and written without a plan as ever.
  Graph again;
  std::istringstream input(text.str());
  ReadGraphJson(input, "map.json", registry_, &again);
  ASSERT_EQ(again.num_features(), 1);
  EXPECT_EQ(again.Features()[0]->parameters[2], 0.5);
  std::ostringstream plain, without;
  WriteGraphJson(graph_, plain);
  WriteMapJson(graph_, nullptr, nullptr, nullptr, without);
  EXPECT_EQ(without.str(), plain.str());
  // Looked for in vain.
  const BuildingPlan none;
  std::ostringstream empty;
  WriteMapJson(graph_, nullptr, &none, nullptr, empty);
  EXPECT_EQ(nlohmann::json::parse(empty.str())["rooms"],
            nlohmann::json::array());
}

TEST_F(FloorPlanTest, TableOfRooms) {
  std::ostringstream text;
  WriteRoomsCsv(PlanWithRooms().building, text);
  EXPECT_THAT(text.str(),
              ::testing::StartsWith(
                  "room,kind,area_m2,x_m,y_m,entered,doors,neighbors\n"
                  "1,corridor,40.00,"));
  EXPECT_THAT(text.str(), HasSubstr(",1,2,2\n2,room,20.00,"));
}

#ifdef PLUMBLINE_TEST_DXFLIB
// What another project's reader sees.
class DxfReader : public DL_CreationAdapter {
 public:
  void addLayer(const DL_LayerData& data) override {
    layers[data.name] = data.flags;
  }
  void addLine(const DL_LineData& data) override {
    lines[attributes.getLayer()].push_back(
        {data.x1, data.y1, data.x2, data.y2});
  }
  void addCircle(const DL_CircleData& data) override {
    circles[attributes.getLayer()].push_back({data.cx, data.cy, data.radius});
  }
  void addSolid(const DL_SolidData& data) override {
    solids[attributes.getLayer()].push_back({data.x[0], data.y[0], data.x[1],
                                             data.y[1], data.x[2], data.y[2],
                                             data.x[3], data.y[3]});
  }
  void addPolyline(const DL_PolylineData&) override {
    ++polylines[attributes.getLayer()];
  }
  void addVertex(const DL_VertexData&) override { ++vertices; }
  void addArc(const DL_ArcData& data) override {
    arcs[attributes.getLayer()].push_back(
        {data.cx, data.cy, data.radius, data.angle1, data.angle2});
  }
  void addText(const DL_TextData& data) override {
    texts[attributes.getLayer()].push_back(data.text);
  }
  void addDimAlign(const DL_DimensionData&,
                   const DL_DimAlignedData& data) override {
    dimensions[attributes.getLayer()].push_back(
        std::hypot(data.epx2 - data.epx1, data.epy2 - data.epy1));
  }
  void setVariableInt(const std::string& key, int value, int) override {
    variables[key] = value;
  }
  using DL_CreationAdapter::setVariableInt;
  void setVariableDouble(const std::string& key, double value, int) override {
    numbers[key] = value;
  }
  using DL_CreationAdapter::setVariableDouble;
  void setVariableVector(const std::string& key, double x, double y, double,
                         int) override {
    vectors[key] = {x, y};
  }
  using DL_CreationAdapter::setVariableVector;

  std::map<std::string, int> layers;
  std::map<std::string, std::vector<std::vector<double>>> lines, circles,
      solids;
  std::map<std::string, std::vector<std::vector<double>>> arcs;
  std::map<std::string, std::vector<std::string>> texts;
  std::map<std::string, std::vector<double>> dimensions;
  std::map<std::string, int> polylines;
  int vertices = 0;
  std::map<std::string, int> variables;
  std::map<std::string, double> numbers;
  std::map<std::string, std::vector<double>> vectors;
};

TEST_F(FloorPlanTest, DxflibReadsRooms) {
  std::istringstream text(Dxf(PlanWithRooms()));
  DxfReader reader;
  DL_Dxf dxf;
  ASSERT_TRUE(dxf.in(text, &reader));
  EXPECT_EQ(reader.polylines["ROOMS"], 2);
  EXPECT_EQ(reader.polylines["WALLS"], 2);
  EXPECT_EQ(reader.layers["WALLS"], 0);
  EXPECT_EQ(reader.layers["WALLS-1-0.0DEG"], 1);  // frozen
  using Numbers = std::vector<std::vector<double>>;
  EXPECT_EQ(reader.lines["DOORS"],
            (Numbers{{1, 0.1, 1, 1}, {18, 0.1, 18, 0.9}}));
  ASSERT_EQ(reader.arcs["DOORS"].size(), 2u);
  EXPECT_NEAR(reader.arcs["DOORS"][0][2], 0.9, 1e-9);
  EXPECT_EQ(reader.texts["ROOMS"],
            (std::vector<std::string>{"1", "40.00 m2", "2", "20.00 m2"}));
  const std::vector<double> lengths = reader.dimensions["DIMENSIONS"];
  ASSERT_EQ(lengths.size(), 4u);
  EXPECT_NEAR(lengths[0], 20.0, 1e-6);
  EXPECT_NEAR(lengths[1], 2.0, 1e-6);
  EXPECT_NEAR(lengths[2], 5.0, 1e-6);
  EXPECT_NEAR(lengths[3], 4.0, 1e-6);
}

// A passage has no leaf, and what was seen through a window is not measured.
TEST_F(FloorPlanTest, PassagesAndDimensionsOfABuilding) {
  FloorPlan plan = PlanWithRooms();
  const std::string before = Svg(plan);
  EXPECT_THAT(before, Not(HasSubstr("stroke-dasharray")));
  plan.building.doors[0].end =
      plan.building.doors[0].begin + Eigen::Vector2d(0.0, 2.0);
  FloorPlanWall beyond;
  beyond.begin = {60.0, 0.0};
  beyond.end = {60.0, 5.0};
  plan.walls.push_back(beyond);
  const std::string svg = Svg(plan);
  EXPECT_THAT(svg, HasSubstr("stroke-dasharray"));
  const auto of_building = [](const std::string& text) {
    const auto begin = text.find("<g id=\"dimensions\"");
    const auto end = text.find(" m</text>", begin);
    return text.substr(text.rfind('>', end), end - text.rfind('>', end));
  };
  EXPECT_EQ(of_building(svg), of_building(before));
  DxfReader reader;
  DL_Dxf dxf;
  std::istringstream drawing(Dxf(plan));
  ASSERT_TRUE(dxf.in(drawing, &reader));
  EXPECT_EQ(reader.arcs["DOORS"].size(), 1u);
  EXPECT_EQ(reader.lines["DOORS"].size(), 2u);
}

// LibreCAD takes what the header does not say for millimetres: it printed the
// lengths of rooms as thousandths, too small to be read.
TEST_F(FloorPlanTest, DimensionsOfTheDxfAreMetresAndLegible) {
  std::istringstream text(Dxf(PlanWithRooms()));
  DxfReader reader;
  DL_Dxf dxf;
  ASSERT_TRUE(dxf.in(text, &reader));
  ASSERT_EQ(reader.numbers.count("$DIMLFAC"), 1u);
  EXPECT_EQ(reader.numbers["$DIMLFAC"], 1.0);
  EXPECT_EQ(reader.numbers["$DIMSCALE"], 1.0);
  EXPECT_GE(reader.numbers["$DIMTXT"], 0.1);
  EXPECT_LE(reader.numbers["$DIMTXT"], 0.3);
  EXPECT_GT(reader.numbers["$DIMTSZ"], 0.0);
  for (const char* name : {"$DIMGAP", "$DIMASZ", "$DIMEXO", "$DIMEXE"}) {
    ASSERT_EQ(reader.numbers.count(name), 1u) << name;
    EXPECT_LE(reader.numbers[name], 0.1) << name;
  }
  EXPECT_EQ(reader.variables["$DIMDEC"], 2);
}

TEST_F(FloorPlanTest, PaperOfTheDxfStandsAsThePlanDoes) {
  FloorPlan plan;
  plan.walls.resize(1);
  plan.walls[0].end = {3.0, 4.0};
  std::ostringstream text;
  WriteFloorPlanDxf(plan, text);
  std::istringstream input(text.str());
  DxfReader reader;
  DL_Dxf dxf;
  ASSERT_TRUE(dxf.in(input, &reader));
  EXPECT_EQ(reader.vectors["$PLIMMAX"], (std::vector<double>{0.297, 0.42}));
}

TEST_F(FloorPlanTest, DxflibReadsTheDxf) {
  const FloorPlan plan = Sample();
  std::istringstream text(Dxf(plan));
  DxfReader reader;
  DL_Dxf dxf;
  ASSERT_TRUE(dxf.in(text, &reader));
  EXPECT_EQ(reader.variables["$INSUNITS"], 6);
  // A3, lying, in metres.
  EXPECT_EQ(reader.vectors["$PLIMMIN"], (std::vector<double>{0, 0}));
  EXPECT_EQ(reader.vectors["$PLIMMAX"], (std::vector<double>{0.42, 0.297}));
  ASSERT_EQ(reader.layers.count("WALLS-1-0.0DEG"), 1u);
  EXPECT_EQ(reader.layers["WALLS-1-0.0DEG"], 0);
  EXPECT_EQ(reader.layers["ROBOT-PATH"], 1);  // frozen
  using Numbers = std::vector<std::vector<double>>;
  EXPECT_EQ(reader.lines["WALLS-1-0.0DEG"],
            (Numbers{{0, 0, 8, 0}, {4, -0.2, 0, -0.2}}));
  EXPECT_EQ(reader.lines["WALLS-2-90.0DEG"], (Numbers{{8, 0, 8, 6}}));
  EXPECT_EQ(reader.lines["WALLS-OTHER"], (Numbers{{1, 3, 2, 4}}));
  EXPECT_EQ(reader.circles["COLUMNS"], (Numbers{{5, 3, 0.25}}));
  // Third and fourth corner the other way round.
  EXPECT_EQ(reader.solids["WALL-SOLID"],
            (Numbers{{0, 0, 4, 0, 0, -0.2, 4, -0.2}}));
  EXPECT_EQ(reader.polylines["ROBOT-PATH"], 1);
  EXPECT_EQ(reader.vertices, 2);
}
#else
TEST_F(FloorPlanTest, DxflibReadsTheDxf) {
  GTEST_SKIP() << "built without libdxflib-dev";
}
#endif

// The value of an attribute in the first element that `start` is found in.
std::string Attribute(const std::string& xml, const std::string& start,
                      const std::string& name) {
  const std::size_t element = xml.find(start);
  EXPECT_NE(element, std::string::npos) << start;
  const std::size_t begin = xml.find(" " + name + "=\"", element);
  EXPECT_NE(begin, std::string::npos) << name;
  const std::size_t value = begin + name.size() + 3;
  return xml.substr(value, xml.find('"', value) - value);
}

TEST_F(FloorPlanTest, SvgIsToScaleAndLevel) {
  const FeatureId orientation = AddOrientation(30.0);
  const Vector2d along(std::cos(DegToRad(30.0)), std::sin(DegToRad(30.0)));
  AddWall(0, 0, 30 * along[0], 30 * along[1], orientation);
  const std::string svg = Svg(Plan());
  EXPECT_EQ(Attribute(svg, "<svg", "width"), "420mm");
  EXPECT_EQ(Attribute(svg, "<svg", "viewBox"), "0 0 420 297");
  // 30 m on 382 mm: 1 : 78.5 is needed, 1 : 100 is the next.
  EXPECT_THAT(svg, HasSubstr("1 : 100 (A3)"));
  EXPECT_THAT(svg, HasSubstr(">30.00 m<"));
  EXPECT_THAT(svg, HasSubstr("turned by -30.000 degrees"));
  double m[6];
  const std::string transform = Attribute(svg, "<g id=\"plan\"", "transform");
  ASSERT_EQ(std::sscanf(transform.c_str(), "matrix(%lf %lf %lf %lf %lf %lf)",
                        &m[0], &m[1], &m[2], &m[3], &m[4], &m[5]),
            6);
  const std::size_t group = svg.find("<g id=\"WALLS-1-30.0DEG\"");
  ASSERT_NE(group, std::string::npos);
  const std::string walls = svg.substr(group);
  Vector2d ends[2];
  for (int i = 0; i < 2; ++i) {
    const std::string n = std::to_string(i + 1);
    const double x = std::stod(Attribute(walls, "<line", "x" + n));
    const double y = std::stod(Attribute(walls, "<line", "y" + n));
    ends[i] = {m[0] * x + m[2] * y + m[4], m[1] * x + m[3] * y + m[5]};
  }
  // 300 mm of paper, level, from left to right.
  EXPECT_NEAR(ends[1][0] - ends[0][0], 300.0, 2e-3);
  EXPECT_NEAR(ends[1][1], ends[0][1], 2e-3);
  EXPECT_GT(ends[0][0], 12.0);
  EXPECT_LT(ends[1][0], 408.0);
}

TEST_F(FloorPlanTest, SvgOfATallBuildingIsTurned) {
  const FeatureId orientation = AddOrientation(90.0);
  AddWall(0, 0, 0, 60, orientation);
  AddWall(5, 0, 5, 60, orientation);
  const std::string svg = Svg(Plan());
  EXPECT_THAT(svg, HasSubstr("1 : 200 (A3)"));
  EXPECT_THAT(svg, HasSubstr(">60.00 m<"));
  EXPECT_THAT(svg, HasSubstr(">5.00 m<"));
}

TEST_F(FloorPlanTest, SvgEscapesTheTitle) {
  const std::string svg = Svg(Sample());
  EXPECT_THAT(svg, HasSubstr("a &lt;b&gt; &amp; &quot;c&quot;"));
  EXPECT_THAT(svg, HasSubstr("<g id=\"COLUMNS\""));
  EXPECT_THAT(svg, HasSubstr("<polygon points="));
}

TEST_F(FloorPlanTest, GeoJsonSaysThatItIsLocal) {
  const auto json = nlohmann::json::parse(GeoJson(Sample()));
  EXPECT_EQ(json["type"], "FeatureCollection");
  EXPECT_EQ(json["coordinate_reference"]["type"], "local");
  EXPECT_EQ(json["coordinate_reference"]["unit"], "metre");
  EXPECT_EQ(json["name"], "a <b> & \"c\"");
  ASSERT_EQ(json["features"].size(), 6u);
  const auto& wall = json["features"][0];
  EXPECT_EQ(wall["geometry"]["type"], "LineString");
  EXPECT_EQ(wall["geometry"]["coordinates"],
            nlohmann::json::parse("[[0.0, 0.0], [8.0, 0.0]]"));
  EXPECT_EQ(wall["properties"]["layer"], "WALLS-1-0.0DEG");
  EXPECT_EQ(wall["properties"]["length_m"], 8.0);
  EXPECT_EQ(wall["properties"]["features"], nlohmann::json::parse("[2]"));
  // Seen from the other side: the same direction, not 180 degrees.
  EXPECT_EQ(json["features"][2]["properties"]["direction_deg"], 0.0);
  EXPECT_EQ(json["features"][3]["properties"]["direction_deg"], 45.0);
  const auto& ring = json["features"][4]["geometry"]["coordinates"][0];
  ASSERT_EQ(ring.size(), 5u);
  EXPECT_EQ(ring[0], ring[4]);
  double doubled_area = 0.0;
  for (int i = 0; i < 4; ++i) {
    doubled_area += ring[i][0].get<double>() * ring[i + 1][1].get<double>() -
                    ring[i][1].get<double>() * ring[i + 1][0].get<double>();
  }
  EXPECT_NEAR(doubled_area, 2 * 4 * 0.2, 1e-9);  // against the clock
  EXPECT_EQ(json["features"][5]["properties"]["radius_m"], 0.25);
}

TEST_F(FloorPlanTest, EmptyPlanIsAFileAllTheSame) {
  const FloorPlan plan = Plan();
  EXPECT_TRUE(plan.walls.empty());
  EXPECT_EQ(Groups(Dxf(plan)).back().second, "EOF");
  EXPECT_THAT(Svg(plan), HasSubstr("</svg>"));
  EXPECT_EQ(nlohmann::json::parse(GeoJson(plan))["features"].size(), 0u);
}

TEST_F(FloorPlanTest, SameBytesEveryTime) {
  const FloorPlan plan = Sample();
  EXPECT_EQ(Dxf(plan), Dxf(plan));
  EXPECT_EQ(Svg(plan), Svg(plan));
  EXPECT_EQ(GeoJson(plan), GeoJson(plan));
  EXPECT_THROW(WriteFloorPlanDxf(plan, "/no/such/folder/a.dxf"), Error);
  EXPECT_THROW(WriteFloorPlanSvg(plan, "/no/such/folder/a.svg"), Error);
  EXPECT_THROW(WriteFloorPlanGeoJson(plan, "/no/such/folder/a.geojson"), Error);
}

}  // namespace
}  // namespace plumbline
