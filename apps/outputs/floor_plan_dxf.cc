#include <plumbline/core/atomic_file.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/floor_plan_dxf.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Numbers of AutoCAD's colour table that can be seen on black and on white.
constexpr int kDirectionColors[] = {150, 30, 92, 210, 40, 130, 20, 60};
constexpr int kOtherColor = 8;
constexpr int kSolidColor = 253;
constexpr int kColumnColor = 40;
constexpr int kPathColor = 9;
// A3, m.
constexpr double kPaperLongSide = 0.42;
constexpr double kPaperShortSide = 0.297;
// Hundredths of a millimetre on paper.
constexpr int kWallWeight = 35;
constexpr int kThinWeight = 13;
constexpr char kSolidLayer[] = "WALL-SOLID";
constexpr char kColumnLayer[] = "COLUMNS";
constexpr char kPathLayer[] = "ROBOT-PATH";
constexpr char kRoomLayer[] = "ROOMS";
constexpr char kWallLayer[] = "WALLS";
constexpr char kDoorLayer[] = "DOORS";
constexpr char kDimensionLayer[] = "DIMENSIONS";
constexpr int kRoomColor = 140;
constexpr int kBodyColor = 7;
constexpr int kDoorColor = 30;
constexpr int kDimensionColor = 8;
// m.
constexpr double kTextHeight = 0.25;
constexpr double kDimensionText = 0.15;
constexpr double kDimensionGap = 0.045;
// After the point.
constexpr int kDimensionDigits = 2;
constexpr double kTick = 0.1;

// Writes groups (a code and a value, a line each) and hands out handles.
class Writer {
 public:
  explicit Writer(std::ostream& output) : output_(output) {}

  void Text(int code, const std::string& value) {
    output_ << code << '\n' << value << '\n';
  }
  void Int(int code, int value) { output_ << code << '\n' << value << '\n'; }
  void Real(int code, double value) {
    std::string text;
    AppendFixed(value, 6, &text);  // to a micrometre
    Text(code, text);
  }
  void Point(int code, const Vector2d& point) {
    Real(code, point[0]);
    Real(code + 10, point[1]);
  }
  void Point3(int code, const Vector2d& point) {
    Point(code, point);
    Real(code + 20, 0.0);
  }
  void Handle(int code, int handle) {
    char text[16];
    std::snprintf(text, sizeof(text), "%X", static_cast<unsigned>(handle));
    Text(code, text);
  }

  int NewHandle() { return next_handle_++; }

  void BeginSection(const char* name) {
    Text(0, "SECTION");
    Text(2, name);
  }
  void EndSection() { Text(0, "ENDSEC"); }

  // Returns the table's handle, the owner of its entries.
  int BeginTable(const char* name, int entries, int handle) {
    Text(0, "TABLE");
    Text(2, name);
    Handle(5, handle);
    Handle(330, 0);
    Text(100, "AcDbSymbolTable");
    Int(70, entries);
    return handle;
  }
  void BeginEntry(const char* type, int table, const char* subclass,
                  const std::string& name, int handle) {
    Text(0, type);
    // Dimension styles have their handle elsewhere.
    Handle(std::string(type) == "DIMSTYLE" ? 105 : 5, handle);
    Handle(330, table);
    Text(100, "AcDbSymbolTableRecord");
    Text(100, subclass);
    Text(2, name);
  }
  void EndTable() { Text(0, "ENDTAB"); }

  void BeginEntity(const char* type, const std::string& layer,
                   const char* subclass, int owner) {
    Text(0, type);
    Handle(5, NewHandle());
    Handle(330, owner);
    Text(100, "AcDbEntity");
    Text(8, layer);
    Text(100, subclass);
  }

 private:
  std::ostream& output_;
  int next_handle_ = 0x100;
};

// Handles of what every drawing holds, below those handed out.
enum FixedHandle {
  kVportTable = 0x1,
  kLtypeTable,
  kLayerTable,
  kStyleTable,
  kViewTable,
  kUcsTable,
  kAppidTable,
  kDimstyleTable,
  kBlockTable,
  kModelSpace,
  kPaperSpace,
  kRootDictionary,
  kGroupDictionary,
};

void Extents(const FloorPlan& plan, Vector2d* low, Vector2d* high) {
  low->setConstant(std::numeric_limits<double>::infinity());
  *high = -*low;
  const auto add = [&](const Vector2d& point) {
    *low = low->cwiseMin(point);
    *high = high->cwiseMax(point);
  };
  for (const FloorPlanWall& wall : plan.walls) {
    add(wall.begin);
    add(wall.end);
  }
  for (const DrawnCircle& circle : plan.circles) {
    add(Vector2d(circle.x - circle.radius, circle.y - circle.radius));
    add(Vector2d(circle.x + circle.radius, circle.y + circle.radius));
  }
  for (const PlanRoom& room : plan.building.rooms) {
    for (const Vector2d& corner : room.outline.shell) add(corner);
  }
  for (const PlanWall& wall : plan.building.walls) {
    for (const Vector2d& corner : BodyOf(wall)) add(corner);
  }
  for (const Pose2& pose : plan.path) add(pose.head<2>());
  if (!((*low)[0] <= (*high)[0])) {
    add(Vector2d::Zero());
    add(Vector2d::Ones());
  }
}

// A length inside of a room from wall to wall.
struct RoomDimension {
  Vector2d from, to;
  // Of the block that draws it.
  std::string block;
  int record = 0;
};

// Two for each room, through its middle.
std::vector<RoomDimension> RoomDimensions(const FloorPlan& plan,
                                          Writer* writer) {
  std::vector<RoomDimension> dimensions;
  const double level = plan.directions.empty() ? 0.0 : plan.directions[0];
  for (const PlanRoom& room : plan.building.rooms) {
    const Vector2d middle = InnerPoint(room.outline);
    for (const double angle : {level, level + 0.5 * kPi}) {
      const Vector2d along(std::cos(angle), std::sin(angle));
      double before = -std::numeric_limits<double>::infinity();
      double after = std::numeric_limits<double>::infinity();
      const auto cut = [&](const Ring& ring) {
        for (std::size_t i = 0; i < ring.size(); ++i) {
          const Vector2d a = ring[i] - middle;
          const Vector2d b = ring[(i + 1) % ring.size()] - middle;
          const double side_a = along[0] * a[1] - along[1] * a[0];
          const double side_b = along[0] * b[1] - along[1] * b[0];
          if ((side_a > 0.0) == (side_b > 0.0)) continue;
          const double share = side_a / (side_a - side_b);
          const double t = along.dot(Vector2d(a + share * (b - a)));
          (t < 0.0 ? before : after) =
              t < 0.0 ? std::max(before, t) : std::min(after, t);
        }
      };
      cut(room.outline.shell);
      for (const Ring& hole : room.outline.holes) cut(hole);
      if (!std::isfinite(before) || !std::isfinite(after)) continue;
      RoomDimension dimension;
      // Beside the room's number.
      const Vector2d aside = 2.0 * kTextHeight * Vector2d(along[1], -along[0]);
      dimension.from = middle + before * along + aside;
      dimension.to = middle + after * along + aside;
      dimension.block = "*D" + std::to_string(dimensions.size() + 1);
      dimension.record = writer->NewHandle();
      dimensions.push_back(dimension);
    }
  }
  return dimensions;
}

struct Layer {
  std::string name;
  int color = 7;
  int weight = kWallWeight;
  bool is_frozen = false;
};

std::vector<Layer> Layers(const FloorPlan& plan) {
  std::vector<Layer> layers = {{"0", 7, kThinWeight, false}};
  // Faces as the map has them would lie on the walls of rooms.
  const bool has_rooms = !plan.building.rooms.empty();
  if (has_rooms) {
    layers.push_back({kWallLayer, kBodyColor, kWallWeight, false});
    layers.push_back({kDoorLayer, kDoorColor, kThinWeight, false});
    layers.push_back({kRoomLayer, kRoomColor, kThinWeight, false});
    layers.push_back({kDimensionLayer, kDimensionColor, kThinWeight, false});
  }
  constexpr int kColors = sizeof(kDirectionColors) / sizeof(int);
  for (int i = 0; i < static_cast<int>(plan.directions.size()); ++i) {
    layers.push_back({FloorPlanLayerName(plan, i),
                      kDirectionColors[i % kColors], kWallWeight, has_rooms});
  }
  layers.push_back(
      {FloorPlanLayerName(plan, -1), kOtherColor, kThinWeight, has_rooms});
  layers.push_back({kSolidLayer, kSolidColor, kThinWeight, has_rooms});
  layers.push_back({kColumnLayer, kColumnColor, kWallWeight, false});
  layers.push_back({kPathLayer, kPathColor, kThinWeight, true});
  return layers;
}

void WriteHeader(const Vector2d& low, const Vector2d& high, Writer* writer) {
  writer->BeginSection("HEADER");
  writer->Text(9, "$ACADVER");
  writer->Text(1, "AC1015");
  writer->Text(9, "$DWGCODEPAGE");
  writer->Text(3, "ANSI_1252");
  writer->Text(9, "$INSUNITS");
  writer->Int(70, 6);  // metres
  writer->Text(9, "$MEASUREMENT");
  writer->Int(70, 1);  // metric
  writer->Text(9, "$LUNITS");
  writer->Int(70, 2);  // decimal
  writer->Text(9, "$LUPREC");
  writer->Int(70, 3);
  // The paper, in the drawing's unit, lying or standing as the plan does: a
  // program that prints the drawing would otherwise take its own number of
  // millimetres for metres.
  Vector2d paper(kPaperLongSide, kPaperShortSide);
  const Vector2d size = high - low;
  if (size[1] > size[0]) std::swap(paper[0], paper[1]);
  writer->Text(9, "$PLIMMIN");
  writer->Point(10, Vector2d::Zero());
  writer->Text(9, "$PLIMMAX");
  writer->Point(10, paper);
  // How dimensions look. Programs that go by these and not by the table of
  // styles take what is missing for millimetres: 7.50 m would read 0.01, in
  // letters of 2.5 mm.
  const auto number = [&](const char* name, double value) {
    writer->Text(9, name);
    writer->Real(40, value);
  };
  number("$DIMLFAC", 1.0);
  number("$DIMSCALE", 1.0);
  number("$DIMTXT", kDimensionText);
  number("$DIMGAP", kDimensionGap);
  number("$DIMASZ", kTick);
  number("$DIMTSZ", 0.5 * kTick);
  number("$DIMEXO", 0.0);
  number("$DIMEXE", 0.0);
  writer->Text(9, "$DIMDEC");
  writer->Int(70, kDimensionDigits);
  writer->Text(9, "$DIMZIN");
  writer->Int(70, 0);  // 7.50, not 7.5
  writer->Text(9, "$DIMTIH");
  writer->Int(70, 0);  // along the line
  writer->Text(9, "$EXTMIN");
  writer->Point3(10, low);
  writer->Text(9, "$EXTMAX");
  writer->Point3(10, high);
  writer->Text(9, "$HANDSEED");
  // Handles are handed out as the file is written: far above any of them.
  writer->Text(5, "FFFFFFF");
  writer->EndSection();
}

void WriteTables(const FloorPlan& plan, const Vector2d& low,
                 const Vector2d& high,
                 const std::vector<RoomDimension>& dimensions, Writer* writer) {
  writer->BeginSection("TABLES");

  int table = writer->BeginTable("VPORT", 1, kVportTable);
  writer->BeginEntry("VPORT", table, "AcDbViewportTableRecord", "*ACTIVE",
                     writer->NewHandle());
  writer->Int(70, 0);
  writer->Point(10, Vector2d::Zero());
  writer->Point(11, Vector2d::Ones());
  writer->Point(12, 0.5 * (low + high));
  writer->Point3(16, Vector2d::Zero());
  writer->Point3(17, Vector2d::Zero());
  // The whole plan, whatever the window's shape.
  writer->Real(40, 1.1 * (high - low).maxCoeff());
  writer->Real(41, 1.0);
  writer->EndTable();

  table = writer->BeginTable("LTYPE", 3, kLtypeTable);
  for (const char* name : {"ByBlock", "ByLayer", "Continuous"}) {
    writer->BeginEntry("LTYPE", table, "AcDbLinetypeTableRecord", name,
                       writer->NewHandle());
    writer->Int(70, 0);
    writer->Text(3, "");
    writer->Int(72, 65);
    writer->Int(73, 0);
    writer->Real(40, 0.0);
  }
  writer->EndTable();

  const std::vector<Layer> layers = Layers(plan);
  table =
      writer->BeginTable("LAYER", static_cast<int>(layers.size()), kLayerTable);
  for (const Layer& layer : layers) {
    writer->BeginEntry("LAYER", table, "AcDbLayerTableRecord", layer.name,
                       writer->NewHandle());
    writer->Int(70, layer.is_frozen ? 1 : 0);
    writer->Int(62, layer.color);
    writer->Text(6, "Continuous");
    writer->Int(370, layer.weight);
  }
  writer->EndTable();

  table = writer->BeginTable("STYLE", 1, kStyleTable);
  writer->BeginEntry("STYLE", table, "AcDbTextStyleTableRecord", "Standard",
                     writer->NewHandle());
  writer->Int(70, 0);
  writer->Real(40, 0.0);
  writer->Real(41, 1.0);
  writer->Real(50, 0.0);
  writer->Int(71, 0);
  writer->Real(42, 0.2);
  writer->Text(3, "txt");
  writer->Text(4, "");
  writer->EndTable();

  writer->BeginTable("VIEW", 0, kViewTable);
  writer->EndTable();
  writer->BeginTable("UCS", 0, kUcsTable);
  writer->EndTable();

  table = writer->BeginTable("APPID", 1, kAppidTable);
  writer->BeginEntry("APPID", table, "AcDbRegAppTableRecord", "ACAD",
                     writer->NewHandle());
  writer->Int(70, 0);
  writer->EndTable();

  table = writer->BeginTable("DIMSTYLE", 1, kDimstyleTable);
  writer->Text(100, "AcDbDimStyleTable");
  writer->Int(71, 0);
  writer->BeginEntry("DIMSTYLE", table, "AcDbDimStyleTableRecord", "Standard",
                     writer->NewHandle());
  writer->Int(70, 0);
  writer->Real(41, kTick);
  writer->Real(140, kDimensionText);
  writer->Real(144, 1.0);  // of what is measured
  writer->Real(147, kDimensionGap);
  writer->Int(271, kDimensionDigits);
  writer->EndTable();

  table = writer->BeginTable(
      "BLOCK_RECORD", 2 + static_cast<int>(dimensions.size()), kBlockTable);
  writer->BeginEntry("BLOCK_RECORD", table, "AcDbBlockTableRecord",
                     "*Model_Space", kModelSpace);
  writer->BeginEntry("BLOCK_RECORD", table, "AcDbBlockTableRecord",
                     "*Paper_Space", kPaperSpace);
  for (const RoomDimension& dimension : dimensions) {
    writer->BeginEntry("BLOCK_RECORD", table, "AcDbBlockTableRecord",
                       dimension.block, dimension.record);
  }
  writer->EndTable();
  writer->EndSection();
}

void WriteLine(const Vector2d& from, const Vector2d& to,
               const std::string& layer, int owner, Writer* writer) {
  writer->BeginEntity("LINE", layer, "AcDbLine", owner);
  writer->Point3(10, from);
  writer->Point3(11, to);
}

// A line of text about a point.
void WriteText(const Vector2d& middle, double height, double degrees,
               const std::string& text, const std::string& layer, int owner,
               Writer* writer) {
  writer->BeginEntity("TEXT", layer, "AcDbText", owner);
  writer->Point3(10, middle);
  writer->Real(40, height);
  writer->Text(1, text);
  writer->Real(50, degrees);
  writer->Int(72, 1);
  writer->Point3(11, middle);
  writer->Text(100, "AcDbText");
  writer->Int(73, 2);
}

// Of lines that are read from below or from the right, degrees.
double ReadingAngle(const Vector2d& along) {
  double degrees = RadToDeg(std::atan2(along[1], along[0]));
  if (degrees > 90.0) degrees -= 180.0;
  if (degrees <= -90.0) degrees += 180.0;
  return degrees;
}

std::string TwoDigits(double value) {
  std::string text;
  AppendFixed(value, 2, &text);
  return text;
}

Vector2d TextPlace(const RoomDimension& dimension) {
  const double angle = DegToRad(ReadingAngle(dimension.to - dimension.from));
  return 0.75 * dimension.from + 0.25 * dimension.to +
         0.8 * kDimensionText * Vector2d(-std::sin(angle), std::cos(angle));
}

// What a program shows that does not draw dimensions itself.
void WriteDimensionBlock(const RoomDimension& dimension, Writer* writer) {
  const Vector2d along = (dimension.to - dimension.from).normalized();
  const Vector2d tick = 0.5 * kTick * (along + Vector2d(-along[1], along[0]));
  writer->BeginEntity("BLOCK", kDimensionLayer, "AcDbBlockBegin",
                      dimension.record);
  writer->Text(2, dimension.block);
  writer->Int(70, 1);  // anonymous
  writer->Point3(10, Vector2d::Zero());
  writer->Text(3, dimension.block);
  writer->Text(1, "");
  WriteLine(dimension.from, dimension.to, kDimensionLayer, dimension.record,
            writer);
  for (const Vector2d& end : {dimension.from, dimension.to}) {
    WriteLine(end - tick, end + tick, kDimensionLayer, dimension.record,
              writer);
  }
  WriteText(TextPlace(dimension), kDimensionText, ReadingAngle(along),
            TwoDigits((dimension.to - dimension.from).norm()), kDimensionLayer,
            dimension.record, writer);
  writer->BeginEntity("ENDBLK", kDimensionLayer, "AcDbBlockEnd",
                      dimension.record);
}

void WriteDimension(const RoomDimension& dimension, Writer* writer) {
  writer->BeginEntity("DIMENSION", kDimensionLayer, "AcDbDimension",
                      kModelSpace);
  writer->Text(2, dimension.block);
  writer->Point3(10, dimension.to);
  writer->Point3(11, TextPlace(dimension));
  writer->Int(70, 1 + 32);  // aligned, its block is its own
  writer->Text(1, "");
  writer->Int(71, 5);
  writer->Text(3, "Standard");
  writer->Text(100, "AcDbAlignedDimension");
  writer->Point3(13, dimension.from);
  writer->Point3(14, dimension.to);
}

void WriteRing(const Ring& ring, const char* layer, Writer* writer) {
  writer->BeginEntity("LWPOLYLINE", layer, "AcDbPolyline", kModelSpace);
  writer->Int(90, static_cast<int>(ring.size()));
  writer->Int(70, 1);  // closed
  for (const Vector2d& corner : ring) writer->Point(10, corner);
}

// A leaf that stands open, hinged at the first jamb, and the way of its edge; a
// line from jamb to jamb where no leaf is that wide.
void WriteDoor(const PlanDoor& door, Writer* writer) {
  if (door.is_passage()) {
    WriteLine(door.begin, door.end, kDoorLayer, kModelSpace, writer);
    return;
  }
  const Vector2d across = door.end - door.begin;
  const Vector2d leaf = door.begin + Vector2d(-across[1], across[0]);
  WriteLine(door.begin, leaf, kDoorLayer, kModelSpace, writer);
  const double degrees = RadToDeg(std::atan2(across[1], across[0]));
  writer->BeginEntity("ARC", kDoorLayer, "AcDbCircle", kModelSpace);
  writer->Point3(10, door.begin);
  writer->Real(40, door.width());
  writer->Text(100, "AcDbArc");
  writer->Real(50, degrees < 0.0 ? degrees + 360.0 : degrees);
  writer->Real(51, degrees < -90.0 ? degrees + 450.0 : degrees + 90.0);
}

void WriteBuilding(const FloorPlan& plan,
                   const std::vector<RoomDimension>& dimensions,
                   Writer* writer) {
  for (std::size_t i = 0; i < plan.building.rooms.size(); ++i) {
    const PlanRoom& room = plan.building.rooms[i];
    WriteRing(room.outline.shell, kRoomLayer, writer);
    for (const Ring& hole : room.outline.holes) {
      WriteRing(hole, kRoomLayer, writer);
    }
    const Vector2d middle = InnerPoint(room.outline);
    WriteText(middle + Vector2d(0.0, 0.7 * kTextHeight), kTextHeight, 0.0,
              std::to_string(i + 1), kRoomLayer, kModelSpace, writer);
    WriteText(middle - Vector2d(0.0, 0.7 * kTextHeight), 0.8 * kTextHeight, 0.0,
              TwoDigits(room.area) + " m2", kRoomLayer, kModelSpace, writer);
  }
  for (const PlanWall& wall : plan.building.walls) {
    WriteRing(BodyOf(wall), kWallLayer, writer);
  }
  for (const PlanDoor& door : plan.building.doors) WriteDoor(door, writer);
  for (const RoomDimension& dimension : dimensions) {
    WriteDimension(dimension, writer);
  }
}

void WriteBlocks(const std::vector<RoomDimension>& dimensions, Writer* writer) {
  writer->BeginSection("BLOCKS");
  for (const int space : {kModelSpace, kPaperSpace}) {
    const std::string name =
        space == kModelSpace ? "*Model_Space" : "*Paper_Space";
    writer->BeginEntity("BLOCK", "0", "AcDbBlockBegin", space);
    writer->Text(2, name);
    writer->Int(70, 0);
    writer->Point3(10, Vector2d::Zero());
    writer->Text(3, name);
    writer->Text(1, "");
    writer->BeginEntity("ENDBLK", "0", "AcDbBlockEnd", space);
  }
  for (const RoomDimension& dimension : dimensions) {
    WriteDimensionBlock(dimension, writer);
  }
  writer->EndSection();
}

void WriteEntities(const FloorPlan& plan,
                   const std::vector<RoomDimension>& dimensions,
                   Writer* writer) {
  writer->BeginSection("ENTITIES");
  WriteBuilding(plan, dimensions, writer);
  // First what lies under the walls.
  for (const auto& solid : plan.solids) {
    writer->BeginEntity("SOLID", kSolidLayer, "AcDbTrace", kModelSpace);
    writer->Point3(10, solid[0]);
    writer->Point3(11, solid[1]);
    // The third and fourth corners of a SOLID stand the other way round.
    writer->Point3(12, solid[3]);
    writer->Point3(13, solid[2]);
  }
  if (plan.path.size() > 1) {
    writer->BeginEntity("LWPOLYLINE", kPathLayer, "AcDbPolyline", kModelSpace);
    writer->Int(90, static_cast<int>(plan.path.size()));
    writer->Int(70, 0);
    for (const Pose2& pose : plan.path) writer->Point(10, pose.head<2>());
  }
  for (const FloorPlanWall& wall : plan.walls) {
    writer->BeginEntity("LINE", FloorPlanLayerName(plan, wall.direction),
                        "AcDbLine", kModelSpace);
    writer->Point3(10, wall.begin);
    writer->Point3(11, wall.end);
  }
  for (const DrawnCircle& circle : plan.circles) {
    writer->BeginEntity("CIRCLE", kColumnLayer, "AcDbCircle", kModelSpace);
    writer->Point3(10, Vector2d(circle.x, circle.y));
    writer->Real(40, circle.radius);
  }
  writer->EndSection();
}

void WriteObjects(Writer* writer) {
  writer->BeginSection("OBJECTS");
  writer->Text(0, "DICTIONARY");
  writer->Handle(5, kRootDictionary);
  writer->Handle(330, 0);
  writer->Text(100, "AcDbDictionary");
  writer->Int(281, 1);
  writer->Text(3, "ACAD_GROUP");
  writer->Handle(350, kGroupDictionary);
  writer->Text(0, "DICTIONARY");
  writer->Handle(5, kGroupDictionary);
  writer->Handle(330, kRootDictionary);
  writer->Text(100, "AcDbDictionary");
  writer->Int(281, 1);
  writer->EndSection();
}

}  // namespace

void WriteFloorPlanDxf(const FloorPlan& plan, std::ostream& output) {
  Vector2d low, high;
  Extents(plan, &low, &high);
  Writer writer(output);
  writer.Text(999, "Floor plan by plumbline, metres");
  const std::vector<RoomDimension> dimensions = RoomDimensions(plan, &writer);
  WriteHeader(low, high, &writer);
  WriteTables(plan, low, high, dimensions, &writer);
  WriteBlocks(dimensions, &writer);
  WriteEntities(plan, dimensions, &writer);
  WriteObjects(&writer);
  writer.Text(0, "EOF");
}

void WriteFloorPlanDxf(const FloorPlan& plan, const std::string& path) {
  WriteFileAtomically(
      path, [&plan](std::ostream& output) { WriteFloorPlanDxf(plan, output); });
}

}  // namespace plumbline
