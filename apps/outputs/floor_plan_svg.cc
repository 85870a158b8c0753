#include <plumbline/core/atomic_file.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/xml_text.h>
#include <plumbline/outputs/floor_plan_svg.h>
#include <plumbline/outputs/map_layout.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

// All of the page in mm: A3, lying or standing.
constexpr double kLongSide = 420.0;
constexpr double kShortSide = 297.0;
constexpr double kMargin = 12.0;
// Between the plan and the margin: dimension lines.
constexpr double kDimensionRoom = 16.0;
constexpr double kDimensionOffset = 9.0;
// Below the plan.
constexpr double kTitleRoom = 22.0;
// As thick as 7 cm of wall, within these.
constexpr double kThickStroke = 0.35;
constexpr double kThinStroke = 0.13;

constexpr double kScales[] = {20,    25,    50,   75,   100,   125,   150,
                              200,   250,   300,  400,  500,   750,   1000,
                              1250,  1500,  2000, 2500, 5000,  10000, 20000,
                              25000, 50000, 1e5,  2e5,  2.5e5, 5e5};

struct Box {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = Vector2d::Constant(-std::numeric_limits<double>::infinity());

  void Add(const Vector2d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Vector2d size() const { return high - low; }
};

// Bounds of the rooms and their walls, turned by `rotation`, m.
Box BuildingBounds(const FloorPlan& plan, const Matrix2d& rotation) {
  Box box;
  for (const PlanRoom& room : plan.building.rooms) {
    for (const Vector2d& corner : room.outline.shell) {
      box.Add(rotation * corner);
    }
  }
  for (const PlanWall& wall : plan.building.walls) {
    for (const Vector2d& corner : BodyOf(wall)) box.Add(rotation * corner);
  }
  return box;
}

// Whether a wall is a scrap seen through a window, far outside of the building
// (its bounds, turned by `rotation`): it would make the drawing small.
bool IsScrap(const FloorPlanWall& wall, const Box& building,
             const Matrix2d& rotation) {
  // m.
  constexpr double kLength = 1.5;
  constexpr double kAround = 3.0;
  if ((wall.end - wall.begin).norm() > kLength) return false;
  const Vector2d middle = rotation * (0.5 * (wall.begin + wall.end));
  return !((middle - building.low).minCoeff() > -kAround &&
           (building.high - middle).minCoeff() > -kAround);
}

// Bounds of all that is drawn, turned by `rotation`, m.
Box BoundsOf(const FloorPlan& plan, const Matrix2d& rotation) {
  Box box = BuildingBounds(plan, rotation);
  const Box building = box;
  for (const FloorPlanWall& wall : plan.walls) {
    if (!plan.building.rooms.empty() && IsScrap(wall, building, rotation)) {
      continue;
    }
    box.Add(rotation * wall.begin);
    box.Add(rotation * wall.end);
  }
  for (const DrawnCircle& circle : plan.circles) {
    const Vector2d center = rotation * Vector2d(circle.x, circle.y);
    box.Add(center - Vector2d::Constant(circle.radius));
    box.Add(center + Vector2d::Constant(circle.radius));
  }
  for (const Pose2& pose : plan.path) box.Add(rotation * pose.head<2>());
  if (!(box.low[0] <= box.high[0])) {
    box.Add(Vector2d::Zero());
    box.Add(Vector2d::Ones());
  }
  return box;
}

// Where the plan goes on the sheet.
struct Sheet {
  double width = kLongSide;
  double height = kShortSide;
  double scale = 1.0;  // 1 : scale
  double turn = 0.0;   // rad, of the map on the paper
  Matrix2d rotation = Matrix2d::Identity();
  Box bounds;  // of the turned map, m
  // What is measured: the building without what was seen through its windows.
  Box measured;
  double left = 0.0;
  double top = 0.0;

  double PerMetre() const { return 1000.0 / scale; }  // mm
  double WallStroke() const {
    return std::clamp(0.07 * PerMetre(), 1.4 * kThinStroke, kThickStroke);
  }
  Vector2d OnPaper(const Vector2d& point) const {
    const Vector2d turned = rotation * point;
    return {left + PerMetre() * (turned[0] - bounds.low[0]),
            top + PerMetre() * (bounds.high[1] - turned[1])};
  }
  double plan_width() const { return bounds.size()[0] * PerMetre(); }
  double plan_height() const { return bounds.size()[1] * PerMetre(); }
  double MeasuredBottom() const {
    return top + PerMetre() * (bounds.high[1] - measured.low[1]);
  }
};

double FittingScale(const Vector2d& size, double width, double height) {
  const double room_x = width - 2.0 * kMargin - kDimensionRoom;
  const double room_y = height - 2.0 * kMargin - kDimensionRoom - kTitleRoom;
  const double needed = 1000.0 * std::max(size[0] / room_x, size[1] / room_y);
  for (const double scale : kScales) {
    if (scale >= needed) return scale;
  }
  // No customary scale: the next power of ten.
  return std::pow(10.0, std::ceil(std::log10(needed)));
}

Sheet MakeSheet(const FloorPlan& plan) {
  Sheet best;
  best.scale = std::numeric_limits<double>::infinity();
  const double level = plan.directions.empty() ? 0.0 : plan.directions[0];
  for (const bool is_upright : {false, true}) {
    Sheet sheet;
    // By the smaller turn of the two that make the direction level.
    sheet.turn = -NormalizeAxial(level + (is_upright ? 0.5 * kPi : 0.0));
    sheet.rotation << std::cos(sheet.turn), -std::sin(sheet.turn),
        std::sin(sheet.turn), std::cos(sheet.turn);
    sheet.bounds = BoundsOf(plan, sheet.rotation);
    sheet.measured = plan.building.rooms.empty()
                         ? sheet.bounds
                         : BuildingBounds(plan, sheet.rotation);
    sheet.scale = FittingScale(sheet.bounds.size(), sheet.width, sheet.height);
    const bool is_nearer = sheet.scale == best.scale &&
                           std::abs(sheet.turn) < std::abs(best.turn) - 1e-9;
    if (sheet.scale < best.scale || is_nearer) best = sheet;
  }
  // In the middle of what margins, dimensions and title leave.
  best.left =
      kMargin + kDimensionRoom +
      0.5 * (best.width - 2.0 * kMargin - kDimensionRoom - best.plan_width());
  best.top = kMargin + 0.5 * (best.height - 2.0 * kMargin - kDimensionRoom -
                              kTitleRoom - best.plan_height());
  return best;
}

std::string Number(double value, int decimals) {
  std::string text;
  AppendFixed(value, decimals, &text);
  return text;
}

// In mm of paper.
std::string Mm(double value) { return Number(value, 3); }
// In metres of the map: to a tenth of a millimetre.
std::string Metres(double value) { return Number(value, 4); }

std::string Line(double x1, double y1, double x2, double y2) {
  return "<line x1=\"" + Mm(x1) + "\" y1=\"" + Mm(y1) + "\" x2=\"" + Mm(x2) +
         "\" y2=\"" + Mm(y2) + "\"/>\n";
}

std::string Text(double x, double y, double size, const char* anchor,
                 const std::string& text, const std::string& more = "") {
  return "<text x=\"" + Mm(x) + "\" y=\"" + Mm(y) + "\" font-size=\"" +
         Mm(size) + "\" text-anchor=\"" + anchor + "\"" + more + ">" +
         EscapeXml(text) + "</text>\n";
}

// A dimension line with strokes at its ends, level.
std::string Dimension(double x1, double x2, double y, const std::string& text) {
  std::string svg = Line(x1 - 2.0, y, x2 + 2.0, y);
  for (const double x : {x1, x2}) {
    svg += Line(x, y - kDimensionOffset + 2.0, x, y + 2.0);
    svg += Line(x - 1.0, y + 1.0, x + 1.0, y - 1.0);
  }
  return svg + Text(0.5 * (x1 + x2), y - 1.2, 3.0, "middle", text,
                    " stroke=\"none\"");
}

// A polygon of the plan as data of a path, m.
std::string PathData(const Ring& ring) {
  std::string data;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    data +=
        (i == 0 ? "M" : " L") + Metres(ring[i][0]) + " " + Metres(ring[i][1]);
  }
  return data + " Z";
}

// Tints that neighbors in the list do not share.
constexpr const char* kRoomTints[] = {"#dbe9f6", "#e6f2dc", "#fbeed5",
                                      "#f3e1ec", "#e2e4f5", "#ddf0ee",
                                      "#f5efd8"};
constexpr char kCorridorTint[] = "#f0f0f0";

std::string TintOf(const BuildingPlan& building, std::size_t room) {
  constexpr std::size_t kTints = sizeof(kRoomTints) / sizeof(kRoomTints[0]);
  return building.rooms[room].kind == PlanRoom::Kind::kCorridor
             ? kCorridorTint
             : kRoomTints[room % kTints];
}

// Rooms under the walls, then the walls and the doors between them.
std::string BuildingGroups(const FloorPlan& plan, double thin) {
  const BuildingPlan& building = plan.building;
  if (building.rooms.empty()) return "";
  std::string svg = "<g id=\"ROOMS\" stroke=\"none\" fill-rule=\"evenodd\">\n";
  for (std::size_t i = 0; i < building.rooms.size(); ++i) {
    const PlanRoom& room = building.rooms[i];
    svg += "<path data-room=\"" + std::to_string(i + 1) + "\" fill=\"" +
           TintOf(building, i) + "\" d=\"" + PathData(room.outline.shell);
    for (const Ring& hole : room.outline.holes) svg += " " + PathData(hole);
    svg += "\"/>\n";
  }
  svg += "</g>\n<g id=\"WALLS\" fill=\"#222222\" stroke=\"none\">\n";
  for (const PlanWall& wall : building.walls) {
    svg += "<path d=\"" + PathData(BodyOf(wall)) + "\"/>\n";
  }
  svg += "</g>\n<g id=\"DOORS\" stroke=\"#8a5a2b\" stroke-width=\"" +
         Number(thin, 6) + "\">\n";
  for (const PlanDoor& door : building.doors) {
    if (door.is_passage()) {
      svg += "<path stroke-dasharray=\"0.15 0.15\" d=\"M" +
             Metres(door.begin[0]) + " " + Metres(door.begin[1]) + " L" +
             Metres(door.end[0]) + " " + Metres(door.end[1]) + "\"/>\n";
      continue;
    }
    // The leaf stands open, hinged at the first jamb, on the side of a room
    // rather than of a corridor.
    const Vector2d across = door.end - door.begin;
    const int left = door.rooms[0];
    const bool opens_left =
        left >= 0 && building.rooms[static_cast<std::size_t>(left)].kind ==
                         PlanRoom::Kind::kRoom;
    const Vector2d leaf = door.begin + (opens_left ? 1.0 : -1.0) *
                                           Vector2d(-across[1], across[0]);
    const std::string width = Metres(door.width());
    svg += "<path d=\"M" + Metres(leaf[0]) + " " + Metres(leaf[1]) + " L" +
           Metres(door.begin[0]) + " " + Metres(door.begin[1]) + " M" +
           Metres(leaf[0]) + " " + Metres(leaf[1]) + " A" + width + " " +
           width + " 0 0 " + (opens_left ? "0 " : "1 ") + Metres(door.end[0]) +
           " " + Metres(door.end[1]) + "\"/>\n";
  }
  return svg + "</g>\n";
}

// Numbers and areas of rooms, upright on the paper.
std::string RoomLabels(const FloorPlan& plan, const Sheet& sheet) {
  if (plan.building.rooms.empty()) return "";
  // Readable over the leaves of doors: the letters have a rim.
  std::string svg =
      "<g id=\"labels\" fill=\"#222222\" stroke-linejoin=\"round\" "
      "paint-order=\"stroke\">\n";
  for (std::size_t i = 0; i < plan.building.rooms.size(); ++i) {
    const PlanRoom& room = plan.building.rooms[i];
    const Vector2d place = sheet.OnPaper(InnerPoint(room.outline));
    // What a small room has space for.
    const double size =
        std::clamp(0.16 * std::sqrt(room.area) * sheet.PerMetre(), 1.0, 3.2);
    const std::string rim = " stroke=\"" + TintOf(plan.building, i) +
                            "\" stroke-width=\"" + Mm(0.35 * size) + "\"";
    svg += Text(place[0], place[1] - 0.1 * size, size, "middle",
                std::to_string(i + 1), " font-weight=\"bold\"" + rim);
    svg += Text(place[0], place[1] + 0.95 * size, 0.85 * size, "middle",
                Number(room.area, 1) + " m\u00b2", rim);
  }
  return svg + "</g>\n";
}

// Whether a face is shown by the walls of rooms.
bool IsShown(const BuildingPlan& building, const FloorPlanWall& face) {
  constexpr double kNear = 0.3;  // m
  const Vector2d middle = 0.5 * (face.begin + face.end);
  for (const PlanRoom& room : building.rooms) {
    if (room.outline.Contains(middle)) return true;
  }
  for (const PlanWall& wall : building.walls) {
    const Vector2d along = (wall.end - wall.begin).normalized();
    const Vector2d relative = middle - wall.begin;
    const double t = along.dot(relative);
    const double across = along[0] * relative[1] - along[1] * relative[0];
    if (t > -kNear && t < (wall.end - wall.begin).norm() + kNear &&
        std::abs(across) < kNear) {
      return true;
    }
  }
  return false;
}

std::string PlanGroup(const FloorPlan& plan, const Sheet& sheet) {
  // Metres of the map to mm of paper: turned, y up.
  const double k = sheet.PerMetre();
  const Matrix2d& r = sheet.rotation;
  const double x0 = sheet.left - k * sheet.bounds.low[0];
  const double y0 = sheet.top + k * sheet.bounds.high[1];
  std::string svg = "<g id=\"plan\" transform=\"matrix(";
  AppendNumber(k * r(0, 0), &svg);
  for (const double value : {-k * r(1, 0), k * r(0, 1), -k * r(1, 1), x0, y0}) {
    svg += ' ';
    AppendNumber(value, &svg);
  }
  svg +=
      ")\" fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n";
  const auto stroke = [&](double mm) {
    return "stroke-width=\"" + Number(mm / k, 6) + "\"";
  };

  svg += BuildingGroups(plan, kThinStroke / k);
  const bool has_rooms = !plan.building.rooms.empty();
  if (!plan.solids.empty() && !has_rooms) {
    svg += "<g id=\"WALL-SOLID\" fill=\"#b8b8b8\" stroke=\"none\">\n";
    for (const auto& solid : plan.solids) {
      svg += "<polygon points=\"";
      for (std::size_t i = 0; i < solid.size(); ++i) {
        if (i > 0) svg += ' ';
        svg += Metres(solid[i][0]) + "," + Metres(solid[i][1]);
      }
      svg += "\"/>\n";
    }
    svg += "</g>\n";
  }
  for (int direction = -1; direction < static_cast<int>(plan.directions.size());
       ++direction) {
    std::string walls;
    for (const FloorPlanWall& wall : plan.walls) {
      if (wall.direction != direction) continue;
      if (has_rooms && (IsShown(plan.building, wall) ||
                        IsScrap(wall, sheet.measured, sheet.rotation))) {
        continue;
      }
      walls += "<line x1=\"" + Metres(wall.begin[0]) + "\" y1=\"" +
               Metres(wall.begin[1]) + "\" x2=\"" + Metres(wall.end[0]) +
               "\" y2=\"" + Metres(wall.end[1]) + "\" data-features=\"";
      for (std::size_t i = 0; i < wall.features.size(); ++i) {
        if (i > 0) walls += ' ';
        walls += std::to_string(wall.features[i]);
      }
      walls += "\"/>\n";
    }
    if (walls.empty()) continue;
    svg += "<g id=\"" + EscapeXml(FloorPlanLayerName(plan, direction)) +
           "\" stroke=\"" + (direction < 0 ? "#777777" : "#111111") + "\" " +
           stroke(direction < 0 ? kThinStroke : sheet.WallStroke()) + ">\n" +
           walls + "</g>\n";
  }
  if (!plan.circles.empty()) {
    svg += "<g id=\"COLUMNS\" stroke=\"#111111\" fill=\"#b8b8b8\" " +
           stroke(sheet.WallStroke()) + ">\n";
    for (const DrawnCircle& circle : plan.circles) {
      svg += "<circle cx=\"" + Metres(circle.x) + "\" cy=\"" +
             Metres(circle.y) + "\" r=\"" + Metres(circle.radius) + "\"/>\n";
    }
    svg += "</g>\n";
  }
  return svg + "</g>\n";
}

std::string Dimensions(const Sheet& sheet) {
  const Vector2d size = sheet.measured.size();
  const Vector2d length = sheet.PerMetre() * size;
  const double left = sheet.left + sheet.PerMetre() * (sheet.measured.low[0] -
                                                       sheet.bounds.low[0]);
  const double bottom = sheet.MeasuredBottom();
  std::string svg =
      "<g id=\"dimensions\" stroke=\"#444444\" stroke-width=\"0.13\" "
      "fill=\"#444444\">\n";
  svg += Dimension(left, left + length[0], bottom + kDimensionOffset,
                   Number(size[0], 2) + " m");
  // The same, standing on the left: turned about its lower left corner.
  svg += "<g transform=\"translate(" + Mm(left - kDimensionOffset) + " " +
         Mm(bottom) + ") rotate(-90)\">\n";
  std::string upright = Line(-2.0, 0.0, length[1] + 2.0, 0.0);
  for (const double x : {0.0, length[1]}) {
    upright += Line(x, -2.0, x, kDimensionOffset - 2.0);
    upright += Line(x - 1.0, 1.0, x + 1.0, -1.0);
  }
  svg += upright +
         Text(0.5 * length[1], -1.2, 3.0, "middle", Number(size[1], 2) + " m",
              " stroke=\"none\"") +
         "</g>\n</g>\n";
  return svg;
}

// Widths of the rooms along the lower side, between them and the whole.
std::string RoomChain(const FloorPlan& plan, const Sheet& sheet) {
  constexpr double kSide = 1.5;  // m
  constexpr double kOffset = 1.4;
  std::vector<std::pair<double, double>> spans;
  for (const PlanRoom& room : plan.building.rooms) {
    Box box;
    for (const Vector2d& corner : room.outline.shell) {
      box.Add(sheet.rotation * corner);
    }
    if (box.low[1] < sheet.measured.low[1] + kSide) {
      spans.emplace_back(box.low[0], box.high[0]);
    }
  }
  std::sort(spans.begin(), spans.end());
  const double y = sheet.MeasuredBottom() + kOffset;
  std::string svg;
  double end = -std::numeric_limits<double>::infinity();
  for (const auto& [from, to] : spans) {
    // Rooms one above the other have one width on paper.
    if (from < end) continue;
    end = to;
    const double k = sheet.PerMetre();
    const double x1 = sheet.left + k * (from - sheet.bounds.low[0]);
    const double x2 = sheet.left + k * (to - sheet.bounds.low[0]);
    svg += Line(x1, y, x2, y);
    for (const double x : {x1, x2}) {
      svg += Line(x - 0.6, y + 0.6, x + 0.6, y - 0.6);
    }
    svg += Text(0.5 * (x1 + x2), y + 1.9, 1.7, "middle", Number(to - from, 2),
                " stroke=\"none\"");
  }
  if (svg.empty()) return "";
  return "<g id=\"room-dimensions\" stroke=\"#444444\" stroke-width=\"0.1\" "
         "fill=\"#444444\">\n" +
         svg + "</g>\n";
}

std::string TitleBlock(const FloorPlan& plan, const Sheet& sheet) {
  const double top = sheet.height - kMargin - kTitleRoom + 6.0;
  std::string svg = "<g id=\"title\" fill=\"#222222\">\n";
  svg += "<g stroke=\"#222222\" stroke-width=\"0.25\">\n" +
         Line(kMargin, top, sheet.width - kMargin, top) + "</g>\n";
  svg += Text(kMargin, top + 6.5, 4.5, "start",
              plan.title.empty() ? "Floor plan" : "Floor plan: " + plan.title);
  svg +=
      Text(kMargin, top + 12.0, 2.8, "start",
           plan.building.rooms.empty()
               ? "Faces of walls as a robot's laser saw them, in metres. A "
                 "gap is an opening or was not seen. Thin lines: no common "
                 "direction."
               : "Rooms and walls as a robot's laser saw them: numbers, areas "
                 "between the faces of walls, doors that were open (which "
                 "way they open is not known). Lines: walls of no room.");
  svg += Text(sheet.width - kMargin, top + 6.5, 4.5, "end",
              "1 : " + Number(sheet.scale, 0) + " (A3)");

  // Bar of four parts, black and white in turn.
  const double length = ScaleBarLength(0.2 * sheet.width / sheet.PerMetre());
  const double part = 0.25 * length * sheet.PerMetre();
  const double right = sheet.width - kMargin;
  const double left = right - 4.0 * part;
  const double y = top + 9.5;
  for (int i = 0; i < 4; ++i) {
    svg +=
        "<rect x=\"" + Mm(left + i * part) + "\" y=\"" + Mm(y) + "\" width=\"" +
        Mm(part) +
        "\" height=\"1.4\" stroke=\"#222222\" stroke-width=\"0.13\" fill=\"" +
        (i % 2 == 0 ? "#222222" : "#ffffff") + "\"/>\n";
  }
  std::string metres;
  AppendNumber(length, &metres);
  svg += Text(left, y + 4.4, 2.8, "middle", "0");
  svg += Text(right, y + 4.4, 2.8, "end", metres + " m");
  return svg + "</g>\n";
}

}  // namespace

void WriteFloorPlanSvg(const FloorPlan& plan, std::ostream& output) {
  const Sheet sheet = MakeSheet(plan);
  output << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\""
         << Number(sheet.width, 0) << "mm\" height=\""
         << Number(sheet.height, 0) << "mm\" viewBox=\"0 0 "
         << Number(sheet.width, 0) << " " << Number(sheet.height, 0)
         << "\" font-family=\"sans-serif\">\n"
         << "<title>"
         << EscapeXml(plan.title.empty() ? "Floor plan"
                                         : "Floor plan: " + plan.title)
         << "</title>\n<desc>Scale 1:" << Number(sheet.scale, 0)
         << "; the map is turned by " << Number(RadToDeg(sheet.turn), 3)
         << " degrees; coordinates of the group plan are metres of the map."
         << "</desc>\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
         << PlanGroup(plan, sheet) << RoomLabels(plan, sheet)
         << Dimensions(sheet) << RoomChain(plan, sheet)
         << TitleBlock(plan, sheet) << "</svg>\n";
}

void WriteFloorPlanSvg(const FloorPlan& plan, const std::string& path) {
  WriteFileAtomically(
      path, [&plan](std::ostream& output) { WriteFloorPlanSvg(plan, output); });
}

}  // namespace plumbline
