#include <plumbline/apps/evaluation/json_entry.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kFoundIou = 0.5;
constexpr double kLeastInside = 0.5;
// Less in common is an error of drawing, m^2.
constexpr double kLeastCommon = 0.1;
constexpr double kSameDoor = 0.5;      // m
constexpr double kOnSurface = 0.1;     // m
constexpr double kSurfaceStep = 0.05;  // m
constexpr double kMeets = 0.15;        // m
// Walls nearer to each other than this along such a length are one twice, m.
constexpr double kOnEachOther = 0.1;
constexpr double kDoubleLength = 0.5;

double Distance(const Vector2d& point, const StraightPiece& piece) {
  const Vector2d along = piece.second - piece.first;
  const double squared = along.squaredNorm();
  const double t =
      squared > 0.0
          ? std::clamp((point - piece.first).dot(along) / squared, 0.0, 1.0)
          : 0.0;
  return (point - piece.first - t * along).norm();
}

// Share of the length of `pieces` that lies within kOnSurface of others.
double ShareNear(const std::vector<StraightPiece>& pieces,
                 const std::vector<StraightPiece>& others) {
  double near = 0.0;
  double all = 0.0;
  for (const StraightPiece& piece : pieces) {
    const double length = (piece.second - piece.first).norm();
    const int steps =
        std::max(1, static_cast<int>(std::lround(length / kSurfaceStep)));
    for (int i = 0; i < steps; ++i) {
      const Vector2d here =
          piece.first + (i + 0.5) / steps * (piece.second - piece.first);
      const bool is_near =
          std::any_of(others.begin(), others.end(), [&](const auto& other) {
            return Distance(here, other) <= kOnSurface;
          });
      near += is_near * length / steps;
      all += length / steps;
    }
  }
  return all > 0.0 ? near / all : 1.0;
}

bool HasLength(const std::vector<StraightPiece>& pieces) {
  return std::any_of(pieces.begin(), pieces.end(), [](const auto& piece) {
    return (piece.second - piece.first).norm() > 0.0;
  });
}

double Overlap(const Polygon& a, const Polygon& b) {
  double area = 0.0;
  for (const Polygon& part : IntersectionOf(a, b)) area += part.Area();
  return area;
}

bool MayOverlap(const Polygon& a, const Polygon& b) {
  const auto box = [](const Ring& ring, Vector2d* low, Vector2d* high) {
    *low = *high = ring.front();
    for (const Vector2d& p : ring) {
      *low = low->cwiseMin(p);
      *high = high->cwiseMax(p);
    }
  };
  Vector2d low_a, high_a, low_b, high_b;
  box(a.shell, &low_a, &high_a);
  box(b.shell, &low_b, &high_b);
  return (low_a.array() <= high_b.array()).all() &&
         (low_b.array() <= high_a.array()).all();
}

bool Cross(const Vector2d& a, const Vector2d& b, const Vector2d& c,
           const Vector2d& d) {
  const auto side = [](const Vector2d& p, const Vector2d& q,
                       const Vector2d& r) {
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) > 0.0;
  };
  return side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
}

bool IsDriven(const TrueDoor& door, const std::vector<TimedPose>& poses) {
  for (std::size_t i = 1; i < poses.size(); ++i) {
    if (Cross(poses[i - 1].pose.head<2>(), poses[i].pose.head<2>(), door.begin,
              door.end)) {
      return true;
    }
  }
  return false;
}

void Move(const Pose2& by, Vector2d* point) {
  *point = TransformPoint(by, *point);
}

BuildingPlan Moved(BuildingPlan plan, const Pose2& by) {
  for (PlanRoom& room : plan.rooms) {
    for (Vector2d& corner : room.outline.shell) Move(by, &corner);
    for (Ring& hole : room.outline.holes) {
      for (Vector2d& corner : hole) Move(by, &corner);
    }
  }
  for (PlanDoor& door : plan.doors) {
    Move(by, &door.begin);
    Move(by, &door.end);
  }
  for (PlanWall& wall : plan.walls) {
    Move(by, &wall.begin);
    Move(by, &wall.end);
  }
  return plan;
}

// Sides of a wall's body in the order of its corners.
std::vector<StraightPiece> SidesOf(const PlanWall& wall) {
  const Ring body = BodyOf(wall);
  std::vector<StraightPiece> sides;
  for (std::size_t i = 0; i < body.size(); ++i) {
    sides.emplace_back(body[i], body[(i + 1) % body.size()]);
  }
  return sides;
}

bool Meets(const Vector2d& end, const PlanWall& wall) {
  Polygon body;
  body.shell = BodyOf(wall);
  if (body.Contains(end)) return true;
  const std::vector<StraightPiece> sides = SidesOf(wall);
  return std::any_of(sides.begin(), sides.end(), [&](const auto& side) {
    return Distance(end, side) <= kMeets;
  });
}

bool AreDouble(const PlanWall& a, const PlanWall& b) {
  const Vector2d along = (a.end - a.begin).normalized();
  const Vector2d other = (b.end - b.begin).normalized();
  if (std::abs(along.dot(other)) < std::cos(DegToRad(5.0))) return false;
  const double length = (a.end - a.begin).norm();
  const double from = along.dot(b.begin - a.begin);
  const double to = along.dot(b.end - a.begin);
  const double begin = std::max(0.0, std::min(from, to));
  const double end = std::min(length, std::max(from, to));
  if (end - begin < kDoubleLength) return false;
  const Vector2d middle = a.begin + 0.5 * (begin + end) * along;
  return Distance(middle, {b.begin, b.end}) <= kOnEachOther;
}

void EvaluateDoors(const BuildingPlan& plan, const MapTruth& truth,
                   PlanEvaluation* result) {
  const auto middle = [](const auto& door) -> Vector2d {
    return 0.5 * (door.begin + door.end);
  };
  // Pairs of a true door and one of the plan, the nearest first.
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < truth.doors.size(); ++i) {
    for (std::size_t j = 0; j < plan.doors.size(); ++j) {
      const double distance =
          (middle(plan.doors[j]) - middle(truth.doors[i])).norm();
      if (distance <= kSameDoor) pairs.emplace_back(distance, i, j);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<const PlanDoor*> drawn_of(truth.doors.size(), nullptr);
  std::vector<bool> is_true(plan.doors.size(), false);
  for (const auto& [distance, i, j] : pairs) {
    if (drawn_of[i] != nullptr || is_true[j]) continue;
    drawn_of[i] = &plan.doors[j];
    is_true[j] = true;
  }
  for (std::size_t i = 0; i < truth.doors.size(); ++i) {
    const TrueDoor& door = truth.doors[i];
    if (!IsDriven(door, truth.poses)) continue;
    ++result->doors_asked;
    if (drawn_of[i] == nullptr) continue;
    ++result->doors_found;
    result->door_width_error +=
        std::abs(drawn_of[i]->width() - (door.end - door.begin).norm());
  }
  if (result->doors_found > 0) result->door_width_error /= result->doors_found;
  result->doors_drawn = static_cast<int>(plan.doors.size());
  result->doors_false =
      static_cast<int>(std::count(is_true.begin(), is_true.end(), false));
}

void EvaluateWalls(const BuildingPlan& plan, const MapTruth& truth,
                   PlanEvaluation* result) {
  std::vector<StraightPiece> seen;
  std::vector<StraightPiece> there;
  for (const TruthWall& wall : truth.walls) {
    // Clutter is no wall.
    if (wall.orientation < 0) continue;
    there.emplace_back(wall.begin, wall.end);
    const Vector2d along = (wall.end - wall.begin).normalized();
    for (const auto& [begin, end] : wall.seen) {
      seen.emplace_back(wall.begin + begin * along, wall.begin + end * along);
    }
  }
  std::vector<StraightPiece> faces;
  std::vector<StraightPiece> sides;
  for (const PlanWall& wall : plan.walls) {
    const std::vector<StraightPiece> body = SidesOf(wall);
    sides.insert(sides.end(), body.begin(), body.end());
    faces.push_back(body[0]);
    faces.push_back(body[2]);
  }
  result->wall_completeness = ShareNear(seen, sides);
  result->wall_correctness = ShareNear(faces, there);
  result->has_seen_walls = HasLength(seen);
  result->has_walls = HasLength(faces);
  for (std::size_t i = 0; i < plan.walls.size(); ++i) {
    const PlanWall& wall = plan.walls[i];
    for (const Vector2d& end : {wall.begin, wall.end}) {
      ++result->ends;
      bool is_met = std::any_of(
          plan.doors.begin(), plan.doors.end(), [&](const PlanDoor& door) {
            return Distance(end, {door.begin, door.end}) <= kMeets;
          });
      for (std::size_t j = 0; j < plan.walls.size() && !is_met; ++j) {
        is_met = j != i && Meets(end, plan.walls[j]);
      }
      result->free_ends += !is_met;
    }
    for (std::size_t j = i + 1; j < plan.walls.size(); ++j) {
      result->double_walls += AreDouble(wall, plan.walls[j]);
    }
  }
}

PlanRoom ReadRoom(const JsonEntry& feature, PlanRoom::Kind kind) {
  PlanRoom room;
  room.kind = kind;
  const JsonEntry geometry = feature["geometry"];
  if (geometry["type"].Text() != "Polygon") {
    geometry["type"].Refuse("is no Polygon", "the outline of a room");
  }
  room.outline = geometry["coordinates"].ReadPolygon();
  room.area = room.outline.Area();
  return room;
}

PlanDoor ReadDoor(const JsonEntry& feature) {
  const JsonEntry positions = feature["geometry"]["coordinates"];
  const std::vector<JsonEntry> jambs = positions.Elements();
  if (jambs.size() != 2) positions.Refuse("is no door", "two jambs");
  PlanDoor door;
  door.begin = jambs[0].Position();
  door.end = jambs[1].Position();
  return door;
}

PlanWall ReadWall(const JsonEntry& feature) {
  const JsonEntry rings = feature["geometry"]["coordinates"];
  const Ring body = rings.ReadPolygon().shell;
  if (body.size() != 4) rings.Refuse("is no wall", "four corners");
  // Its first side runs along it.
  PlanWall wall;
  wall.begin = 0.5 * (body[0] + body[3]);
  wall.end = 0.5 * (body[1] + body[2]);
  wall.left = wall.right = 0.5 * (body[3] - body[0]).norm();
  return wall;
}

}  // namespace

BuildingPlan ReadBuildingPlan(const std::string& path) {
  InputStream input(path);
  return ReadBuildingPlan(&input);
}

BuildingPlan ReadBuildingPlan(InputStream* input) {
  const nlohmann::json json =
      ParseJson(input, "a floorplan.geojson of plumbline_solve");
  const JsonEntry root(input->name(), json, "");
  BuildingPlan plan;
  for (const JsonEntry& feature : root["features"].Elements()) {
    const JsonEntry properties = feature["properties"];
    if (!properties.Has("kind")) continue;
    const std::string kind = properties["kind"].Text();
    if (kind == "room") {
      plan.rooms.push_back(ReadRoom(feature, PlanRoom::Kind::kRoom));
    } else if (kind == "corridor") {
      plan.rooms.push_back(ReadRoom(feature, PlanRoom::Kind::kCorridor));
    } else if (kind == "door") {
      plan.doors.push_back(ReadDoor(feature));
    } else if (kind == "wall") {
      plan.walls.push_back(ReadWall(feature));
    }
  }
  return plan;
}

RoomEvaluation EvaluateRooms(const std::vector<Polygon>& plan,
                             const std::vector<Polygon>& truth,
                             const std::vector<bool>& asked) {
  RoomEvaluation result;
  std::vector<std::vector<double>> common(
      plan.size(), std::vector<double>(truth.size(), 0.0));
  for (std::size_t i = 0; i < plan.size(); ++i) {
    for (std::size_t j = 0; j < truth.size(); ++j) {
      if (MayOverlap(plan[i], truth[j]))
        common[i][j] = Overlap(plan[i], truth[j]);
    }
  }
  std::vector<bool> is_partner(plan.size(), false);
  for (std::size_t j = 0; j < truth.size(); ++j) {
    double best = kLeastCommon;
    int partner = -1;
    for (std::size_t i = 0; i < plan.size(); ++i) {
      if (common[i][j] <= best) continue;
      best = common[i][j];
      partner = static_cast<int>(i);
    }
    double iou = 0.0;
    double recall = 0.0;
    if (partner >= 0) {
      const double drawn = plan[static_cast<std::size_t>(partner)].Area();
      const double area = truth[j].Area();
      iou = best / (drawn + area - best);
      recall = best / area;
      if (best >= kLeastInside * drawn) {
        is_partner[static_cast<std::size_t>(partner)] = true;
      }
    }
    if (!asked[j]) continue;
    ++result.asked;
    result.found += iou >= kFoundIou;
    result.mean_iou += iou;
    result.recall += recall;
    result.iou.push_back(iou);
  }
  if (result.asked > 0) {
    result.mean_iou /= result.asked;
    result.recall /= result.asked;
  }
  for (std::size_t i = 0; i < plan.size(); ++i) {
    ++result.drawn;
    result.not_true += !is_partner[i];
    double best = 0.0;
    bool is_asked = false;
    for (std::size_t j = 0; j < truth.size(); ++j) {
      best = std::max(best, common[i][j]);
      is_asked = is_asked || (asked[j] && common[i][j] > kLeastCommon);
    }
    if (!is_asked) continue;
    ++result.judged;
    result.precision += best / plan[i].Area();
  }
  if (result.judged > 0) result.precision /= result.judged;
  return result;
}

PlanEvaluation EvaluatePlan(const BuildingPlan& plan, const MapTruth& truth,
                            const Pose2& alignment) {
  const BuildingPlan moved = Moved(plan, alignment);
  PlanEvaluation result;
  std::vector<Polygon> outlines;
  for (const PlanRoom& room : moved.rooms) outlines.push_back(room.outline);
  std::vector<bool> asked;
  for (const Polygon& room : truth.rooms) {
    asked.push_back(std::any_of(truth.poses.begin(), truth.poses.end(),
                                [&](const TimedPose& timed) {
                                  return room.Contains(timed.pose.head<2>());
                                }));
  }
  result.rooms = EvaluateRooms(outlines, truth.rooms, asked);
  EvaluateDoors(moved, truth, &result);
  EvaluateWalls(moved, truth, &result);
  return result;
}

}  // namespace plumbline
