#include <plumbline/core/registry.h>
#include <plumbline/outputs/floor_plan.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kFarthest = 1e7;      // m
constexpr double kLeastWay = 0.05;     // m, between poses of the path
constexpr double kCellSize = 4.0;      // m
constexpr double kLeastSolid = 0.1;    // m, along the wall
constexpr int kMaxMergingRounds = 20;  // it ends long before
constexpr double kLongestWall = 1e4;   // m

Vector2d Direction(double angle) { return {std::cos(angle), std::sin(angle)}; }
Vector2d LeftOf(const Vector2d& v) { return {-v[1], v[0]}; }

// A straight face under construction: where it lies relative to `origin`.
struct Face {
  Vector2d origin = Vector2d::Zero();
  Vector2d along = Vector2d::UnitX();
  double begin = 0.0;
  double end = 0.0;
  int direction = -1;
  bool knows_side = false;
  /// Metres of what was merged, for the mean across.
  double weight = 0.0;
  std::vector<FeatureId> features;

  double length() const { return end - begin; }
  Vector2d At(double t) const { return origin + t * along; }
  double Along(const Vector2d& p) const { return along.dot(p - origin); }
  double Across(const Vector2d& p) const {
    return LeftOf(along).dot(p - origin);
  }
};

// Finds what lies near a straight piece: ids by the cells of a grid that their
// bounding boxes, cut into pieces along them, touch.
class Grid {
 public:
  void Add(int id, const Face& face, double margin) {
    ForEachCell(face, margin, [&](const Cell& cell) {
      std::vector<int>& ids = cells_[cell];
      if (ids.empty() || ids.back() != id) ids.push_back(id);
    });
  }

  // Ascending, each once.
  std::vector<int> Near(const Face& face, double margin) const {
    std::vector<int> found;
    ForEachCell(face, margin, [&](const Cell& cell) {
      const auto entry = cells_.find(cell);
      if (entry == cells_.end()) return;
      found.insert(found.end(), entry->second.begin(), entry->second.end());
    });
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

 private:
  using Cell = std::pair<std::int64_t, std::int64_t>;

  template <typename Visit>
  static void ForEachCell(const Face& face, double margin, const Visit& visit) {
    const int pieces = 1 + static_cast<int>(face.length() / kCellSize);
    for (int i = 0; i < pieces; ++i) {
      const Vector2d a = face.At(face.begin + face.length() * i / pieces);
      const Vector2d b = face.At(face.begin + face.length() * (i + 1) / pieces);
      const auto cell = [](double v) {
        return static_cast<std::int64_t>(std::floor(v / kCellSize));
      };
      const Vector2d low = a.cwiseMin(b).array() - margin;
      const Vector2d high = a.cwiseMax(b).array() + margin;
      for (std::int64_t x = cell(low[0]); x <= cell(high[0]); ++x) {
        for (std::int64_t y = cell(low[1]); y <= cell(high[1]); ++y) {
          visit({x, y});
        }
      }
    }
  }

  std::map<Cell, std::vector<int>> cells_;
};

// Directions of the clusters, with those at a known angle to another put there
// exactly; rad.
std::vector<double> SquaredDirections(const Graph& graph,
                                      const MapDrawing& drawing) {
  std::vector<double> directions = drawing.cluster_directions;
  std::map<FeatureId, int> clusters;
  for (std::size_t i = 0; i < drawing.cluster_features.size(); ++i) {
    clusters[drawing.cluster_features[i]] = static_cast<int>(i);
  }
  std::vector<bool> placed(directions.size(), false);
  // Clusters are in the order of their walls' length, so whatever is not yet
  // placed starts from the longest that is left.
  for (std::size_t start = 0; start < directions.size(); ++start) {
    if (placed[start]) continue;
    placed[start] = true;
    std::vector<int> queue = {static_cast<int>(start)};
    for (std::size_t next = 0; next < queue.size(); ++next) {
      const int from = queue[next];
      const FeatureId id = drawing.cluster_features[from];
      for (const ConstraintId constraint_id : graph.ConstraintsOf(id)) {
        const Constraint& constraint = graph.GetConstraint(constraint_id);
        if (!constraint.type->Is(RelationRole::kAngle) ||
            constraint.state != ConstraintState::kLive) {
          continue;
        }
        const bool is_first = constraint.features[0] == id;
        const auto to = clusters.find(constraint.features[is_first ? 1 : 0]);
        if (to == clusters.end() || placed[to->second]) continue;
        placed[to->second] = true;
        directions[to->second] =
            directions[from] + (is_first ? 1.0 : -1.0) * constraint.expected[0];
        queue.push_back(to->second);
      }
    }
  }
  for (double& direction : directions) {
    direction = NormalizeAxial(direction);
    if (direction < 0.0) direction += kPi;
    if (direction >= kPi) direction = 0.0;  // -1e-17 plus pi
  }
  return directions;
}

std::vector<Face> Faces(const Graph& graph, const MapDrawing& drawing,
                        const std::vector<double>& directions) {
  std::vector<Face> faces;
  for (const DrawnWall& wall : drawing.walls) {
    const Vector2d from(wall.x1, wall.y1);
    const Vector2d to(wall.x2, wall.y2);
    // Also false for what is not a number.
    if (!(from.cwiseAbs().maxCoeff() <= kFarthest) ||
        !(to.cwiseAbs().maxCoeff() <= kFarthest) || !((to - from).norm() > 0) ||
        !((to - from).norm() <= kLongestWall)) {
      continue;
    }
    Face face;
    face.origin = 0.5 * (from + to);
    face.along = (to - from).normalized();
    face.direction = wall.cluster;
    if (wall.cluster >= 0) {
      const Vector2d shared = Direction(directions[wall.cluster]);
      face.along = face.along.dot(shared) < 0.0 ? Vector2d(-shared) : shared;
    }
    face.end = 0.5 * (to - from).norm();
    face.begin = -face.end;
    face.weight = face.length();
    face.knows_side = graph.GetFeature(wall.id).type->traits.is_one_sided;
    face.features = wall.members;
    faces.push_back(std::move(face));
  }
  return faces;
}

// Distance across when `piece` is a part of `face`; negative when it is not.
double OffsetIfOne(const Face& face, const Face& piece,
                   const FloorPlanOptions& options) {
  if (face.knows_side != piece.knows_side) return -1.0;
  const double cosine = face.along.dot(piece.along);
  if (std::abs(cosine) < std::cos(options.merge_angle)) return -1.0;
  if (face.knows_side && cosine < 0.0) return -1.0;
  const Vector2d a = piece.At(piece.begin);
  const Vector2d b = piece.At(piece.end);
  const double offset =
      std::max(std::abs(face.Across(a)), std::abs(face.Across(b)));
  const double low = std::min(face.Along(a), face.Along(b));
  const double high = std::max(face.Along(a), face.Along(b));
  const double overlap = std::min(high, face.end) - std::max(low, face.begin);
  const bool side_by_side = overlap >= 0.5 * (high - low);
  if (side_by_side ? offset <= options.duplicate_offset
                   : offset <= options.in_line_offset &&
                         overlap >= -options.in_line_gap) {
    return offset;
  }
  return -1.0;
}

void Absorb(const Face& piece, Face* face) {
  const double a = face->Along(piece.At(piece.begin));
  const double b = face->Along(piece.At(piece.end));
  const double across = face->Across(piece.At(0.5 * (piece.begin + piece.end)));
  face->begin = std::min({face->begin, a, b});
  face->end = std::max({face->end, a, b});
  face->origin += LeftOf(face->along) * across * piece.weight /
                  (piece.weight + face->weight);
  face->weight += piece.weight;
  face->features.insert(face->features.end(), piece.features.begin(),
                        piece.features.end());
}

std::vector<Face> Merge(std::vector<Face> faces,
                        const FloorPlanOptions& options) {
  const double margin =
      std::max(options.duplicate_offset, options.in_line_gap) + 0.01;
  for (int round = 0; round < kMaxMergingRounds; ++round) {
    // Those with a shared direction first: they are the better measured ones;
    // then the longest.
    std::stable_sort(faces.begin(), faces.end(),
                     [](const Face& a, const Face& b) {
                       return std::make_tuple(a.direction < 0, -a.length()) <
                              std::make_tuple(b.direction < 0, -b.length());
                     });
    std::vector<Face> merged;
    Grid grid;
    for (Face& face : faces) {
      int best = -1;
      double best_offset = 0.0;
      for (const int id : grid.Near(face, margin)) {
        const double offset = OffsetIfOne(merged[id], face, options);
        if (offset < 0.0 || (best >= 0 && offset >= best_offset)) continue;
        best = id;
        best_offset = offset;
      }
      if (best >= 0) {
        Absorb(face, &merged[best]);
      } else {
        best = static_cast<int>(merged.size());
        merged.push_back(std::move(face));
      }
      grid.Add(best, merged[best], margin);
    }
    const bool has_changed = merged.size() < faces.size();
    faces = std::move(merged);
    if (!has_changed) break;
  }
  return faces;
}

// Ends that could meet: the end of `a` (0: begin, 1: end) with another face.
struct Corner {
  /// How far the farthest of the ends has to move, m.
  double distance;
  int a, end_a;
  int b;
  /// The end of `b` that meets it, or -1: somewhere along it.
  int end_b;
  double t_a, t_b;
};

void JoinCorners(const FloorPlanOptions& options, std::vector<Face>* faces) {
  const double gap = options.corner_gap;
  Grid grid;
  for (std::size_t i = 0; i < faces->size(); ++i) {
    grid.Add(static_cast<int>(i), (*faces)[i], gap);
  }
  std::vector<Corner> corners;
  for (std::size_t i = 0; i < faces->size(); ++i) {
    const Face& a = (*faces)[i];
    for (const int j : grid.Near(a, gap)) {
      if (j == static_cast<int>(i)) continue;
      const Face& b = (*faces)[j];
      const double sine = LeftOf(a.along).dot(b.along);
      if (std::abs(sine) < std::sin(options.corner_angle)) continue;
      // a.origin + t_a a.along = b.origin + t_b b.along
      const Vector2d between = b.origin - a.origin;
      const double t_a = -between.dot(LeftOf(b.along)) / sine;
      const double t_b = -between.dot(LeftOf(a.along)) / sine;
      if (t_b < b.begin - gap || t_b > b.end + gap) continue;
      const double ends_a[2] = {std::abs(t_a - a.begin), std::abs(t_a - a.end)};
      const double ends_b[2] = {std::abs(t_b - b.begin), std::abs(t_b - b.end)};
      const int end_a = ends_a[0] <= ends_a[1] ? 0 : 1;
      const int end_b = ends_b[0] <= ends_b[1] ? 0 : 1;
      if (ends_a[end_a] > gap) continue;
      Corner corner{ends_a[end_a], static_cast<int>(i), end_a, j, -1, t_a, t_b};
      if (ends_b[end_b] <= gap) {
        corner.end_b = end_b;
        corner.distance = std::max(corner.distance, ends_b[end_b]);
      }
      corners.push_back(corner);
    }
  }
  std::sort(corners.begin(), corners.end(),
            [](const Corner& x, const Corner& y) {
              return std::make_tuple(x.distance, x.a, x.b, x.end_a) <
                     std::make_tuple(y.distance, y.a, y.b, y.end_a);
            });
  std::vector<std::array<bool, 2>> is_joined(faces->size(), {false, false});
  const auto can_move = [&](int id, int end, double t) {
    const Face& face = (*faces)[id];
    const double length = end == 0 ? face.end - t : t - face.begin;
    // A short face is not turned round, nor eaten up.
    return length >= 0.5 * face.length();
  };
  const auto move = [&](int id, int end, double t) {
    Face& face = (*faces)[id];
    (end == 0 ? face.begin : face.end) = t;
    is_joined[id][end] = true;
  };
  for (const Corner& corner : corners) {
    if (is_joined[corner.a][corner.end_a] ||
        !can_move(corner.a, corner.end_a, corner.t_a)) {
      continue;
    }
    const Face& b = (*faces)[corner.b];
    const bool is_free = corner.end_b >= 0 &&
                         !is_joined[corner.b][corner.end_b] &&
                         can_move(corner.b, corner.end_b, corner.t_b);
    if (is_free) {
      move(corner.a, corner.end_a, corner.t_a);
      move(corner.b, corner.end_b, corner.t_b);
    } else if (corner.t_b >= b.begin && corner.t_b <= b.end) {
      move(corner.a, corner.end_a, corner.t_a);
    }
  }
}

// What stands between faces that are back to back.
std::vector<std::array<Vector2d, 4>> Solids(const FloorPlanOptions& options,
                                            const std::vector<Face>& faces) {
  Grid grid;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i].knows_side) {
      grid.Add(static_cast<int>(i), faces[i], options.max_thickness);
    }
  }
  std::vector<std::array<Vector2d, 4>> solids;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Face& a = faces[i];
    if (!a.knows_side) continue;
    for (const int j : grid.Near(a, options.max_thickness)) {
      const Face& b = faces[j];
      if (j <= static_cast<int>(i)) continue;
      if (a.along.dot(b.along) > -std::cos(options.merge_angle)) continue;
      // The room is on the left of each, the wall on the right.
      const double first = a.Along(b.At(b.end));
      const double last = a.Along(b.At(b.begin));
      const double begin = std::max(a.begin, first);
      const double end = std::min(a.end, last);
      if (end - begin < kLeastSolid) continue;
      const auto on_b = [&](double t) { return b.At(b.Along(a.At(t))); };
      const Vector2d corner_begin = on_b(begin);
      const Vector2d corner_end = on_b(end);
      const double thin =
          -std::max(a.Across(corner_begin), a.Across(corner_end));
      const double thick =
          -std::min(a.Across(corner_begin), a.Across(corner_end));
      if (thin < options.min_thickness || thick > options.max_thickness) {
        continue;
      }
      solids.push_back({a.At(begin), a.At(end), corner_end, corner_begin});
    }
  }
  return solids;
}

bool IsOnThePlan(double x, double y) {
  return std::abs(x) <= kFarthest && std::abs(y) <= kFarthest;
}

}  // namespace

FloorPlan MakeFloorPlan(const Graph& graph, const std::vector<Pose2>& path,
                        const FloorPlanOptions& options) {
  const MapDrawing drawing = DrawingFromGraph(graph, path);
  FloorPlan plan;
  plan.directions = SquaredDirections(graph, drawing);
  std::vector<Face> faces =
      Merge(Faces(graph, drawing, plan.directions), options);
  JoinCorners(options, &faces);
  plan.solids = Solids(options, faces);
  for (Face& face : faces) {
    if (face.length() < options.min_length) continue;
    FloorPlanWall wall;
    wall.begin = face.At(face.begin);
    wall.end = face.At(face.end);
    wall.direction = face.direction;
    std::sort(face.features.begin(), face.features.end());
    wall.features = std::move(face.features);
    plan.walls.push_back(std::move(wall));
  }
  std::sort(plan.walls.begin(), plan.walls.end(),
            [](const FloorPlanWall& a, const FloorPlanWall& b) {
              return a.features < b.features;
            });
  for (const DrawnCircle& circle : drawing.circles) {
    if (IsOnThePlan(circle.x, circle.y) && circle.radius > 0.0 &&
        circle.radius <= kFarthest) {
      plan.circles.push_back(circle);
    }
  }
  for (const Pose2& pose : drawing.path) {
    if (!IsOnThePlan(pose[0], pose[1])) continue;
    if (plan.path.empty() ||
        (pose - plan.path.back()).head<2>().norm() >= kLeastWay) {
      plan.path.push_back(pose);
    }
  }
  return plan;
}

void AddRooms(const OccupancyGrid& grid, const std::vector<Pose2>& path,
              FloorPlan* plan) {
  SpaceGrid space;
  space.resolution = grid.resolution();
  space.origin = grid.origin();
  space.width = grid.width();
  space.height = grid.height();
  space.cells.resize(static_cast<std::size_t>(space.width) * space.height,
                     Space::kUnknown);
  grid.VisitKnown([&](int column, int row, std::uint8_t pixel) {
    space.cells[static_cast<std::size_t>(row) * space.width + column] =
        pixel == OccupancyGrid::kFree ? Space::kFree : Space::kOccupied;
  });
  std::vector<KnownWall> walls;
  for (const FloorPlanWall& wall : plan->walls) {
    walls.push_back({wall.begin, wall.end});
  }
  plan->building = MakeBuildingPlan(walls, plan->directions, space, path);
}

std::string FloorPlanLayerName(const FloorPlan& plan, int direction) {
  if (direction < 0) return "WALLS-OTHER";
  // Rounded first, so that 179.97 degrees reads as 0.0.
  const double degrees = std::fmod(
      std::round(RadToDeg(plan.directions[direction]) * 10.0) / 10.0, 180.0);
  char text[64];
  std::snprintf(text, sizeof(text), "WALLS-%d-%.1fDEG", direction + 1, degrees);
  return text;
}

}  // namespace plumbline
