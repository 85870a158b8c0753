#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/error.h>
#include <plumbline/core/utf8.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kSameDirectionDeg = 0.01;
constexpr double kShortestOwnDirection = 0.5;
constexpr double kOnWallTolerance = 0.01;

Vector2d Direction(double degrees) {
  return {std::cos(DegToRad(degrees)), std::sin(DegToRad(degrees))};
}

Vector2d LeftOf(const Vector2d& v) { return {-v.y(), v.x()}; }

double DistanceToSegment(const Vector2d& point, const Vector2d& begin,
                         const Vector2d& end) {
  const Vector2d along = end - begin;
  const double squared = along.squaredNorm();
  const double t =
      squared > 0.0 ? std::clamp((point - begin).dot(along) / squared, 0.0, 1.0)
                    : 0.0;
  return (point - begin - t * along).norm();
}

bool SegmentsCross(const Vector2d& a, const Vector2d& b, const Vector2d& c,
                   const Vector2d& d) {
  const auto side = [](const Vector2d& p, const Vector2d& q,
                       const Vector2d& r) {
    return (q - p).dot(-LeftOf(r - p)) > 0.0;
  };
  return side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
}

double SegmentDistance(const Vector2d& a, const Vector2d& b, const Vector2d& c,
                       const Vector2d& d) {
  if (SegmentsCross(a, b, c, d)) return 0.0;
  return std::min(
      std::min(DistanceToSegment(a, c, d), DistanceToSegment(b, c, d)),
      std::min(DistanceToSegment(c, a, b), DistanceToSegment(d, a, b)));
}

std::vector<Vector2d> Corners(const WorldBox& box) {
  const Vector2d u = Direction(box.angle_deg) * (box.length / 2);
  const Vector2d v = LeftOf(Direction(box.angle_deg)) * (box.width / 2);
  return {box.center - u - v, box.center + u - v, box.center + u + v,
          box.center - u + v};
}

double AxialDeg(const Vector2d& along) {
  return RadToDeg(NormalizeAxial(std::atan2(along.y(), along.x())));
}

// Whole text as a number, or false.
// Of a building, and of the way through it.
constexpr double kAbsurdNumber = 1e5;

bool ParseNumber(const std::string& text, double* value) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end && std::isfinite(*value);
}

}  // namespace

double SimulationRandom::Uniform(double low, double high) {
  // The upper 53 bits fill a double's mantissa exactly.
  const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
  return low + (high - low) * unit;
}

double SimulationRandom::Gaussian() {
  // Twelve uniform draws of 16 bits have variance 1 and mean 12 * 65535 / 2.
  std::int64_t sum = 0;
  for (int i = 0; i < 3; ++i) {
    for (std::uint64_t bits = engine_(), j = 0; j < 4; ++j, bits >>= 16) {
      sum += static_cast<std::int64_t>(bits & 0xffff);
    }
  }
  return static_cast<double>(2 * sum - 12 * 65535) * 0x1p-17;
}

WorldSurfaces MakeSurfaces(const World& world) {
  WorldSurfaces surfaces;
  std::vector<WorldFace> ends;
  for (const WorldWall& wall : world.walls) {
    if (wall.thickness <= 0.0) {
      surfaces.faces.push_back({wall.begin, wall.end, -1});
      continue;
    }
    const Vector2d half =
        LeftOf((wall.end - wall.begin).normalized()) * (wall.thickness / 2);
    surfaces.faces.push_back({wall.begin - half, wall.end - half, -1});
    surfaces.faces.push_back({wall.end + half, wall.begin + half, -1});
    ends.push_back({wall.end - half, wall.end + half, -1});
    ends.push_back({wall.begin + half, wall.begin - half, -1});
  }
  const std::size_t num_sides = surfaces.faces.size();
  surfaces.faces.insert(surfaces.faces.end(), ends.begin(), ends.end());

  std::vector<double>& orientations = surfaces.orientations_deg;
  const auto find = [&orientations](double degrees) {
    for (std::size_t i = 0; i < orientations.size(); ++i) {
      if (std::abs(WrapAngle(degrees - orientations[i], 180.0)) <=
          kSameDirectionDeg) {
        return static_cast<int>(i);
      }
    }
    return -1;
  };
  for (std::size_t i = 0; i < surfaces.faces.size(); ++i) {
    const Vector2d along = surfaces.faces[i].end - surfaces.faces[i].begin;
    if (i >= num_sides && along.norm() < kShortestOwnDirection) continue;
    if (find(AxialDeg(along)) < 0) orientations.push_back(AxialDeg(along));
  }
  std::sort(orientations.begin(), orientations.end());
  for (WorldFace& face : surfaces.faces) {
    face.orientation = find(AxialDeg(face.end - face.begin));
  }
  for (const WorldBox& box : world.boxes) {
    const std::vector<Vector2d> corners = Corners(box);
    for (std::size_t i = 0; i < 4; ++i) {
      surfaces.faces.push_back({corners[i], corners[(i + 1) % 4], -1});
    }
  }
  surfaces.circles = world.circles;
  return surfaces;
}

int CutDoor(const Vector2d& position, double width, World* world) {
  int num_cut = 0;
  std::vector<WorldWall> walls;
  WorldDoor door;
  for (const WorldWall& wall : world->walls) {
    const double reach = wall.thickness / 2 + kOnWallTolerance;
    if (DistanceToSegment(position, wall.begin, wall.end) > reach) {
      walls.push_back(wall);
      continue;
    }
    ++num_cut;
    const double length = (wall.end - wall.begin).norm();
    const Vector2d along = (wall.end - wall.begin) / length;
    const double middle = (position - wall.begin).dot(along);
    if (num_cut == 1 || wall.thickness > door.thickness) {
      door.begin = wall.begin + std::max(0.0, middle - width / 2) * along;
      door.end = wall.begin + std::min(length, middle + width / 2) * along;
      door.thickness = wall.thickness;
    }
    // A stump shorter than a centimetre is no wall.
    if (middle - width / 2 > 0.01) {
      walls.push_back({wall.begin, wall.begin + (middle - width / 2) * along,
                       wall.thickness});
    }
    if (middle + width / 2 < length - 0.01) {
      walls.push_back({wall.begin + (middle + width / 2) * along, wall.end,
                       wall.thickness});
    }
  }
  world->walls = std::move(walls);
  if (num_cut > 0) world->doors.push_back(door);
  return num_cut;
}

void RotateWorld(double degrees, World* world) {
  const Vector2d u = Direction(degrees);
  const Vector2d v = LeftOf(u);
  const auto rotate = [&](Vector2d* p) {
    *p = (p->x() * u + p->y() * v).eval();
  };
  for (WorldWall& wall : world->walls) {
    rotate(&wall.begin);
    rotate(&wall.end);
  }
  for (WorldDoor& door : world->doors) {
    rotate(&door.begin);
    rotate(&door.end);
  }
  for (WorldCircle& circle : world->circles) {
    rotate(&circle.center);
    circle.begin_deg += degrees;
  }
  for (WorldBox& box : world->boxes) {
    rotate(&box.center);
    box.angle_deg += degrees;
  }
  for (Vector2d& point : world->path) rotate(&point);
}

namespace {

// Reads a world line by line; the doors are cut once all walls are there.
class WorldReader {
 public:
  explicit WorldReader(const std::string& name) { world_.name = name; }

  World Read(std::istream& input) {
    std::string text;
    while (std::getline(input, text)) {
      ++line_;
      ReadLine(text.substr(0, text.find('#')));
    }
    if (input.bad()) throw Error(world_.name, line_, "reading failed", "");
    for (const Door& door : doors_) {
      if (CutDoor(door.position, door.width, &world_) == 0) {
        throw Error(world_.name, door.line, "the door is in no wall",
                    "a position inside a wall");
      }
    }
    return std::move(world_);
  }

 private:
  struct Door {
    Vector2d position;
    double width;
    int line;
  };

  void ReadLine(const std::string& text) {
    std::istringstream words(text);
    if (!(words >> keyword_)) return;
    values_.clear();
    for (std::string word; words >> word;) {
      double value = 0.0;
      if (!ParseNumber(word, &value)) {
        throw Error(world_.name, line_,
                    "'" + PrintableUtf8(word) + "' is not a number",
                    "a finite number");
      }
      if (std::abs(value) > kAbsurdNumber) {
        throw Error(world_.name, line_,
                    "'" + PrintableUtf8(word) + "' is absurd",
                    "metres and degrees within 1e5");
      }
      values_.push_back(value);
    }
    static const std::map<std::string, void (WorldReader::*)()> readers = {
        {"wall", &WorldReader::ReadWall},
        {"door", &WorldReader::ReadDoor},
        {"doorway", &WorldReader::ReadDoorway},
        {"opening", &WorldReader::ReadDoorway},
        {"circle", &WorldReader::ReadCircle},
        {"arc", &WorldReader::ReadArc},
        {"box", &WorldReader::ReadBox},
        {"path", &WorldReader::ReadPath}};
    const auto reader = readers.find(keyword_);
    if (reader == readers.end()) {
      throw Error(world_.name, line_,
                  "'" + PrintableUtf8(keyword_) + "' is unknown",
                  "wall, door, doorway, opening, circle, arc, box or path");
    }
    (this->*reader->second)();
  }

  void Require(bool holds, const std::string& expected) const {
    if (holds) return;
    throw Error(world_.name, line_, "bad '" + keyword_ + "'", expected);
  }

  Vector2d Point(std::size_t first) const {
    return {values_[first], values_[first + 1]};
  }

  void ReadWall() {
    Require(values_.size() == 4 || values_.size() == 5,
            "wall x1 y1 x2 y2 [thickness]");
    const WorldWall wall{Point(0), Point(2),
                         values_.size() == 5 ? values_[4] : 0.0};
    Require((wall.end - wall.begin).norm() > 0.0 && wall.thickness >= 0.0,
            "two different points and a thickness of at least 0");
    world_.walls.push_back(wall);
  }

  void ReadDoor() {
    Require(values_.size() == 3 && values_[2] > 0.0,
            "door x y width with a width above 0");
    doors_.push_back({Point(0), values_[2], line_});
  }

  void ReadDoorway() {
    Require(values_.size() == 4 || values_.size() == 5,
            keyword_ + " x1 y1 x2 y2 [thickness]");
    WorldDoor door;
    door.is_opening = keyword_ == "opening";
    door.begin = Point(0);
    door.end = Point(2);
    door.thickness = values_.size() == 5 ? values_[4] : 0.0;
    Require((door.end - door.begin).norm() > 0.0 && door.thickness >= 0.0,
            "two different points and a thickness of at least 0");
    world_.doors.push_back(door);
  }

  void ReadCircle() {
    Require(values_.size() == 3 && values_[2] > 0.0,
            "circle x y radius with a radius above 0");
    world_.circles.push_back({Point(0), values_[2], 0.0, 360.0});
  }

  void ReadArc() {
    Require(values_.size() == 5 && values_[2] > 0.0 &&
                values_[4] > values_[3] && values_[4] - values_[3] <= 360.0,
            "arc x y radius begin_deg end_deg with a radius above 0 and an "
            "end at most 360 degrees after the begin");
    world_.circles.push_back(
        {Point(0), values_[2], values_[3], values_[4] - values_[3]});
  }

  void ReadBox() {
    Require(values_.size() == 5 && values_[2] > 0.0 && values_[3] > 0.0,
            "box x y length width angle_deg with sides above 0");
    world_.boxes.push_back({Point(0), values_[2], values_[3], values_[4]});
  }

  void ReadPath() {
    Require(!values_.empty() && values_.size() % 2 == 0,
            "path x1 y1 [x2 y2 ...]");
    for (std::size_t i = 0; i < values_.size(); i += 2) {
      world_.path.push_back(Point(i));
    }
  }

  World world_;
  std::vector<Door> doors_;
  // The line that is being read.
  int line_ = 0;
  std::string keyword_;
  std::vector<double> values_;
};

}  // namespace

World ReadWorld(std::istream& input, const std::string& name) {
  return WorldReader(name).Read(input);
}

void WriteWorld(const World& world, std::ostream& output) {
  const auto write = [&output](const char* keyword,
                               const std::vector<double>& values) {
    output << keyword;
    for (const double value : values) {
      char text[64];
      std::snprintf(text, sizeof(text), " %.6f", value);
      output << text;
    }
    output << '\n';
  };
  for (const WorldWall& wall : world.walls) {
    write("wall", {wall.begin.x(), wall.begin.y(), wall.end.x(), wall.end.y(),
                   wall.thickness});
  }
  for (const WorldDoor& door : world.doors) {
    write(door.is_opening ? "opening" : "doorway",
          {door.begin.x(), door.begin.y(), door.end.x(), door.end.y(),
           door.thickness});
  }
  for (const WorldCircle& c : world.circles) {
    if (c.sweep_deg >= 360.0) {
      write("circle", {c.center.x(), c.center.y(), c.radius});
    } else {
      write("arc", {c.center.x(), c.center.y(), c.radius, c.begin_deg,
                    c.begin_deg + c.sweep_deg});
    }
  }
  for (const WorldBox& box : world.boxes) {
    write("box", {box.center.x(), box.center.y(), box.length, box.width,
                  box.angle_deg});
  }
  for (const Vector2d& point : world.path) {
    write("path", {point.x(), point.y()});
  }
}

namespace {

// A place off a corridor that the path may visit.
struct Visit {
  // Where the path leaves and rejoins the corridor.
  Vector2d junction;
  // Way points from there and back, without the junction.
  std::vector<Vector2d> excursion;
  bool done = false;
};

// A room, for furniture: its corner at the corridor's wall, directions along
// and away from the corridor, and inner size.
struct Room {
  Vector2d corner;
  Vector2d along;
  Vector2d away;
  double width;
  double depth;
};

// A frame along a corridor: `origin` on its centre line, `along` the corridor,
// `away` to the side at which a row of rooms stands.
struct Frame {
  Vector2d origin;
  Vector2d along;
  Vector2d away;
  Vector2d At(double u, double v) const {
    return origin + u * along + v * away;
  }
};

class BuildingMaker {
 public:
  BuildingMaker(const BuildingOptions& options, std::uint64_t seed)
      : options_(options), seed_(seed), random_(seed) {}

  World Make() {
    Measure();
    MakeOuterWalls();
    for (int row = 0; row < options_.rows; ++row) {
      for (int column = 0; column < options_.columns; ++column) {
        MakeBlock(row, column);
      }
    }
    if (options_.wing_length > 0.0) MakeWing();
    MakePath();
    MakeClutter();
    return std::move(world_);
  }

 private:
  double Draw(const WorldInterval& interval) {
    return random_.Uniform(interval.low, interval.high);
  }

  // Begins a part that is like others of its kind.
  void BeginPart() {
    if (options_.identical_blocks) random_ = SimulationRandom(seed_);
  }

  void Measure() {
    xs_ = {0.0};
    ys_ = {0.0};
    for (int i = 0; i < options_.columns; ++i) {
      BeginPart();
      xs_.push_back(xs_.back() + Draw(options_.block_length));
    }
    for (int i = 0; i < options_.rows; ++i) {
      BeginPart();
      ys_.push_back(ys_.back() + Draw(options_.block_height));
    }
    half_ = Draw(options_.corridor_width) / 2;
    t_ = options_.wall_thickness;
    const double smallest =
        std::min(options_.block_length.low, options_.block_height.low);
    if (options_.columns < 1 || options_.rows < 1 ||
        options_.corridor_width.low < 1.2 || t_ <= 0.0 ||
        smallest < options_.corridor_width.high + 4.0) {
      throw PLUMBLINE_ERROR(
          "the building's options leave no space",
          "at least one block, corridors of at least 1.2 m, walls thicker than "
          "0 and blocks that exceed the corridors' width by at least 4 m");
    }
  }

  void AddWall(const Vector2d& begin, const Vector2d& end, double thickness) {
    world_.walls.push_back({begin, end, thickness});
  }

  void AddOpening(const Vector2d& begin, const Vector2d& end) {
    WorldDoor opening;
    opening.is_opening = true;
    opening.begin = begin;
    opening.end = end;
    world_.doors.push_back(opening);
  }

  // A shut door in the middle of a gap that was cut into a wall with direction
  // `along`: thinner than the wall, so that it makes a niche.
  void ShutDoor(const Vector2d& position, const Vector2d& along) {
    const Vector2d half = along * (options_.door_width / 2);
    AddWall(position - half, position + half, 0.04);
  }

  // Rooms between u0 and u1 with their corridor wall (which begins at
  // `wall_begin`), doors, partitions and, if asked for, end and back walls.
  void AddRow(const Frame& frame, double wall_begin, double u0, double u1,
              double depth, bool ends, bool back) {
    const double v0 = half_ + t_ / 2;
    AddWall(frame.At(wall_begin, v0), frame.At(u1, v0), t_);
    if (back) {
      const double outer = options_.outer_wall_thickness;
      const double v = v0 + depth + outer / 2;
      AddWall(frame.At(u0 - t_ / 2, v), frame.At(u1 + t_ / 2, v), outer);
    }
    const double mean =
        (options_.room_width.low + options_.room_width.high) / 2;
    const int num_rooms =
        std::max(1, static_cast<int>(std::lround((u1 - u0) / mean)));
    std::vector<double> cuts = {u0};
    const double spread =
        (options_.room_width.high - options_.room_width.low) / 4;
    for (int i = 1; i < num_rooms; ++i) {
      cuts.push_back(u0 + (u1 - u0) * i / num_rooms +
                     random_.Uniform(-spread, spread));
    }
    cuts.push_back(u1);
    for (int i = 0; i <= num_rooms; ++i) {
      if (!ends && (i == 0 || i == num_rooms)) continue;
      AddWall(frame.At(cuts[i], v0), frame.At(cuts[i], v0 + depth), t_);
    }
    for (int i = 0; i < num_rooms; ++i) {
      AddRoom(frame, cuts[i] + t_ / 2, cuts[i + 1] - t_ / 2, depth - t_ / 2);
    }
  }

  // The door of a room between u0 and u1, perhaps a visit, perhaps a door leaf.
  void AddRoom(const Frame& frame, double u0, double u1, double depth) {
    const double width = u1 - u0;
    const double v0 = half_ + t_ / 2;
    const double door = options_.door_width;
    if (width < door + 0.8) return;
    const double side = random_.Chance(0.5) ? 1.0 : -1.0;
    const double from_edge = door / 2 + random_.Uniform(0.3, 0.4);
    const double u = side < 0.0 ? u0 + from_edge : u1 - from_edge;
    const Vector2d position = frame.At(u, v0);
    CutDoor(position, door, &world_);
    doors_.push_back(position);
    rooms_.push_back(
        {frame.At(u0, half_ + t_), frame.along, frame.away, width, depth});
    const bool visited = random_.Chance(options_.visited_share);
    const bool shut = random_.Chance(options_.shut_share);
    const double opened_deg = random_.Uniform(85.0, 105.0);
    if (!visited && shut) {
      ShutDoor(position, frame.along);
      return;
    }
    // An open leaf hangs on the jamb by the nearer partition.
    const Vector2d hinge = frame.At(u + side * door / 2, half_ + t_ + 0.03);
    const double a = DegToRad(opened_deg);
    const Vector2d leaf = -side * std::cos(a) * frame.along * (door - 0.05) +
                          std::sin(a) * frame.away * (door - 0.05);
    world_.boxes.push_back({hinge + leaf / 2 + side * 0.02 * frame.along,
                            leaf.norm(), 0.04,
                            RadToDeg(std::atan2(leaf.y(), leaf.x()))});
    if (!visited) return;
    const double v_inside = half_ + t_ + std::clamp(depth - 1.6, 0.9, 2.2);
    const Vector2d inside = frame.At(u, v_inside);
    const Vector2d middle = frame.At((u0 + u1) / 2, v_inside);
    visits_.push_back({frame.At(u, 0.0), {inside, middle, inside}, false});
  }

  void MakeOuterWalls() {
    const double length = xs_.back();
    const double height = ys_.back();
    const double low = -half_ - t_;
    const double depth_south = Draw(options_.room_depth);
    const double depth_north = Draw(options_.room_depth);
    const Frame south{{0.0, 0.0}, {1.0, 0.0}, {0.0, -1.0}};
    const Frame north{{0.0, height}, {1.0, 0.0}, {0.0, 1.0}};
    if (options_.identical_blocks) {
      AddIdenticalRows(south, depth_south);
      AddIdenticalRows(north, depth_south);
    } else {
      AddRow(south, low, low + t_ / 2, length + half_ + t_ / 2, depth_south,
             true, true);
      AddRow(north, low, low + t_ / 2, length + half_ + t_ / 2, depth_north,
             true, true);
    }
    for (const double x : {low + t_ / 2, length + half_ + t_ / 2}) {
      AddWall({x, low}, {x, height - low}, t_);
    }
    const bool east_is_shut = options_.wing_length <= 0.0;
    AddVerticalDoors(low + t_ / 2, low, height - low);
    if (east_is_shut) {
      AddVerticalDoors(length + half_ + t_ / 2, low, height - low);
    }
  }

  // A row of rooms a block, and what is left beside the last corridor.
  void AddIdenticalRows(const Frame& frame, double depth) {
    const double shift = -half_ - t_ / 2;
    for (std::size_t i = 1; i < xs_.size(); ++i) {
      BeginPart();
      AddRow(frame, xs_[i - 1] + shift - t_ / 2, xs_[i - 1] + shift,
             xs_[i] + shift, depth, true, true);
    }
    AddRow(frame, xs_.back() + shift, xs_.back() + shift, xs_.back() - shift,
           depth, true, true);
  }

  void AddVerticalDoors(double x, double y0, double y1) {
    const double spacing = options_.vertical_door_spacing;
    if (spacing <= 0.0) return;
    double y = y0 + random_.Uniform(0.5, 1.0) * spacing;
    while (y < y1 - 2.0) {
      CutDoor({x, y}, options_.door_width, &world_);
      ShutDoor({x, y}, {0.0, 1.0});
      doors_.emplace_back(x, y);
      y += random_.Uniform(0.6, 1.4) * spacing;
    }
  }

  void MakeBlock(int row, int column) {
    BeginPart();
    const double x0 = xs_[column] + half_ + t_ / 2;
    double x1 = xs_[column + 1] - half_ - t_ / 2;
    const double y0 = ys_[row] + half_ + t_ / 2;
    const double y1 = ys_[row + 1] - half_ - t_ / 2;
    const bool hall = options_.hall_length > 0.0 && row == 0 &&
                      column + 1 == options_.columns &&
                      x1 - x0 > options_.hall_length + 3.0;
    if (hall) {
      x1 = xs_[column + 1] - half_ - options_.hall_length;
      MakeHall(row, column, x1);
    }
    // Rooms of both sides share their back wall where the block is shallow;
    // otherwise the middle of the block stays unknown.
    const double depth =
        std::min((y1 - y0) / 2, Draw(options_.room_depth) + t_);
    const bool back = 2 * depth < y1 - y0 - 1e-6;
    if (!back) AddWall({x0, (y0 + y1) / 2}, {x1, (y0 + y1) / 2}, t_);
    AddRow({{0.0, ys_[row]}, {1.0, 0.0}, {0.0, 1.0}}, x0 - t_ / 2, x0, x1,
           depth, false, back);
    AddRow({{0.0, ys_[row + 1]}, {1.0, 0.0}, {0.0, -1.0}}, x0 - t_ / 2, x0, x1,
           depth, false, back);
    for (const double x : {x0, x1}) {
      AddWall({x, y0 - t_ / 2}, {x, y1 + t_ / 2}, t_);
      AddVerticalDoors(x, y0, y1);
    }
  }

  void MakeHall(int row, int column, double x0) {
    const double x1 = xs_[column + 1] - half_;
    const double y0 = ys_[row];
    const double y1 = ys_[row + 1];
    const Vector2d middle((x0 + t_ + x1) / 2, (y0 + y1) / 2);
    const int per_side = (options_.hall_columns + 1) / 2;
    const double radius = random_.Uniform(0.2, 0.35);
    for (int i = 0; i < options_.hall_columns; ++i) {
      const double y =
          y0 + half_ + (y1 - y0 - 2 * half_) * (i / 2 + 0.5) / per_side;
      const double x = middle.x() + (i % 2 == 0 ? -0.27 : 0.27) * (x1 - x0);
      world_.circles.push_back({{x, y}, radius, 0.0, 360.0});
    }
    // The corridors end in the hall.
    AddOpening({x0, y0 - half_}, {x0, y0 + half_});
    AddOpening({x0, y1 - half_}, {x0, y1 + half_});
    if (row + 1 < options_.rows) {
      AddOpening({x1, y1 + half_}, {x1 + 2 * half_, y1 + half_});
    }
    visits_.push_back({{middle.x(), y0},
                       {middle, {xs_[column + 1], middle.y()}, middle},
                       false});
  }

  void MakeWing() {
    const double a = options_.wing_angle_deg;
    if (a < 5.0 || a > 60.0) {
      throw PLUMBLINE_ERROR("the wing's angle is out of range",
                            "5 to 60 degrees");
    }
    const double tangent = std::tan(DegToRad(a));
    const double cosine = std::cos(DegToRad(a));
    const double sine = std::sin(DegToRad(a));
    const double depth = Draw(options_.room_depth);
    const double wall_x = xs_.back() + half_ + t_ / 2;
    const double v0 = half_ + t_ / 2;
    // In the upper half of the first block, so that the rooms on the right
    // stay clear of the lowest row.
    const Vector2d root(wall_x, ys_[0] + 0.6 * (ys_[1] - ys_[0]));
    CutDoor(root, 2 * half_ / cosine + t_ * tangent, &world_);
    world_.doors.back().is_opening = true;
    const Vector2d along = Direction(a);
    const Frame left{root, along, LeftOf(along)};
    const Frame right{root, along, -LeftOf(along)};
    const double u1 = options_.wing_length;
    const double left_begin =
        ((v0 + depth + options_.outer_wall_thickness) * sine + t_) / cosine;
    if (left_begin + 2.0 > u1) {
      throw PLUMBLINE_ERROR("the wing has no space for a room",
                            "a longer wing or a smaller angle");
    }
    const std::size_t first_visit = visits_.size();
    AddRow(left, v0 * tangent, left_begin, u1, depth, true, true);
    AddRow(right, -v0 * tangent, 0.4, u1, depth, true, true);
    AddWall(left.At(u1, v0), right.At(u1, v0), t_);

    // The wing is a visit itself, with the rooms' visits inside.
    std::vector<Visit> rooms(
        std::make_move_iterator(visits_.begin() + first_visit),
        std::make_move_iterator(visits_.end()));
    visits_.resize(first_visit);
    const Vector2d junction(xs_.back(),
                            root.y() - (wall_x - xs_.back()) * tangent);
    const Vector2d far_end = left.At(u1 - 1.2, 0.0);
    std::vector<Vector2d> excursion;
    Walk(junction, far_end, &rooms, &excursion);
    excursion.push_back(junction);
    visits_.push_back({junction, excursion, false});
    corridors_.push_back({left.At(2.0, 0.0), far_end});
  }

  // Appends the way from `from` to `to` without `from`, with the visits whose
  // junctions lie between them.
  void Walk(const Vector2d& from, const Vector2d& to,
            std::vector<Visit>* visits, std::vector<Vector2d>* path) {
    std::vector<std::pair<double, Visit*>> met;
    for (Visit& visit : *visits) {
      if (!visit.done && DistanceToSegment(visit.junction, from, to) < 1e-6) {
        met.emplace_back((visit.junction - from).norm(), &visit);
      }
    }
    std::stable_sort(met.begin(), met.end(), [](const auto& a, const auto& b) {
      return a.first < b.first;
    });
    for (const auto& [distance, visit] : met) {
      visit->done = true;
      path->push_back(visit->junction);
      path->insert(path->end(), visit->excursion.begin(),
                   visit->excursion.end());
      path->push_back(visit->junction);
    }
    path->push_back(to);
  }

  // Along all horizontal corridors to and fro, then along all vertical ones.
  void MakePath() {
    std::vector<Vector2d> nodes;
    for (std::size_t i = 0; i < ys_.size(); ++i) {
      const bool to_right = i % 2 == 0;
      nodes.emplace_back(to_right ? xs_.front() : xs_.back(), ys_[i]);
      nodes.emplace_back(to_right ? xs_.back() : xs_.front(), ys_[i]);
      corridors_.push_back({{xs_.front(), ys_[i]}, {xs_.back(), ys_[i]}});
    }
    const bool ends_left = ys_.size() % 2 == 0;
    // With a single row the right-most corridor is driven along already.
    const std::size_t num_vertical = xs_.size() - (ys_.size() == 2 ? 1 : 0);
    for (std::size_t i = 0; i < num_vertical; ++i) {
      const double x = ends_left ? xs_[i] : xs_[xs_.size() - 1 - i];
      const bool down = i % 2 == 0;
      nodes.emplace_back(x, down ? ys_.back() : ys_.front());
      nodes.emplace_back(x, down ? ys_.front() : ys_.back());
    }
    for (const double x : xs_) {
      corridors_.push_back({{x, ys_.front()}, {x, ys_.back()}});
    }
    std::vector<Vector2d> path = {nodes[0]};
    for (std::size_t i = 1; i < nodes.size(); ++i) {
      Walk(nodes[i - 1], nodes[i], &visits_, &path);
    }
    for (const Vector2d& point : path) {
      if (world_.path.empty() || (point - world_.path.back()).norm() > 1e-6) {
        world_.path.push_back(point);
      }
    }
  }

  // Whether a box leaves room for the robot, doors, columns and other boxes.
  bool Fits(const WorldBox& box) const {
    const std::vector<Vector2d> corners = Corners(box);
    const double radius = std::hypot(box.length, box.width) / 2;
    for (const Vector2d& door : doors_) {
      if ((door - box.center).norm() < radius + 0.7) return false;
    }
    for (const WorldCircle& circle : world_.circles) {
      if ((circle.center - box.center).norm() < radius + circle.radius + 0.2) {
        return false;
      }
    }
    for (const WorldBox& other : world_.boxes) {
      const double reach = radius + std::hypot(other.length, other.width) / 2;
      if ((other.center - box.center).norm() < reach + 0.1) return false;
    }
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 1; j < world_.path.size(); ++j) {
        if (SegmentDistance(corners[i], corners[(i + 1) % 4],
                            world_.path[j - 1], world_.path[j]) < 0.55) {
          return false;
        }
      }
    }
    return true;
  }

  void TryBox(const WorldBox& box) {
    if (Fits(box)) world_.boxes.push_back(box);
  }

  void MakeClutter() {
    for (const Room& room : rooms_) {
      const double angle = RadToDeg(std::atan2(room.along.y(), room.along.x()));
      for (int i = 0; i < options_.furniture; ++i) {
        const double length = random_.Uniform(0.8, 1.6);
        const double width = random_.Uniform(0.4, 0.8);
        const double kind = random_.Uniform(0.0, 1.0);
        const double where = random_.Uniform(0.0, 1.0);
        const double turn = random_.Uniform(-90.0, 90.0);
        const auto at = [&room](double u, double v) {
          return (room.corner + u * room.along + v * room.away).eval();
        };
        if (kind < 0.45) {
          // Desk at the back wall.
          const double u = length / 2 + where * (room.width - length);
          TryBox({at(u, room.depth - width / 2 - 0.02), length, width, angle});
        } else if (kind < 0.8) {
          // Cupboard at a partition.
          const double v =
              1.0 + where * (room.depth - 1.0 - length) + length / 2;
          const double u =
              turn < 0.0 ? width / 2 + 0.02 : room.width - width / 2 - 0.02;
          TryBox({at(u, v), length, width, angle + 90.0});
        } else {
          // Something standing about.
          const double side = 0.3 + 0.3 * where;
          TryBox({at(0.6 + where * (room.width - 1.2), room.depth * 0.6), side,
                  side, angle + turn});
        }
      }
    }
    for (const auto& [begin, end] : corridors_) {
      const double length = (end - begin).norm();
      const Vector2d along = (end - begin) / length;
      const int tries = static_cast<int>(
          std::lround(length / 10.0 * options_.corridor_clutter));
      for (int i = 0; i < tries; ++i) {
        const double u = random_.Uniform(1.0, length - 1.0);
        const double size = random_.Uniform(0.6, 1.2);
        const double depth = random_.Uniform(0.25, 0.4);
        const double side = random_.Chance(0.5) ? 1.0 : -1.0;
        const double angle = RadToDeg(std::atan2(along.y(), along.x()));
        const WorldBox box{
            begin + u * along +
                side * (half_ - depth / 2 - 0.01) * LeftOf(along),
            size, depth, angle};
        if (HasWallBehind(box, side * LeftOf(along))) TryBox(box);
      }
    }
  }

  // A cupboard stands at a wall, not in the opening of another corridor.
  bool HasWallBehind(const WorldBox& box, const Vector2d& away) const {
    for (const double share : {-0.5, 0.5}) {
      const Vector2d probe = box.center +
                             share * box.length * Direction(box.angle_deg) +
                             away * (box.width / 2 + t_ / 2);
      bool on_wall = false;
      for (const WorldWall& wall : world_.walls) {
        on_wall = on_wall || DistanceToSegment(probe, wall.begin, wall.end) <
                                 wall.thickness / 2;
      }
      if (!on_wall) return false;
    }
    return true;
  }

  const BuildingOptions options_;
  const std::uint64_t seed_;
  SimulationRandom random_;
  World world_;
  // Centre lines of the vertical and horizontal corridors.
  std::vector<double> xs_;
  std::vector<double> ys_;
  // Half the corridors' width and the thickness of inner walls.
  double half_ = 0.0;
  double t_ = 0.0;
  std::vector<Visit> visits_;
  std::vector<Room> rooms_;
  std::vector<Vector2d> doors_;
  std::vector<std::pair<Vector2d, Vector2d>> corridors_;
};

}  // namespace

BuildingOptions KillianLikeOptions() {
  BuildingOptions options;
  options.columns = 3;
  options.rows = 2;
  options.block_length = {55.0, 80.0};
  options.block_height = {35.0, 55.0};
  options.corridor_width = {2.6, 3.2};
  options.room_width = {3.5, 7.0};
  options.room_depth = {5.0, 7.0};
  options.visited_share = 0.0;
  options.shut_share = 0.75;
  options.vertical_door_spacing = 6.0;
  options.hall_length = 0.0;
  options.wing_length = 0.0;
  options.furniture = 1;
  options.corridor_clutter = 0.3;
  return options;
}

BuildingOptions ObliqueOptions(std::uint64_t seed) {
  BuildingOptions options;
  SimulationRandom random(seed);
  options.wing_angle_deg = random.Uniform(15.0, 55.0);
  // The rooms of a steep wing begin late.
  options.wing_length = 22.0;
  return options;
}

BuildingOptions SymmetricOptions() {
  BuildingOptions options;
  options.columns = 3;
  options.rows = 2;
  options.block_length = {13.0, 16.0};
  options.visited_share = 0.3;
  options.hall_length = 0.0;
  options.wing_length = 0.0;
  options.furniture = 0;
  options.corridor_clutter = 0.0;
  options.identical_blocks = true;
  return options;
}

BuildingOptions ParallelOptions() {
  BuildingOptions options = SymmetricOptions();
  options.columns = 1;
  options.rows = 5;
  options.block_length = {35.0, 45.0};
  options.block_height = {7.0, 8.0};
  options.visited_share = 0.0;
  options.shut_share = 0.8;
  return options;
}

World MakeBuilding(const BuildingOptions& options, std::uint64_t seed) {
  return BuildingMaker(options, seed).Make();
}

namespace {

struct BuiltInWorld {
  const char* name;
  BuildingOptions (*options)(std::uint64_t seed);
};

const std::vector<BuiltInWorld>& Worlds() {
  static const std::vector<BuiltInWorld>* const worlds =
      new std::vector<BuiltInWorld>{
          {"office", [](std::uint64_t) { return BuildingOptions(); }},
          {"killian_like", [](std::uint64_t) { return KillianLikeOptions(); }},
          {"oblique", ObliqueOptions},
          {"symmetric", [](std::uint64_t) { return SymmetricOptions(); }},
          {"parallel", [](std::uint64_t) { return ParallelOptions(); }}};
  return *worlds;
}

}  // namespace

const std::vector<std::string>& BuiltInWorlds() {
  static const std::vector<std::string>* const names = [] {
    auto* list = new std::vector<std::string>;
    for (const BuiltInWorld& world : Worlds()) list->push_back(world.name);
    return list;
  }();
  return *names;
}

World MakeWorld(const std::string& name, std::uint64_t seed, double size) {
  if (!(size > 0.0 && size <= 100.0)) {
    throw PLUMBLINE_ERROR("bad size of a world", "a number in (0, 100]");
  }
  const auto found = std::find_if(
      Worlds().begin(), Worlds().end(),
      [&](const BuiltInWorld& world) { return name == world.name; });
  if (found == Worlds().end()) {
    std::string known;
    for (const std::string& world : BuiltInWorlds()) {
      known += (known.empty() ? "" : ", ") + world;
    }
    throw PLUMBLINE_ERROR("unknown world '" + name + "'", known);
  }
  BuildingOptions options = found->options(seed);
  const auto scale = [size](int count) {
    return std::max(1, static_cast<int>(std::lround(count * size)));
  };
  options.columns = scale(options.columns);
  options.rows = scale(options.rows);
  World world = MakeBuilding(options, seed);
  world.name = name;
  return world;
}

}  // namespace plumbline
