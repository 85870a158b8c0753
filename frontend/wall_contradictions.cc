#include <plumbline/factors/angle.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/wall_contradictions.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

// Stretches of wall that contradict are looked for among returns no farther
// from the laser than this, m: what is off by the angle of a match stays well
// below what is looked through. Returns of one stretch lie no farther apart
// than this, m, and two scans see the same one when its middle lies so near, m.
constexpr double kStretchRange = 8.0;
constexpr double kStretchGap = 0.3;
constexpr double kSameStretch = 0.7;
// A surface is looked through where it is free this far on either side, m, and
// what is left of a piece in the end has at least this length, m.
constexpr double kThroughWall = 0.15;
constexpr double kLeastPiece = 0.1;
// A door that stands elsewhere: an opening and a wall in the place of one, in
// one wall (m beside each other, and directions).
constexpr double kSameWall = 0.3;
constexpr double kSameWallTurn = DegToRad(20.0);

// Which points of a view lie where the matcher's reference looks through the
// surface: it is free there and on both sides. A beam along a wall is free
// beside it, and a little off the wall seems to be in it.
std::vector<bool> LookedThrough(const ScanMatcher& matcher, const KeyView& view,
                                const Pose2& pose) {
  std::vector<bool> through;
  matcher.Compare(view.points, pose, view.laser, &through);
  for (const double side : {-kThroughWall, kThroughWall}) {
    std::vector<ScanPoint> beside = view.points;
    for (ScanPoint& point : beside) point.position += side * point.normal;
    std::vector<bool> free;
    matcher.Compare(beside, pose, view.laser, &free);
    for (std::size_t i = 0; i < through.size(); ++i) {
      through[i] = through[i] && free[i];
    }
  }
  return through;
}

// Appends the stretches that a view sees and that the matcher's reference looks
// through. `pose`: of the view in the reference's frame, `reference`: of that
// in the map's.
void AppendStretches(const ScanMatcher& matcher, const KeyView& view,
                     std::size_t index, const Pose2& pose,
                     const Pose2& reference,
                     std::vector<WallStretch>* stretches) {
  const std::vector<bool> intrudes = LookedThrough(matcher, view, pose);
  const PoseTransform transform(Compose(reference, pose));
  // Legs and the like have no normal.
  const auto is_part = [&](std::size_t i) {
    return intrudes[i] && view.points[i].normal.squaredNorm() > 0.0;
  };
  for (std::size_t begin = 0; begin < view.points.size();) {
    std::size_t end = begin;
    while (
        end < view.points.size() && is_part(end) &&
        (end == begin ||
         (view.points[end].position - view.points[end - 1].position).norm() <=
             kStretchGap)) {
      ++end;
    }
    if (end == begin) {
      ++begin;
      continue;
    }
    const Eigen::Vector2d& first = view.points[begin].position;
    const Eigen::Vector2d& last = view.points[end - 1].position;
    Eigen::Vector2d normal = Eigen::Vector2d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      normal += Moved(view.points[i], transform).normal;
    }
    stretches->push_back({index, transform.Point(0.5 * (first + last)),
                          normal.normalized(), (last - first).norm()});
    begin = end;
  }
}

// Without the returns that lie too far away to be compared as stretches.
KeyView NearPart(KeyView view) {
  view.points.erase(std::remove_if(view.points.begin(), view.points.end(),
                                   [](const ScanPoint& point) {
                                     return point.range > kStretchRange;
                                   }),
                    view.points.end());
  return view;
}

// The pieces of wall that two scans of one of both see and that the other looks
// through: of each the shorter view, the longest first.
std::vector<WallStretch> PiecesOf(std::vector<WallStretch> stretches) {
  const auto by_length = [](const WallStretch& a, const WallStretch& b) {
    return a.length > b.length;
  };
  std::stable_sort(stretches.begin(), stretches.end(), by_length);
  std::vector<const WallStretch*> taken;
  std::vector<WallStretch> pieces;
  for (const WallStretch& a : stretches) {
    const bool is_known =
        std::any_of(taken.begin(), taken.end(), [&a](const WallStretch* other) {
          return (other->middle - a.middle).norm() <
                 std::max(kSameStretch, 0.5 * (other->length + a.length));
        });
    if (is_known) continue;
    WallStretch piece = a;
    piece.length = 0.0;
    for (const WallStretch& b : stretches) {
      if (b.view == a.view || b.length > a.length ||
          (a.middle - b.middle).norm() > kSameStretch) {
        continue;
      }
      piece.length = std::max(piece.length, b.length);
    }
    if (piece.length < kLeastPiece) continue;
    taken.push_back(&a);
    pieces.push_back(piece);
  }
  std::stable_sort(pieces.begin(), pieces.end(), by_length);
  return pieces;
}

}  // namespace

double WallContradictions::length() const {
  double sum = 0.0;
  for (const auto* pieces : {&of_track, &of_map}) {
    for (const WallStretch& piece : *pieces) sum += piece.length;
  }
  return sum;
}

double WallContradictions::longest() const {
  double most = 0.0;
  for (const auto* pieces : {&of_track, &of_map}) {
    for (const WallStretch& piece : *pieces)
      most = std::max(most, piece.length);
  }
  return most;
}

int CountMovedDoors(const WallContradictions& contradictions, double reach) {
  std::vector<bool> is_taken(contradictions.of_map.size(), false);
  int moved = 0;
  for (const WallStretch& shut : contradictions.of_track) {
    double nearest = reach;
    std::size_t taken = is_taken.size();
    for (std::size_t i = 0; i < is_taken.size(); ++i) {
      const WallStretch& opened = contradictions.of_map[i];
      const Eigen::Vector2d apart = opened.middle - shut.middle;
      const double beside = std::min(std::abs(shut.normal.dot(apart)),
                                     std::abs(opened.normal.dot(apart)));
      if (is_taken[i] || apart.norm() > nearest || beside > kSameWall ||
          std::abs(shut.normal.dot(opened.normal)) < std::cos(kSameWallTurn)) {
        continue;
      }
      nearest = apart.norm();
      taken = i;
    }
    if (taken == is_taken.size()) continue;
    is_taken[taken] = true;
    ++moved;
  }
  return moved;
}

WallContradictions FindWallContradictions(
    const std::vector<KeyView>& map, const std::vector<KeyView>& track,
    const std::vector<TrackWindow>& windows,
    const std::vector<WindowJudgement>& judgements,
    const TrackPlacementOptions& options) {
  // Those that the track has and those that the map has.
  std::vector<WallStretch> of_track;
  std::vector<WallStretch> of_map;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != WindowVerdict::kAgrees) continue;
    const Pose2& pose = judgements[w].pose;
    std::vector<KeyView> there;
    const std::vector<std::size_t> indices = ViewsNear(
        map, pose, options.radius, static_cast<std::size_t>(options.max_views));
    for (const std::size_t k : indices) there.push_back(NearPart(map[k]));
    std::vector<KeyView> here;
    for (std::size_t k = windows[w].begin; k < windows[w].end; ++k) {
      here.push_back(NearPart(track[k]));
      here.back().pose = windows[w].relative[k - windows[w].begin];
    }
    ScanMatcher matcher(options.matcher);
    SetReference(there, &matcher);
    if (matcher.empty()) continue;
    for (std::size_t k = 0; k < here.size(); ++k) {
      AppendStretches(matcher, here[k], windows[w].begin + k,
                      Compose(pose, here[k].pose), Pose2::Zero(), &of_track);
    }
    SetReference(here, &matcher);
    if (matcher.empty()) continue;
    for (std::size_t k = 0; k < there.size(); ++k) {
      AppendStretches(matcher, there[k], indices[k],
                      Between(pose, there[k].pose), pose, &of_map);
    }
  }
  return {PiecesOf(std::move(of_track)), PiecesOf(std::move(of_map))};
}

}  // namespace plumbline
