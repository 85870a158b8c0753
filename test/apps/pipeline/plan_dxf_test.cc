#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/pipeline/plan_dxf.h>

#include <string>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string Drawing(const std::string& entities,
                    const std::string& unit = "6") {
  return "999\nby hand\n0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n" + unit +
         "\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n" + entities +
         "0\nENDSEC\n0\nEOF\n";
}

std::string Line(const std::string& layer, const std::string& x1,
                 const std::string& y1, const std::string& x2,
                 const std::string& y2) {
  return "0\nLINE\n8\n" + layer + "\n10\n" + x1 + "\n20\n" + y1 +
         "\n30\n0\n11\n" + x2 + "\n21\n" + y2 + "\n31\n0\n";
}

std::vector<PlanLine> ReadLines(const std::string& text,
                                const std::vector<std::string>& layers = {},
                                std::vector<std::string>* notes = nullptr) {
  return ReadPlanDxf(text, "plan.dxf", layers, notes);
}

std::string WhyNot(const std::string& text) {
  return Refusal([&] { ReadLines(text); });
}

TEST(PlanDxfTest, ReadsLinesInMetres) {
  std::vector<std::string> notes;
  std::vector<PlanLine> lines = ReadLines(
      Drawing(Line("A-WALL-EXT", "1000", "2000", "4000", "2500"), "4"), {},
      &notes);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].begin, Eigen::Vector2d(1.0, 2.0));
  EXPECT_EQ(lines[0].end, Eigen::Vector2d(4.0, 2.5));
  EXPECT_EQ(lines[0].layer, "A-WALL-EXT");
  EXPECT_THAT(notes, IsEmpty());
  lines = ReadLines(Drawing(Line("walls", "0", "0", "10", "0"), "2"));
  EXPECT_NEAR(lines[0].end.x(), 3.048, 1e-9);
  lines = ReadLines(Drawing(Line("walls", "0", "0", "100", "0"), "1"));
  EXPECT_NEAR(lines[0].end.x(), 2.54, 1e-9);
  lines = ReadLines(Drawing(Line("walls", "0", "0", "250", "0"), "5"));
  EXPECT_NEAR(lines[0].end.x(), 2.5, 1e-9);
  lines =
      ReadLines(Drawing(Line("walls", "0", "0", "10", "0"), "0"), {}, &notes);
  EXPECT_EQ(lines[0].end.x(), 10.0);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("no unit")));
}

TEST(PlanDxfTest, KnowsTheUnitsOfBuildings) {
  const auto metres = [](const std::string& unit) {
    return ReadLines(Drawing(Line("walls", "0", "0", "6000", "0"), unit))[0]
        .end.x();
  };
  EXPECT_NEAR(metres("10"), 5486.4, 1e-9);  // yards
  EXPECT_NEAR(metres("14"), 600.0, 1e-9);   // decimetres
  // Feet, inches and yards of surveys in the United States.
  EXPECT_NEAR(metres("21"), 1828.8036576, 1e-6);
  EXPECT_NEAR(metres("22"), 152.4003048, 1e-6);
  EXPECT_NEAR(metres("23"), 5486.4109728, 1e-6);
  const auto refusal = [](const std::string& unit) {
    return WhyNot(Drawing(Line("walls", "0", "0", "1", "0"), unit));
  };
  // Miles, angstroms, light years, and what nobody knows.
  for (const char* unit : {"3", "11", "19", "24", "25", "-1"}) {
    EXPECT_THAT(refusal(unit), HasSubstr("no unit of a building")) << unit;
  }
}

// In millimetres, but it says metres: that is told where it is placed, by what
// the map says.
TEST(PlanDxfTest, ALargeBuildingInAnotherUnitIsRead) {
  std::string entities;
  for (int i = 0; i < 20; ++i) {
    const std::string y = std::to_string(1000 * i);
    entities += Line("WALLS", "0", y, "9000", y);
  }
  EXPECT_EQ(ReadLines(Drawing(entities)).size(), 20u);
}

TEST(PlanDxfTest, ReadsPolylines) {
  // Closed, the second side an arc; then an old one that is open.
  const std::vector<PlanLine> lines = ReadLines(
      Drawing("0\nLWPOLYLINE\n8\nWALLS\n90\n3\n70\n1\n10\n0\n20\n0\n10\n4"
              "\n20\n0\n42\n0.5\n"
              "10\n4\n20\n3\n"
              "0\nPOLYLINE\n8\nWALLS\n66\n1\n70\n0\n10\n0\n20\n0\n"
              "0\nVERTEX\n8\n0\n10\n1\n20\n1\n0\nVERTEX\n8\n0\n10\n6\n20\n"
              "1\n0\nSEQEND\n"));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].end, Eigen::Vector2d(4.0, 0.0));
  EXPECT_EQ(lines[1].begin, Eigen::Vector2d(4.0, 3.0));
  EXPECT_EQ(lines[1].end, Eigen::Vector2d(0.0, 0.0));
  EXPECT_EQ(lines[2].begin, Eigen::Vector2d(1.0, 1.0));
  EXPECT_EQ(lines[2].end, Eigen::Vector2d(6.0, 1.0));
}

// Commands that mirror turn a polyline over: its points are in a system whose x
// points the other way. Those of a line are in the drawing's.
TEST(PlanDxfTest, WhatIsSeenFromBelowLiesWhereItIsDrawn) {
  const auto normal = [](const std::string& x, const std::string& y,
                         const std::string& z) {
    return "210\n" + x + "\n220\n" + y + "\n230\n" + z + "\n";
  };
  const auto new_one = [](const std::string& plane) {
    return "0\nLWPOLYLINE\n8\nWALLS\n10\n1\n20\n2\n10\n4\n20\n3\n" + plane;
  };
  const auto old_one = [](const std::string& flags, const std::string& plane) {
    return "0\nPOLYLINE\n8\nWALLS\n70\n" + flags + "\n" + plane +
           "0\nVERTEX\n10\n1\n20\n2\n0\nVERTEX\n10\n4\n20\n3\n0\nSEQEND\n8\n"
           "0\n";
  };
  const std::string below = normal("0", "0", "-1");
  std::vector<std::string> notes;
  for (const std::string& polyline : {new_one(below), old_one("0", below),
                                      new_one(normal("1e-17", "0", "-2"))}) {
    const std::vector<PlanLine> lines =
        ReadLines(Drawing(polyline + new_one("")), {}, &notes);
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines[0].begin, Eigen::Vector2d(-1.0, 2.0));
    EXPECT_EQ(lines[0].end, Eigen::Vector2d(-4.0, 3.0));
    EXPECT_EQ(lines[1].begin, Eigen::Vector2d(1.0, 2.0));
  }
  for (const std::string& polyline :
       {new_one(normal("0", "0", "1")), new_one(normal("0", "0", "0")),
        old_one("8", below),
        Line("WALLS", "1", "2", "4", "3") + normal("0", "0", "-1"),
        Line("WALLS", "1", "2", "4", "3") + normal("0", "1", "0")}) {
    const std::vector<PlanLine> lines =
        ReadLines(Drawing(polyline), {}, &notes);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_EQ(lines[0].begin, Eigen::Vector2d(1.0, 2.0));
    EXPECT_EQ(lines[0].end, Eigen::Vector2d(4.0, 3.0));
  }
  EXPECT_THAT(notes, IsEmpty());

  const std::vector<PlanLine> lines =
      ReadLines(Drawing(new_one(normal("0", "1", "0")) +
                        old_one("0", normal("0.1", "0", "-1")) + new_one("")),
                {}, &notes);
  EXPECT_EQ(lines.size(), 1u);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("2 polylines of the plan are not")));
}

TEST(PlanDxfTest, LayersAreChosen) {
  const std::string text = Drawing(
      Line("WALLS", "0", "0", "1", "0") + Line("DOORS", "0", "0", "2", "0") +
      Line("Door-2", "0", "0", "3", "0") + "0\nINSERT\n8\nWALLS\n2\nchair\n");
  std::vector<std::string> notes;
  EXPECT_EQ(ReadLines(text, {}, &notes).size(), 1u);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("1 blocks")));
  EXPECT_EQ(ReadLines(text, {"door*"}).size(), 2u);
  EXPECT_EQ(ReadLines(text, {"walls", "DOORS"}).size(), 2u);
  EXPECT_EQ(ReadLines(text, {"*"}).size(), 3u);
  EXPECT_THAT(Refusal([&] { ReadLines(text, {"WALL"}); }),
              HasSubstr("DOORS (1 lines), Door-2 (1 lines), WALLS (1 lines)"));
}

TEST(PlanDxfTest, SaysWhatThereIsInPlaceOfLines) {
  const std::string arc = "0\nARC\n8\nWALL\n10\n1\n20\n2\n40\n1\n";
  const std::string block = "0\nINSERT\n8\n0\n2\nroom\n";
  // One piece, an arc.
  const std::string bulge =
      "0\nLWPOLYLINE\n8\nWALL\n10\n0\n20\n0\n42\n1\n10\n4\n20\n0\n";
  const std::string tilted =
      "0\nLWPOLYLINE\n8\nWALL\n210\n1\n10\n0\n20\n0\n10\n4\n20\n0\n";
  EXPECT_THAT(WhyNot(Drawing(arc + bulge + block + block)),
              HasSubstr("has no lines at all; it has 0 (2 blocks), WALL (2 "
                        "arcs): expected walls that are drawn as LINE"));
  EXPECT_THAT(WhyNot(Drawing(tilted)),
              HasSubstr("WALL (1 polylines in tilted planes)"));
  EXPECT_THAT(WhyNot(Drawing("")), HasSubstr("has no lines at all: expected"));
  EXPECT_THAT(
      WhyNot(Drawing(arc + Line("OTHER", "0", "0", "1", "0"))),
      HasSubstr("on the layers that are read (only 1 arcs); it has OTHER (1 "
                "lines): expected --plan_layers"));
  // What is drawn on paper is none of it.
  EXPECT_THAT(WhyNot(Drawing(arc + "67\n1\n")),
              HasSubstr("has no lines at all: expected"));
}

TEST(PlanDxfTest, RefusesWhatIsNone) {
  EXPECT_THAT(WhyNot(""), HasSubstr("has no sections"));
  EXPECT_THAT(WhyNot("FLASER 2 1 2\n"),
              HasSubstr("plan.dxf:1: 'FLASER 2 1 2'"));
  EXPECT_THAT(WhyNot("AutoCAD Binary DXF\r\n\x1a"), HasSubstr("binary"));
  EXPECT_THAT(WhyNot("AC1027"), HasSubstr("DWG"));
  EXPECT_THAT(WhyNot(Drawing("")), HasSubstr("no lines at all"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "0", "0.1", "0"))),
              HasSubstr("less than 0.3 m"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "zero", "1", "0"))),
              HasSubstr("'zero' is no coordinate"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "nan", "1", "0"))),
              HasSubstr("is no coordinate"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "0", "1e9", "0"))),
              HasSubstr("absurdly far"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "0", "1e9", "0"))),
              HasSubstr("$INSUNITS"));
  EXPECT_THAT(WhyNot(Drawing(Line("WALLS", "0", "0", "1", "0"), "3")),
              HasSubstr("no unit of a building"));
}

// Cut anywhere it is refused: what is missing may be walls.
TEST(PlanDxfTest, CutAnywhere) {
  const std::string text = Drawing(Line("WALLS", "0", "0", "5", "0") +
                                   Line("WALLS", "0", "0", "0", "5"));
  // The last line may be without its end.
  for (std::size_t size = 0; size + 1 < text.size(); ++size) {
    EXPECT_THROW(ReadLines(text.substr(0, size)), Error) << size;
  }
  EXPECT_EQ(ReadLines(text.substr(0, text.size() - 1)).size(), 2u);
  EXPECT_EQ(ReadLines(text + "\n\n").size(), 2u);
}

TEST(PlanDxfTest, ADrawingThatBreaksOffIsRefused) {
  const std::string line = Line("WALLS", "0", "0", "5", "0");
  const std::string begin = "0\nSECTION\n2\nENTITIES\n" + line;
  EXPECT_THAT(WhyNot(begin), HasSubstr("plan.dxf:20: breaks off in section "
                                       "ENTITIES: expected ENDSEC"));
  EXPECT_THAT(WhyNot(begin + "0\nEOF\n"),
              HasSubstr("plan.dxf:22: breaks off in section ENTITIES"));
  EXPECT_THAT(WhyNot(begin + "0\nENDSEC\n"),
              HasSubstr("plan.dxf:22: breaks off: expected EOF"));
  EXPECT_THAT(WhyNot(begin + "0\nLINE\n8\n"), HasSubstr("breaks off"));
  EXPECT_EQ(WhyNot(begin + "0\nENDSEC\n0\nEOF"), "accepted");
}

}  // namespace
}  // namespace plumbline
