#include <plumbline/core/atomic_file.h>
#include <plumbline/core/number_text.h>
#include <plumbline/outputs/floor_plan_dxf.h>

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
  for (const Pose2& pose : plan.path) add(pose.head<2>());
  if (!((*low)[0] <= (*high)[0])) {
    add(Vector2d::Zero());
    add(Vector2d::Ones());
  }
}

struct Layer {
  std::string name;
  int color = 7;
  int weight = kWallWeight;
  bool is_frozen = false;
};

std::vector<Layer> Layers(const FloorPlan& plan) {
  std::vector<Layer> layers = {{"0", 7, kThinWeight, false}};
  constexpr int kColors = sizeof(kDirectionColors) / sizeof(int);
  for (int i = 0; i < static_cast<int>(plan.directions.size()); ++i) {
    layers.push_back({FloorPlanLayerName(plan, i),
                      kDirectionColors[i % kColors], kWallWeight, false});
  }
  layers.push_back(
      {FloorPlanLayerName(plan, -1), kOtherColor, kThinWeight, false});
  layers.push_back({kSolidLayer, kSolidColor, kThinWeight, false});
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
                 const Vector2d& high, Writer* writer) {
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
  writer->EndTable();

  table = writer->BeginTable("BLOCK_RECORD", 2, kBlockTable);
  writer->BeginEntry("BLOCK_RECORD", table, "AcDbBlockTableRecord",
                     "*Model_Space", kModelSpace);
  writer->BeginEntry("BLOCK_RECORD", table, "AcDbBlockTableRecord",
                     "*Paper_Space", kPaperSpace);
  writer->EndTable();
  writer->EndSection();
}

void WriteBlocks(Writer* writer) {
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
  writer->EndSection();
}

void WriteEntities(const FloorPlan& plan, Writer* writer) {
  writer->BeginSection("ENTITIES");
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
  WriteHeader(low, high, &writer);
  WriteTables(plan, low, high, &writer);
  WriteBlocks(&writer);
  WriteEntities(plan, &writer);
  WriteObjects(&writer);
  writer.Text(0, "EOF");
}

void WriteFloorPlanDxf(const FloorPlan& plan, const std::string& path) {
  WriteFileAtomically(
      path, [&plan](std::ostream& output) { WriteFloorPlanDxf(plan, output); });
}

}  // namespace plumbline
