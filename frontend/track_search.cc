#include <plumbline/frontend/track_search.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <utility>

namespace plumbline {
namespace {

// Points of a track that are searched with lie so far apart, m, and those that
// are kept of old key scans.
constexpr double kSearchSpacing = 0.2;
constexpr double kKeptSpacing = 0.1;
// Key scans that far from a pose say what was seen around it, m.
constexpr double kNear = 5.0;
// Key scans of one visit to a place at most.
constexpr std::size_t kLongestVisit = 40;
// Visits to a place that are looked at, and key scans that are searched in for
// each square of the floor, whose side is this, m.
constexpr std::size_t kMostVisits = 8;
constexpr std::size_t kMostThere = 32;
constexpr double kThere = 1.0;
// Peaks of a search that are looked at, the least score of one and its share of
// the best.
constexpr int kPeaks = 16;
constexpr double kLeastScore = 0.25;
constexpr double kPeakShare = 0.6;
// Points at most that tell how clearly key scans fit somewhere.
constexpr std::size_t kClearPoints = 128;
// Standard deviations of a tie: m and rad.
constexpr double kTieSigma = 0.03;
constexpr double kTieAngle = DegToRad(0.5);
// Where the returns say nothing, m.
constexpr double kOpenSigma = 2.0;

ScanPoint PointOf(const Eigen::Vector4f& values) {
  ScanPoint point{};
  point.position = values.head<2>().cast<double>();
  point.normal = values.tail<2>().cast<double>();
  return point;
}

Eigen::Matrix3d Diagonal(double translation, double rotation) {
  return Eigen::Vector3d(translation * translation, translation * translation,
                         rotation * rotation)
      .asDiagonal();
}

}  // namespace

// What key scans of a track have seen, in the frame of their middle.
struct TrackSearch::View {
  std::vector<const TrackKey*> keys;
  std::vector<Pose2> relative;
  // To search with, and those with normals to match with.
  std::vector<Eigen::Vector2d> sparse;
  std::vector<ScanPoint> dense;
};

// Scans that a pose is judged by.
struct TrackSearch::Visit {
  const ScanMatcher* matcher;
  // Of those searched in, [begin, end); empty for what was seen last.
  std::size_t begin = 0;
  std::size_t end = 0;
};

void TrackSearch::Add(const TrackKey& key, int part) {
  SeenKey kept;
  kept.scan = key.scan;
  kept.part = part;
  kept.pose = key.pose;
  kept.laser = key.laser;
  Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
  for (const ScanPoint& point : key.points) {
    if ((point.position - last).norm() < kKeptSpacing) continue;
    last = point.position;
    Eigen::Vector4f values;
    values << point.position.cast<float>(), point.normal.cast<float>();
    kept.points.push_back(values);
  }
  kept.points.shrink_to_fit();
  seen_.push_back(std::move(kept));
}

std::vector<TrackKey> TrackSearch::Unpacked(
    const std::vector<std::size_t>& where) const {
  std::vector<TrackKey> keys;
  for (const std::size_t k : where) {
    const SeenKey& kept = seen_[k];
    keys.push_back({kept.scan, kept.pose, {}, kept.laser});
    for (const Eigen::Vector4f& values : kept.points) {
      keys.back().points.push_back(PointOf(values));
    }
  }
  return keys;
}

ScanAgreement TrackSearch::CompareKey(
    std::size_t key, const std::vector<std::size_t>& others) const {
  ScanMatcher matcher(matcher_);
  SetReference(others, 0, others.size(), &matcher);
  std::vector<ScanPoint> points;
  for (const Eigen::Vector4f& values : seen_[key].points) {
    points.push_back(PointOf(values));
  }
  return matcher.Compare(points, seen_[key].pose, seen_[key].laser);
}

TrackSearch::View TrackSearch::ViewOf(const std::vector<TrackKey>& keys,
                                      std::size_t begin, std::size_t end) {
  View view;
  std::set<std::array<long, 2>> taken;
  std::set<std::array<long, 2>> taken_dense;
  const Pose2& middle = keys[(begin + end) / 2].pose;
  for (std::size_t k = begin; k < end; ++k) {
    view.keys.push_back(&keys[k]);
    view.relative.push_back(Between(middle, keys[k].pose));
    const PoseTransform transform(view.relative.back());
    for (const ScanPoint& point : keys[k].points) {
      const ScanPoint moved = Moved(point, transform);
      const auto cell = [&](double spacing) {
        return std::array<long, 2>{std::lround(moved.position.x() / spacing),
                                   std::lround(moved.position.y() / spacing)};
      };
      if (taken.insert(cell(kSearchSpacing)).second) {
        view.sparse.push_back(moved.position);
      }
      if (moved.normal.squaredNorm() > 0.0 &&
          taken_dense.insert(cell(kKeptSpacing)).second) {
        view.dense.push_back(moved);
      }
    }
  }
  return view;
}

bool TrackSearch::Judge(const View& view, const ScoredPose& peak,
                        const Visit& visit, double seen_through, bool is_global,
                        FoundTrack* hypothesis) const {
  MatchPrior none;
  none.pose = peak.pose;
  const MatchResult match = visit.matcher->Refine(view.dense, peak.pose, none);
  const Pose2 moved = Between(peak.pose, match.pose);
  // Nothing there to hold it.
  if (moved.head<2>().norm() > ScanMatcher::kPeakDistance ||
      std::abs(moved[2]) > ScanMatcher::kPeakRotation) {
    return false;
  }
  hypothesis->pose = match.pose;
  hypothesis->information = match.curvature;
  hypothesis->begin = visit.begin;
  hypothesis->end = visit.end;
  ScanAgreement sum;
  for (std::size_t k = 0; k < view.keys.size(); ++k) {
    const ScanAgreement a = visit.matcher->Compare(
        view.keys[k]->points, Compose(match.pose, view.relative[k]),
        view.keys[k]->laser);
    sum.hits += a.hits;
    sum.intruders += a.intruders;
    sum.unknown += a.unknown;
    sum.seen += a.seen;
    sum.seen_through += a.seen_through;
  }
  const double min_support =
      is_global ? tracking_.min_global_support : tracking_.min_tie_support;
  const double min_inliers =
      is_global ? tracking_.min_global_inliers : tracking_.min_tie_inliers;
  const double inliers = sum.OfKnown(match.inlier_ratio);
  hypothesis->support = sum.Support();
  hypothesis->quality = sum.Quality() * std::min(1.0, inliers);
  hypothesis->holds =
      peak.score >= tracking_.min_tie_score &&
      hypothesis->support >= min_support && inliers >= min_inliers &&
      sum.SeenThroughShare() <= tracking_.max_tie_seen_through + seen_through &&
      sum.KnownShare() >= tracking_.min_tie_known &&
      sum.hits >= tracking_.min_tie_hits * static_cast<int>(view.keys.size());
  if (trace_) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "  peak %.2f visit %d-%d -> %.2f %.2f %.1f ratio %.2f "
                  "hits %d intr %d unk %d seen %d thr %d q %.3f holds %d",
                  peak.score, static_cast<int>(visit.begin),
                  static_cast<int>(visit.end), match.pose[0], match.pose[1],
                  RadToDeg(match.pose[2]), match.inlier_ratio, sum.hits,
                  sum.intruders, sum.unknown, sum.seen, sum.seen_through,
                  hypothesis->quality, static_cast<int>(hypothesis->holds));
    trace_(text);
  }
  return true;
}

std::vector<FoundTrack> TrackSearch::Find(
    const std::vector<TrackKey>& keys, const ScanMatcher& reference,
    const std::function<std::vector<Visit>(const Pose2&)>& visits,
    const Pose2& center, double translation_window, std::size_t begin,
    std::size_t end, double seen_through, bool is_global,
    std::int64_t* nodes) const {
  const View view = ViewOf(keys, begin, end);
  const std::vector<ScoredPose> peaks = reference.Peaks(
      view.sparse, center, translation_window, kPi, kLeastScore, kPeakShare,
      kPeaks, is_global ? kNear : std::numeric_limits<double>::infinity(),
      stop_, nodes);
  std::vector<FoundTrack> hypotheses;
  for (const ScoredPose& peak : peaks) {
    for (const Visit& visit : visits(peak.pose)) {
      if (stop_ && stop_()) return {};
      FoundTrack hypothesis;
      if (Judge(view, peak, visit, seen_through, is_global, &hypothesis)) {
        hypotheses.push_back(hypothesis);
      }
    }
  }
  return hypotheses;
}

bool TrackSearch::IsClear(const std::vector<FoundTrack>& hypotheses,
                          FoundTrack* found) const {
  const FoundTrack* best = nullptr;
  for (const FoundTrack& hypothesis : hypotheses) {
    if (best == nullptr || hypothesis.quality > best->quality) {
      best = &hypothesis;
    }
  }
  if (best == nullptr || !best->holds) return false;
  for (const FoundTrack& rival : hypotheses) {
    // Seen on another visit a place lies beside itself.
    const bool same_visit = rival.begin < best->end
                                ? best->begin < rival.end
                                : rival.begin == best->begin;
    const Pose2 apart = Between(best->pose, rival.pose);
    if (apart.head<2>().norm() <
            (same_visit ? ScanMatcher::kPeakDistance : kVisitDistance) &&
        std::abs(apart[2]) <
            (same_visit ? ScanMatcher::kPeakRotation : kVisitRotation)) {
      continue;
    }
    if (rival.quality > tracking_.rival_share * best->quality) {
      return false;
    }
  }
  *found = *best;
  return true;
}

bool TrackSearch::FindHere(const std::vector<TrackKey>& keys,
                           const ScanMatcher& reference, const Pose2& center,
                           double window, std::size_t begin, std::size_t end,
                           double seen_through, FoundTrack* found) const {
  const auto visits = [&reference](const Pose2&) {
    return std::vector<Visit>{{&reference, 0, 0}};
  };
  return IsClear(Find(keys, reference, visits, center, window, begin, end,
                      seen_through, false, nullptr),
                 found);
}

void TrackSearch::SetReference(const std::vector<std::size_t>& where,
                               std::size_t begin, std::size_t end,
                               ScanMatcher* matcher) const {
  std::vector<ScanPoint> reference;
  std::vector<Viewpoint> viewpoints;
  for (std::size_t i = begin; i < end; ++i) {
    const SeenKey& key = seen_[where[i]];
    const PoseTransform transform(key.pose);
    viewpoints.push_back({transform.Point(key.laser), reference.size()});
    for (const Eigen::Vector4f& values : key.points) {
      reference.push_back(Moved(PointOf(values), transform));
    }
  }
  matcher->SetReference(std::move(reference), std::move(viewpoints));
}

std::vector<std::size_t> TrackSearch::Thinned(
    const std::vector<std::size_t>& where) const {
  std::map<std::pair<long, long>, std::vector<std::size_t>> there;
  for (const std::size_t k : where) {
    const Eigen::Vector2d at = seen_[k].pose.head<2>() / kThere;
    there[{std::lround(at.x()), std::lround(at.y())}].push_back(k);
  }
  std::vector<std::size_t> thinned;
  for (const auto& entry : there) {
    const std::vector<std::size_t>& all = entry.second;
    const std::size_t count = std::min(all.size(), kMostThere);
    for (std::size_t i = 0; i < count; ++i) {
      thinned.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
    }
  }
  std::sort(thinned.begin(), thinned.end());
  return thinned;
}

TrackSearch::SearchArea TrackSearch::AreaOf(
    const std::vector<std::size_t>& where) const {
  Eigen::Vector2d low = seen_[where.front()].pose.head<2>();
  Eigen::Vector2d high = low;
  for (const std::size_t k : where) {
    low = low.cwiseMin(seen_[k].pose.head<2>());
    high = high.cwiseMax(seen_[k].pose.head<2>());
  }
  const Eigen::Vector2d center = 0.5 * (low + high);
  SearchArea view{where, ScanMatcher(matcher_),
                  Pose2(center.x(), center.y(), 0.0),
                  0.5 * (high - low).maxCoeff() + 1.0};
  const std::vector<std::size_t> thinned = Thinned(where);
  SetReference(thinned, 0, thinned.size(), &view.matcher);
  return view;
}

std::vector<std::size_t> TrackSearch::KeysAround(const Pose2& pose,
                                                 double reach) const {
  std::vector<std::size_t> around;
  for (std::size_t k = 0; k < seen_.size(); ++k) {
    if (seen_[k].part == seen_.back().part &&
        (seen_[k].pose - pose).head<2>().norm() <= reach + kNear) {
      around.push_back(k);
    }
  }
  return around;
}

bool TrackSearch::FindAnywhere(const std::vector<TrackKey>& keys,
                               const SearchArea& area, std::size_t begin,
                               std::size_t end, double seen_through,
                               std::int64_t* nodes, FoundTrack* found) const {
  return IsClear(FindAll(keys, area, begin, end, seen_through, nodes), found);
}

std::vector<FoundTrack> TrackSearch::FindAll(const std::vector<TrackKey>& keys,
                                             const SearchArea& area,
                                             std::size_t begin, std::size_t end,
                                             double seen_through,
                                             std::int64_t* nodes) const {
  const std::vector<std::size_t>& where = area.where;
  std::deque<ScanMatcher> around;
  const auto visits = [&](const Pose2& pose) {
    std::vector<std::pair<std::size_t, std::size_t>> all;
    std::size_t k = 0;
    while (k < where.size()) {
      const auto is_near = [&](std::size_t i) {
        return (seen_[where[i]].pose - pose).head<2>().norm() <= kNear;
      };
      if (!is_near(k)) {
        ++k;
        continue;
      }
      const std::size_t first = k;
      while (k < where.size() && is_near(k) && k - first < kLongestVisit) ++k;
      if (k - first >= kShortestVisit) all.emplace_back(first, k);
    }
    // In even steps where they are many.
    const std::size_t count = std::min(all.size(), kMostVisits);
    std::vector<Visit> result;
    around.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const auto& [first, last] = all[(2 * i + 1) * all.size() / (2 * count)];
      around.emplace_back(matcher_);
      SetReference(where, first, last, &around.back());
      result.push_back({&around.back(), first, last});
    }
    return result;
  };
  return Find(keys, area.matcher, visits, area.center, area.window, begin, end,
              seen_through, true, nodes);
}

double TrackSearch::Clearness(const std::vector<TrackKey>& keys,
                              std::size_t begin, std::size_t end,
                              const SearchArea& area) const {
  const std::vector<Eigen::Vector2d> all = ViewOf(keys, begin, end).sparse;
  std::vector<Eigen::Vector2d> few;
  const std::size_t step = (all.size() + kClearPoints - 1) / kClearPoints;
  for (std::size_t i = 0; i < all.size(); i += step) few.push_back(all[i]);
  return area.matcher.ClearestScore(few, area.center, area.window, kPi, kNear,
                                    stop_);
}

std::size_t TrackSearch::NearestOf(
    const FoundTrack& found, const std::vector<std::size_t>& where) const {
  return *std::min_element(
      where.begin() + static_cast<std::ptrdiff_t>(found.begin),
      where.begin() + static_cast<std::ptrdiff_t>(found.end),
      [&](std::size_t a, std::size_t b) {
        return (seen_[a].pose - found.pose).head<2>().norm() <
               (seen_[b].pose - found.pose).head<2>().norm();
      });
}

Eigen::Matrix3d TieCovariance(const FoundTrack& found, const Pose2& from) {
  const Eigen::Matrix3d rotation = ComposeJacobianSecond(from).transpose();
  const Eigen::Matrix3d information =
      rotation * found.information * rotation.transpose() +
      Diagonal(kOpenSigma, kPi).inverse();
  return information.inverse() + Diagonal(kTieSigma, kTieAngle);
}

}  // namespace plumbline
