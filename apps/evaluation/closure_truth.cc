#include <plumbline/apps/evaluation/closure_truth.h>
#include <plumbline/core/disjoint_sets.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Segments are sampled this densely, m, and no segment more often than that:
// those of more than 1000 m are no walls.
constexpr double kStep = 0.05;
constexpr double kMostSamples = 20000.0;
// Faces in line to this (m, degrees) are one.
constexpr double kInLineOffset = 0.02;
constexpr double kInLineAngleDeg = 0.05;
// Segments on one face lie side by side from this on, m.
constexpr double kSideBySide = 0.3;

struct Face {
  Vector2d begin;
  // As the truth has it: the room on the right.
  Vector2d along;
  double length = 0.0;
};

// A segment of the map on the face that it belongs to.
struct Placed {
  // -1: on none.
  int face = -1;
  // Along the face's line, from the face's begin.
  double low = 0.0;
  double high = 0.0;
  double length = 0.0;
};

double Cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

std::vector<Face> Faces(const MapTruth& truth) {
  std::vector<Face> faces;
  for (const TruthWall& wall : truth.walls) {
    const double length = (wall.end - wall.begin).norm();
    if (!(length > 0.0)) continue;
    faces.push_back({wall.begin, (wall.end - wall.begin) / length, length});
  }
  return faces;
}

// A door and its wall.
bool AreNear(const Face& a, const Face& b) {
  return a.along.dot(b.along) > 0.0 &&
         std::abs(Cross(a.along, b.along)) <=
             std::sin(DegToRad(kInLineAngleDeg)) &&
         std::abs(Cross(a.along, b.begin - a.begin)) <= kSameWallOffset;
}

// Numbers of the lines that faces lie on, by face: that of the line's first
// face.
std::vector<int> Lines(const std::vector<Face>& faces) {
  DisjointSets sets(faces.size());
  const double sine = std::sin(DegToRad(kInLineAngleDeg));
  for (std::size_t i = 0; i < faces.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Vector2d between = faces[i].begin - faces[j].begin;
      if (faces[i].along.dot(faces[j].along) > 0.0 &&
          std::abs(Cross(faces[i].along, faces[j].along)) <= sine &&
          std::abs(Cross(faces[j].along, between)) <= kInLineOffset) {
        sets.Join(i, j);
      }
    }
  }
  std::vector<int> lines;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    lines.push_back(static_cast<int>(sets.Find(i)));
  }
  return lines;
}

Placed Place(const MapSegment& segment, const std::vector<Face>& faces,
             const std::vector<int>& lines, const Pose2& alignment,
             const MapTruthOptions& options) {
  Placed placed;
  const Pose2 pose = Compose(alignment, segment.pose);
  const Vector2d along(std::cos(pose[2]), std::sin(pose[2]));
  placed.length = segment.end - segment.begin;
  if (!(placed.length > 0.0)) return placed;
  const double sine = std::sin(DegToRad(options.maximum_angle_deg));
  const int samples = static_cast<int>(
      std::clamp(std::ceil(placed.length / kStep), 1.0, kMostSamples));
  // Samples by line.
  std::map<int, int> hits;
  for (int k = 0; k < samples; ++k) {
    const Vector2d point =
        pose.head<2>() +
        (segment.begin + (k + 0.5) * placed.length / samples) * along;
    int best = -1;
    bool is_best_facing = false;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const Face& face = faces[i];
      if (std::abs(Cross(face.along, along)) > sine) continue;
      const Vector2d relative = point - face.begin;
      const double at = face.along.dot(relative);
      if (at < -options.end_slack || at > face.length + options.end_slack) {
        continue;
      }
      const double across = std::abs(Cross(face.along, relative));
      if (across > options.maximum_offset) continue;
      // What stands out over an end belongs to what is there, if anything.
      const double offset =
          std::hypot(across, std::max({0.0, -at, at - face.length}));
      const bool is_facing = face.along.dot(along) < 0.0;
      if (best >= 0 &&
          (is_facing == is_best_facing ? offset >= least : is_best_facing)) {
        continue;
      }
      best = lines[i];
      is_best_facing = is_facing;
      least = offset;
    }
    if (best >= 0) ++hits[best];
  }
  int most = 0;
  for (const auto& [line, count] : hits) {
    if (count > most) {
      most = count;
      placed.face = line;
    }
  }
  // A segment may run over doors and the wall between them.
  int explained = 0;
  for (const auto& [line, count] : hits) {
    if (AreNear(faces[static_cast<std::size_t>(line)],
                faces[static_cast<std::size_t>(placed.face)])) {
      explained += count;
    }
  }
  if (explained < options.minimum_overlap * samples) placed.face = -1;
  if (placed.face >= 0) {
    const Face& face = faces[static_cast<std::size_t>(placed.face)];
    const double a =
        face.along.dot(pose.head<2>() + segment.begin * along - face.begin);
    const double b =
        face.along.dot(pose.head<2>() + segment.end * along - face.begin);
    placed.low = std::min(a, b);
    placed.high = std::max(a, b);
  }
  return placed;
}

enum class Verdict { kRight, kNear, kWrong };

Verdict Judge(const Placed& first, const Placed& second,
              const std::vector<Face>& faces) {
  if (first.face < 0 || second.face < 0) return Verdict::kWrong;
  if (first.face == second.face) return Verdict::kRight;
  return AreNear(faces[static_cast<std::size_t>(first.face)],
                 faces[static_cast<std::size_t>(second.face)])
             ? Verdict::kNear
             : Verdict::kWrong;
}

}  // namespace

ClosureEvaluation EvaluateClosures(const StraightMap& map,
                                   const MapTruth& truth,
                                   const Pose2& alignment,
                                   const MapTruthOptions& options) {
  const std::vector<Face> faces = Faces(truth);
  const std::vector<int> lines = Lines(faces);
  std::map<std::int64_t, std::size_t> index;
  std::vector<Placed> placed;
  for (const MapSegment& segment : map.segments) {
    index[segment.id] = placed.size();
    placed.push_back(Place(segment, faces, lines, alignment, options));
  }

  ClosureEvaluation evaluation;
  DisjointSets walls(placed.size());
  for (const MapClosure& closure : map.closures) {
    const std::size_t first = index.at(closure.first);
    const std::size_t second = index.at(closure.second);
    const Verdict verdict = Judge(placed[first], placed[second], faces);
    if (!closure.is_live) {
      ++(verdict == Verdict::kWrong ? evaluation.broken_wrong
                                    : evaluation.broken_right);
      continue;
    }
    walls.Join(first, second);
    switch (verdict) {
      case Verdict::kRight:
        ++evaluation.right;
        break;
      case Verdict::kNear:
        ++evaluation.near;
        break;
      case Verdict::kWrong:
        ++evaluation.wrong;
        evaluation.wrong_pairs.emplace_back(closure.first, closure.second);
        break;
    }
  }

  // Along each face the segments in the order of their begins; a group goes on
  // while the next lies beside what came before.
  std::map<int, std::vector<std::size_t>> on_face;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (placed[i].face >= 0 && placed[i].length >= options.minimum_length) {
      on_face[placed[i].face].push_back(i);
    }
  }
  for (auto& [face, members] : on_face) {
    std::sort(members.begin(), members.end(),
              [&placed](std::size_t a, std::size_t b) {
                return std::make_pair(placed[a].low, a) <
                       std::make_pair(placed[b].low, b);
              });
    std::map<std::size_t, int> roots;
    double reach = 0.0;
    const auto finish = [&] {
      int count = 0;
      for (const auto& root : roots) count += root.second;
      evaluation.revisits += std::max(0, count - 1);
      evaluation.closed_revisits += count - static_cast<int>(roots.size());
      roots.clear();
    };
    for (const std::size_t i : members) {
      if (!roots.empty() && placed[i].low > reach - kSideBySide) finish();
      reach = roots.empty() ? placed[i].high : std::max(reach, placed[i].high);
      ++roots[walls.Find(i)];
    }
    finish();
  }
  return evaluation;
}

}  // namespace plumbline
