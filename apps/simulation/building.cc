#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/building_clutter.h>
#include <plumbline/apps/simulation/building_tour.h>
#include <plumbline/apps/simulation/world_geometry.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;
using world_geometry::Direction;
using world_geometry::LeftOf;

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
    for (const double y : ys_) {
      places_.corridors.push_back({{xs_.front(), y}, {xs_.back(), y}});
    }
    for (const double x : xs_) {
      places_.corridors.push_back({{x, ys_.front()}, {x, ys_.back()}});
    }
    world_.path = TourCorridors(xs_, ys_, std::move(visits_));
    AddClutter(options_, places_, &random_, &world_);
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
    places_.half_width = half_;
    places_.wall_thickness = t_;
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
    places_.doors.push_back(position);
    places_.rooms.push_back(
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
      places_.doors.emplace_back(x, y);
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
    std::vector<BuildingVisit> rooms(
        std::make_move_iterator(visits_.begin() + first_visit),
        std::make_move_iterator(visits_.end()));
    visits_.resize(first_visit);
    const Vector2d junction(xs_.back(),
                            root.y() - (wall_x - xs_.back()) * tangent);
    const Vector2d far_end = left.At(u1 - 1.2, 0.0);
    std::vector<Vector2d> excursion;
    WalkCorridor(junction, far_end, &rooms, &excursion);
    excursion.push_back(junction);
    visits_.push_back({junction, excursion, false});
    places_.corridors.push_back({left.At(2.0, 0.0), far_end});
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
  std::vector<BuildingVisit> visits_;
  ClutterPlaces places_;
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
