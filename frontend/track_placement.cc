#include <plumbline/core/error.h>
#include <plumbline/frontend/track_placement.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <set>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Points of a view lie so far apart, m, and those that a search is made with.
constexpr double kViewSpacing = 0.1;
constexpr double kSearchSpacing = 0.4;
// Least score of a place that a search finds, and its share of the best.
constexpr double kLeastScore = 0.4;
constexpr double kPeakShare = 0.7;
// Windows that are searched for before the places found are judged, and how
// many times the windows that have to agree must do so to search no further.
constexpr std::size_t kBatch = 6;
constexpr int kClear = 2;
// Two places of the track are one when they put both windows so near to each
// other, m and rad.
constexpr double kSameDistance = 1.5;
constexpr double kSameTurn = DegToRad(8.0);
// A rival lies farther off than this, m or rad.
constexpr double kRivalDistance = 2.0;
constexpr double kRivalTurn = DegToRad(15.0);
// A contradicting window speaks against a place like so many agreeing ones for
// it.
constexpr double kContradictionWeight = 2.0;
// Counted returns of a window from which on its shares say something.
constexpr int kLeastReturns = 40;
// Known shares are not divided by less.
constexpr double kLeastKnown = 0.4;
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
// one wall (m beside each other, and directions) no farther from each other
// than this, m.
constexpr double kSameWall = 0.3;
constexpr double kSameWallTurn = DegToRad(20.0);
constexpr double kMovedDoor = 3.0;
// The share of the best place's support from which on another one may be the
// place where the best contradicts the map.
constexpr double kNearlyAsMuch = 0.9;
// The share of the best place's support from which on a rival is told.
constexpr double kToldRival = 0.4;
// Doors of a mirror image that were seen in passing speak one way only: of all
// places that changed so many are openings, and so many walls.
constexpr int kLeastEachWay = 2;
// Position and direction of a window, m and rad, in the fit of the track.
constexpr double kWindowDistance = 0.1;
constexpr double kWindowTurn = DegToRad(1.0);

// Consecutive views of a track.
struct Window {
  std::size_t begin = 0;
  std::size_t end = 0;
  // Of the view in the middle, in the track's frame.
  Pose2 middle = Pose2::Zero();
  // Of each view in the frame of the middle.
  std::vector<Pose2> relative;
  // Points in the frame of the middle: few, and those with a normal.
  std::vector<Eigen::Vector2d> sparse;
  std::vector<ScanPoint> dense;
};

std::vector<Window> MakeWindows(const std::vector<KeyView>& track,
                                std::size_t size) {
  std::vector<Window> windows;
  // What is left over makes the last windows longer.
  const std::size_t count = std::max<std::size_t>(1, track.size() / size);
  for (std::size_t w = 0; w < count; ++w) {
    Window window;
    window.begin = w * track.size() / count;
    window.end = (w + 1) * track.size() / count;
    window.middle = track[(window.begin + window.end) / 2].pose;
    std::set<std::array<long, 2>> taken_sparse;
    std::set<std::array<long, 2>> taken_dense;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      window.relative.push_back(Between(window.middle, track[k].pose));
      const PoseTransform transform(window.relative.back());
      for (const ScanPoint& point : track[k].points) {
        const ScanPoint moved = Moved(point, transform);
        const auto cell = [&](double spacing) {
          return std::array<long, 2>{std::lround(moved.position.x() / spacing),
                                     std::lround(moved.position.y() / spacing)};
        };
        if (taken_sparse.insert(cell(kSearchSpacing)).second) {
          window.sparse.push_back(moved.position);
        }
        if (moved.normal.squaredNorm() > 0.0 &&
            taken_dense.insert(cell(kViewSpacing)).second) {
          window.dense.push_back(moved);
        }
      }
    }
    windows.push_back(std::move(window));
  }
  return windows;
}

void SetMap(const std::vector<KeyView>& map, ScanMatcher* matcher) {
  std::vector<ScanPoint> points;
  std::vector<Viewpoint> viewpoints;
  for (const KeyView& view : map) {
    const PoseTransform transform(view.pose);
    viewpoints.push_back({transform.Point(view.laser), points.size()});
    for (const ScanPoint& point : view.points) {
      points.push_back(Moved(point, transform));
    }
  }
  matcher->SetReference(std::move(points), std::move(viewpoints));
}

std::string Parts(int number) {
  return std::to_string(number) + (number == 1 ? " part" : " parts");
}

std::string ShortText(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

enum class Verdict { kUnknown, kDoubtful, kAgrees, kContradicts };

// What one window says of a place of the track.
struct Judgement {
  Verdict verdict = Verdict::kUnknown;
  // Of the window's middle, in the map's frame, matched where it agrees.
  Pose2 pose = Pose2::Zero();
  double quality = 0.0;
  // What the returns say of the middle's position, map's frame.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
};

// The views around a place, those of many that are spread evenly.
std::vector<std::size_t> ViewsNear(const std::vector<KeyView>& map,
                                   const Pose2& place,
                                   const TrackPlacementOptions& options) {
  std::vector<std::size_t> near;
  for (std::size_t k = 0; k < map.size(); ++k) {
    if ((map[k].pose - place).head<2>().norm() <= options.radius) {
      near.push_back(k);
    }
  }
  const auto most = static_cast<std::size_t>(options.max_views);
  if (near.size() <= most) return near;
  std::vector<std::size_t> spread;
  for (std::size_t i = 0; i < most; ++i) {
    spread.push_back(near[i * near.size() / most]);
  }
  return spread;
}

Judgement Judge(const std::vector<KeyView>& map,
                const std::vector<KeyView>& track, const Window& window,
                const Pose2& guess, const TrackPlacementOptions& options) {
  Judgement judgement;
  judgement.pose = guess;
  std::vector<KeyView> near;
  for (const std::size_t k : ViewsNear(map, guess, options)) {
    near.push_back(map[k]);
  }
  if (near.empty()) return judgement;
  ScanMatcher matcher(options.matcher);
  SetMap(near, &matcher);
  if (matcher.empty()) return judgement;
  const auto compare = [&](const Pose2& pose) {
    ScanAgreement sum;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      const ScanAgreement a = matcher.Compare(
          track[k].points, Compose(pose, window.relative[k - window.begin]),
          track[k].laser);
      sum.hits += a.hits;
      sum.intruders += a.intruders;
      sum.unknown += a.unknown;
      sum.seen += a.seen;
      sum.seen_through += a.seen_through;
    }
    return sum;
  };
  MatchPrior none;
  none.pose = guess;
  none.information =
      Eigen::Vector3d(1.0 / (options.max_shift * options.max_shift),
                      1.0 / (options.max_shift * options.max_shift),
                      1.0 / (options.max_turn * options.max_turn))
          .asDiagonal();
  const MatchResult match = matcher.Refine(window.dense, guess, none);
  const Pose2 moved = Between(guess, match.pose);
  const bool stays = moved.head<2>().norm() <= options.max_shift &&
                     std::abs(moved[2]) <= options.max_turn;
  const ScanAgreement sum = compare(stays ? match.pose : guess);
  const int known = sum.hits + sum.intruders;
  const double known_share =
      static_cast<double>(known) / std::max(1, known + sum.unknown);
  if (known < kLeastReturns) return judgement;
  const double support = static_cast<double>(sum.hits) / known;
  const double through =
      sum.seen > 0 ? static_cast<double>(sum.seen_through) / sum.seen : 0.0;
  const double inliers =
      match.inlier_ratio / std::max(kLeastKnown, known_share);
  if (stays && known_share >= options.min_known &&
      support >= options.min_support && through <= options.max_seen_through &&
      inliers >= options.min_inliers) {
    judgement.verdict = Verdict::kAgrees;
    judgement.pose = match.pose;
    judgement.information = match.information.topLeftCorner<2, 2>();
    judgement.quality = known_share * support * (1.0 - through);
  } else if (1.0 - support > options.max_intruders ||
             (sum.seen >= kLeastReturns &&
              through > options.max_looked_through)) {
    judgement.verdict = Verdict::kContradicts;
  } else if (known_share >= options.min_known) {
    judgement.verdict = Verdict::kDoubtful;
  }
  return judgement;
}

// A straight run of returns of one scan that stand where others have looked
// through.
struct Stretch {
  std::size_t view = 0;
  // Map's frame.
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  double length = 0.0;
};

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
                     const Pose2& reference, std::vector<Stretch>* stretches) {
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
std::vector<Stretch> PiecesOf(std::vector<Stretch> stretches) {
  const auto by_length = [](const Stretch& a, const Stretch& b) {
    return a.length > b.length;
  };
  std::stable_sort(stretches.begin(), stretches.end(), by_length);
  std::vector<const Stretch*> taken;
  std::vector<Stretch> pieces;
  for (const Stretch& a : stretches) {
    const bool is_known =
        std::any_of(taken.begin(), taken.end(), [&a](const Stretch* other) {
          return (other->middle - a.middle).norm() <
                 std::max(kSameStretch, 0.5 * (other->length + a.length));
        });
    if (is_known) continue;
    Stretch piece = a;
    piece.length = 0.0;
    for (const Stretch& b : stretches) {
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

// What stands where the other looks through, of what the track has and of what
// the map has.
struct Contradictions {
  std::vector<Stretch> of_track;
  std::vector<Stretch> of_map;

  std::size_t number() const { return of_track.size() + of_map.size(); }
  // Of all pieces, and of the longest, m.
  double length() const {
    double sum = 0.0;
    for (const auto* pieces : {&of_track, &of_map}) {
      for (const Stretch& piece : *pieces) sum += piece.length;
    }
    return sum;
  }
  double longest() const {
    double most = 0.0;
    for (const auto* pieces : {&of_track, &of_map}) {
      for (const Stretch& piece : *pieces) most = std::max(most, piece.length);
    }
    return most;
  }
};

// Doors that stand elsewhere in the same wall. People shut one door and open
// another, but hardly twice in neighbouring ones.
int MovedDoors(const Contradictions& contradictions) {
  std::vector<bool> is_taken(contradictions.of_map.size(), false);
  int moved = 0;
  for (const Stretch& shut : contradictions.of_track) {
    double nearest = kMovedDoor;
    std::size_t taken = is_taken.size();
    for (std::size_t i = 0; i < is_taken.size(); ++i) {
      const Stretch& opened = contradictions.of_map[i];
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

// What the windows that agree with a map say of it and the map says of them.
Contradictions FindContradictions(const std::vector<KeyView>& map,
                                  const std::vector<KeyView>& track,
                                  const std::vector<Window>& windows,
                                  const std::vector<Judgement>& judgements,
                                  const TrackPlacementOptions& options) {
  // Those that the track has and those that the map has.
  std::vector<Stretch> of_track;
  std::vector<Stretch> of_map;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != Verdict::kAgrees) continue;
    const Pose2& pose = judgements[w].pose;
    std::vector<KeyView> there;
    std::vector<std::size_t> indices = ViewsNear(map, pose, options);
    for (const std::size_t k : indices) there.push_back(NearPart(map[k]));
    std::vector<KeyView> here;
    for (std::size_t k = windows[w].begin; k < windows[w].end; ++k) {
      here.push_back(NearPart(track[k]));
      here.back().pose = windows[w].relative[k - windows[w].begin];
    }
    ScanMatcher matcher(options.matcher);
    SetMap(there, &matcher);
    if (matcher.empty()) continue;
    for (std::size_t k = 0; k < here.size(); ++k) {
      AppendStretches(matcher, here[k], windows[w].begin + k,
                      Compose(pose, here[k].pose), Pose2::Zero(), &of_track);
    }
    SetMap(here, &matcher);
    if (matcher.empty()) continue;
    for (std::size_t k = 0; k < there.size(); ++k) {
      AppendStretches(matcher, there[k], indices[k],
                      Between(pose, there[k].pose), pose, &of_map);
    }
  }
  return {PiecesOf(std::move(of_track)), PiecesOf(std::move(of_map))};
}

// Pose of the track's frame in the map's that suits windows which agree best:
// least squares of positions and directions.
Pose2 FitTrack(const std::vector<Window>& windows,
               const std::vector<Judgement>& judgements) {
  Eigen::Vector2d mean_map = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_track = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != Verdict::kAgrees) continue;
    mean_map += judgements[w].pose.head<2>();
    mean_track += windows[w].middle.head<2>();
    weight += 1.0;
  }
  mean_map /= weight;
  mean_track /= weight;
  constexpr double kLever =
      (kWindowDistance / kWindowTurn) * (kWindowDistance / kWindowTurn);
  double sine = 0.0;
  double cosine = 0.0;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    if (judgements[w].verdict != Verdict::kAgrees) continue;
    const Eigen::Vector2d p = judgements[w].pose.head<2>() - mean_map;
    const Eigen::Vector2d q = windows[w].middle.head<2>() - mean_track;
    const double turn = judgements[w].pose[2] - windows[w].middle[2];
    cosine += q.dot(p) + kLever * std::cos(turn);
    sine += q.x() * p.y() - q.y() * p.x() + kLever * std::sin(turn);
  }
  const double angle = std::atan2(sine, cosine);
  Eigen::Matrix2d rotation;
  rotation << std::cos(angle), -std::sin(angle), std::sin(angle),
      std::cos(angle);
  const Eigen::Vector2d shift = mean_map - rotation * mean_track;
  return Pose2(shift.x(), shift.y(), angle);
}

// A place of the track, with what all windows say of it.
struct Candidate {
  // Of the track's frame; the window that speaks for it.
  Pose2 pose = Pose2::Zero();
  std::size_t window = 0;
  double score = 0.0;
  // Windows that were searched for and may lie there.
  int votes = 0;
  std::vector<Judgement> judgements;
  int agreeing = 0;
  int contradicting = 0;
  int doubtful = 0;
  // Once they were asked for.
  std::optional<Contradictions> contradictions;
  double support() const {
    return agreeing - kContradictionWeight * contradicting;
  }
};

bool AreOne(const Candidate& a, const Candidate& b,
            const std::vector<Window>& windows, double distance, double turn) {
  if (std::abs(NormalizeAngle(a.pose[2] - b.pose[2])) > turn) return false;
  for (const std::size_t w : {a.window, b.window}) {
    const Eigen::Vector2d middle = windows[w].middle.head<2>();
    if ((PoseTransform(a.pose).Point(middle) -
         PoseTransform(b.pose).Point(middle))
            .norm() > distance) {
      return false;
    }
  }
  return true;
}

// Asks all windows, the ones near the one that speaks for it first: a track
// bends, and those that agree carry on to the next.
void JudgeCandidate(const std::vector<KeyView>& map,
                    const std::vector<KeyView>& track,
                    const std::vector<Window>& windows,
                    const TrackPlacementOptions& options,
                    Candidate* candidate) {
  candidate->judgements.assign(windows.size(), Judgement());
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    order.emplace_back((windows[w].middle - windows[candidate->window].middle)
                           .head<2>()
                           .norm(),
                       w);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [distance, w] : order) {
    // From the nearest window that agrees.
    Pose2 guess = Compose(candidate->pose, windows[w].middle);
    double nearest = -1.0;
    for (std::size_t other = 0; other < windows.size(); ++other) {
      const Judgement& judgement = candidate->judgements[other];
      if (judgement.verdict != Verdict::kAgrees) continue;
      const double apart =
          (windows[other].middle - windows[w].middle).head<2>().norm();
      if (nearest >= 0.0 && apart >= nearest) continue;
      nearest = apart;
      guess = Compose(judgement.pose,
                      Between(windows[other].middle, windows[w].middle));
    }
    candidate->judgements[w] = Judge(map, track, windows[w], guess, options);
    const Verdict verdict = candidate->judgements[w].verdict;
    candidate->agreeing += verdict == Verdict::kAgrees ? 1 : 0;
    candidate->contradicting += verdict == Verdict::kContradicts ? 1 : 0;
    candidate->doubtful += verdict == Verdict::kDoubtful ? 1 : 0;
    if (w == candidate->window && verdict != Verdict::kAgrees) return;
    if (candidate->contradicting >= 3 &&
        candidate->contradicting > candidate->agreeing) {
      return;
    }
  }
}

// Places of a track in a map, found window by window.
class Search {
 public:
  // All must outlive it.
  Search(const std::vector<KeyView>& map, const std::vector<KeyView>& track,
         const std::optional<Pose2>& start,
         const TrackPlacementOptions& options)
      : map_(map),
        track_(track),
        start_(start),
        options_(options),
        windows_(
            MakeWindows(track, static_cast<std::size_t>(options.window_keys))),
        whole_(options.matcher) {
    Eigen::Vector2d low = map.front().pose.head<2>();
    Eigen::Vector2d high = low;
    for (const KeyView& view : map) {
      low = low.cwiseMin(view.pose.head<2>());
      high = high.cwiseMax(view.pose.head<2>());
    }
    SetMap(map, &whole_);
    center_ << 0.5 * (low + high), 0.0;
    reach_ = 0.5 * (high - low).maxCoeff() + 1.0;
  }

  std::size_t num_windows() const { return windows_.size(); }

  // Looks for a window in the whole map.
  void Look(std::size_t w) {
    for (const ScoredPose& peak :
         whole_.Peaks(windows_[w].sparse, center_, reach_, kPi, kLeastScore,
                      kPeakShare, options_.max_peaks)) {
      Candidate candidate;
      candidate.pose = Compose(peak.pose, Inverse(windows_[w].middle));
      candidate.window = w;
      candidate.score = peak.score;
      if (start_) {
        const Pose2 off =
            Between(*start_, Compose(candidate.pose, track_.front().pose));
        if (off.head<2>().norm() > options_.start_distance ||
            std::abs(off[2]) > options_.start_turn) {
          continue;
        }
      }
      found_.push_back(std::move(candidate));
    }
  }

  // Judges the places that most windows speak for, `most` in all. False when it
  // was stopped.
  bool JudgeFound(std::size_t most, const std::function<bool()>& stop) {
    for (Candidate& candidate : found_) {
      std::set<std::size_t> voters;
      for (const Candidate& other : found_) {
        if (AreOne(candidate, other, windows_, kSameDistance, kSameTurn)) {
          voters.insert(other.window);
        }
      }
      candidate.votes = static_cast<int>(voters.size());
    }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Candidate& a, const Candidate& b) {
                       return std::make_pair(a.votes, a.score) >
                              std::make_pair(b.votes, b.score);
                     });
    for (const Candidate& found : found_) {
      if (stop && stop()) return false;
      if (judged_.size() >= most) break;
      bool is_known = false;
      for (const Candidate& other : judged_) {
        is_known = is_known ||
                   AreOne(found, other, windows_, kSameDistance, kSameTurn);
      }
      if (is_known) continue;
      judged_.push_back(found);
      Candidate& candidate = judged_.back();
      JudgeCandidate(map_, track_, windows_, options_, &candidate);
      if (candidate.agreeing > 0) {
        candidate.pose = FitTrack(windows_, candidate.judgements);
      }
    }
    return true;
  }

  // What there is to say by now.
  TrackPlacement Decide() {
    TrackPlacement placement;
    placement.windows = static_cast<int>(windows_.size());
    Candidate* best = FindBest();
    if (best == nullptr) {
      placement.why_not = "no part of it looks like a part of the map";
      return placement;
    }
    placement.pose = best->pose;
    placement.agreeing = best->agreeing;
    placement.contradicting = best->contradicting;
    placement.doubtful = best->doubtful;
    for (Candidate& rival : judged_) {
      if (&rival == best || rival.support() <= placement.rival ||
          AreOne(*best, rival, windows_, kRivalDistance, kRivalTurn) ||
          (rival.support() > kToldRival * best->support() &&
           IsRather(best, &rival))) {
        continue;
      }
      placement.rival = rival.support();
    }
    placement.misfit = Misfit(*best);
    placement.why_not = WhyNot(best, &placement);
    placement.found = placement.why_not.empty();
    if (placement.found) {
      placement.doubt = Doubt(*best, placement);
      TakeTie(*best, &placement);
    }
    return placement;
  }

 private:
  // The place that most speaks for. Of places that it speaks for nearly as
  // much one where the building is not another is rather its place.
  Candidate* FindBest() {
    Candidate* best = nullptr;
    for (Candidate& candidate : judged_) {
      if (candidate.agreeing > 0 &&
          (best == nullptr || candidate.support() > best->support())) {
        best = &candidate;
      }
    }
    if (best == nullptr) return best;
    Candidate* other = nullptr;
    for (Candidate& candidate : judged_) {
      if (candidate.support() >= kNearlyAsMuch * best->support() &&
          (other == nullptr || candidate.support() > other->support()) &&
          &candidate != best && IsRather(&candidate, best)) {
        other = &candidate;
      }
    }
    return other != nullptr ? other : best;
  }

  // Whether a place is one by what speaks against it, and another one is none
  // that clearly more speaks against.
  bool IsRather(Candidate* place, Candidate* other) {
    const Contradictions& of_place = ContradictionsOf(place);
    const Contradictions& of_other = ContradictionsOf(other);
    return 2 * of_place.number() <= of_other.number() &&
           WhyAnother(place->agreeing, of_place).empty() &&
           !WhyAnother(other->agreeing, of_other).empty();
  }

  // Those of a place, which are found once.
  const Contradictions& ContradictionsOf(Candidate* candidate) {
    if (!candidate->contradictions) {
      candidate->contradictions = FindContradictions(
          map_, track_, windows_, candidate->judgements, options_);
    }
    return *candidate->contradictions;
  }

  // RMS distance of the windows that agree from where the track has them, m.
  double Misfit(const Candidate& candidate) const {
    double sum = 0.0;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const Judgement& judgement = candidate.judgements[w];
      if (judgement.verdict != Verdict::kAgrees) continue;
      sum += (judgement.pose - Compose(candidate.pose, windows_[w].middle))
                 .head<2>()
                 .squaredNorm();
    }
    return std::sqrt(sum / std::max(1, candidate.agreeing));
  }

  // RMS distance of the windows that agree from their middle, m.
  double Spread(const Candidate& candidate) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double squares = 0.0;
    for (const Judgement& judgement : candidate.judgements) {
      if (judgement.verdict != Verdict::kAgrees) continue;
      sum += judgement.pose.head<2>();
      squares += judgement.pose.head<2>().squaredNorm();
    }
    const double count = std::max(1, candidate.agreeing);
    return std::sqrt(
        std::max(0.0, squares / count - (sum / count).squaredNorm()));
  }

  // Nothing when it is its place.
  std::string WhyNot(Candidate* best, TrackPlacement* placement) {
    const int least =
        start_ ? options_.min_agreeing_at_start : options_.min_agreeing;
    if (best->agreeing < least) {
      return "only " + Parts(best->agreeing) + " of " +
             std::to_string(windows_.size()) + " found a place in the map";
    }
    if (best->contradicting >
        options_.max_contradicting * (best->agreeing + best->contradicting)) {
      return "where " + Parts(best->agreeing) + " of it would fit, " +
             Parts(best->contradicting) + " would contradict";
    }
    if (placement->rival > options_.rival_share * best->support()) {
      return "it would fit in more than one place";
    }
    if (placement->misfit >
        options_.max_misfit + options_.max_misfit_per_metre * Spread(*best)) {
      return "its parts fit, but not together: they lie " +
             ShortText(placement->misfit) + " m (RMS) from where it has them";
    }
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    for (const Judgement& judgement : best->judgements) {
      information += judgement.information;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(information);
    if (solver.eigenvalues()[0] <
        options_.min_information_share * solver.eigenvalues()[1]) {
      return "it could be moved along the walls that it shares with the map";
    }
    const Contradictions& contradictions = ContradictionsOf(best);
    placement->walls_through_map =
        static_cast<int>(contradictions.of_track.size());
    placement->walls_through_track =
        static_cast<int>(contradictions.of_map.size());
    placement->contradicting_length = contradictions.length();
    return WhyAnother(best->agreeing, contradictions);
  }

  // Why the contradictions of a place say that it is another building, though
  // so many windows agree; empty when they do not.
  std::string WhyAnother(int agreeing,
                         const Contradictions& contradictions) const {
    const std::string would = "where " + Parts(agreeing) + " of it would fit, ";
    const double longest = contradictions.longest();
    if (longest > options_.max_contradicting_stretch) {
      return would + "one of both has " + ShortText(longest) +
             " m of wall where the other has none";
    }
    const int moved = MovedDoors(contradictions);
    if (moved >= (start_ ? options_.min_moved_doors_at_start
                         : options_.min_moved_doors)) {
      return would + std::to_string(moved) +
             (moved == 1 ? " door stands" : " doors stand") +
             " elsewhere in the same wall, as in another building or in its "
             "mirror image (--start_pose says that it is this building)";
    }
    const auto of_track = static_cast<int>(contradictions.of_track.size());
    const auto of_map = static_cast<int>(contradictions.of_map.size());
    const int exchanged = of_track + of_map;
    const int each_way = std::min(of_track, of_map);
    if (each_way >= 1 && exchanged >= options_.min_exchanged &&
        exchanged >= agreeing) {
      return would + std::to_string(exchanged) +
             " places have a wall in one and an opening in the other";
    }
    if (each_way >= kLeastEachWay && exchanged >= 2 * options_.min_exchanged &&
        exchanged > 2.0 * options_.max_exchanged_share * agreeing) {
      return would + "it has wall at " + std::to_string(of_track) +
             " places where the map has openings, and openings at " +
             std::to_string(of_map) +
             " places where the map has wall, as a mirror image of the "
             "building has";
    }
    return "";
  }

  // What else the place that was found might be; empty when there is no doubt.
  std::string Doubt(const Candidate& best,
                    const TrackPlacement& placement) const {
    std::string doubt;
    const auto add = [&doubt](const std::string& reason) {
      doubt += (doubt.empty() ? "" : "; ") + reason;
    };
    if (!start_ && best.agreeing < kClear * options_.min_agreeing) {
      add("only " + std::to_string(best.agreeing) + " of " +
          std::to_string(windows_.size()) + " parts of it agree with the map");
    }
    if (best.doubtful + best.contradicting >= best.agreeing) {
      add("as many parts of it lie where the map is known and do not fit");
    }
    if (placement.rival > kToldRival * best.support()) {
      add("much of it would fit in another place, too");
    }
    // A single one may be all that is seen of another building.
    if (placement.walls_through_map > 0 || placement.walls_through_track > 0) {
      add("it has wall at " + std::to_string(placement.walls_through_map) +
          " and openings at " + std::to_string(placement.walls_through_track) +
          " places where the map has it the other way: doors that were opened "
          "or shut, or another building");
    }
    return doubt;
  }

  // Where the tie is best.
  void TakeTie(const Candidate& best, TrackPlacement* placement) const {
    std::size_t firmest = 0;
    double quality = -1.0;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const Judgement& judgement = best.judgements[w];
      if (judgement.verdict != Verdict::kAgrees ||
          judgement.quality <= quality) {
        continue;
      }
      quality = judgement.quality;
      firmest = w;
    }
    const Window& window = windows_[firmest];
    placement->to = static_cast<int>((window.begin + window.end) / 2);
    double nearest = -1.0;
    for (std::size_t k = 0; k < map_.size(); ++k) {
      const double distance =
          (map_[k].pose - best.judgements[firmest].pose).head<2>().norm();
      if (nearest >= 0.0 && distance >= nearest) continue;
      nearest = distance;
      placement->from = static_cast<int>(k);
    }
  }

  const std::vector<KeyView>& map_;
  const std::vector<KeyView>& track_;
  const std::optional<Pose2>& start_;
  const TrackPlacementOptions& options_;
  std::vector<Window> windows_;
  ScanMatcher whole_;
  // Of the search: the middle of the map, and how far it goes.
  Pose2 center_ = Pose2::Zero();
  double reach_ = 0.0;
  std::vector<Candidate> found_;
  std::vector<Candidate> judged_;
};

}  // namespace

std::vector<KeyView> MakeKeyViews(const std::vector<Scan>& scans,
                                  const std::vector<int>& keys,
                                  const std::vector<Pose2>& poses,
                                  const ScanPointsOptions& options) {
  if (keys.size() != poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(poses.size()) + " poses",
        "one for each of " + std::to_string(keys.size()) + " key scans");
  }
  std::vector<KeyView> views;
  views.reserve(keys.size());
  std::vector<ScanPoint> points;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const Scan& scan = scans[static_cast<std::size_t>(keys[k])];
    ExtractScanPoints(scan, options, &points);
    KeyView view;
    view.pose = poses[k];
    view.laser = scan.laser_offset.head<2>();
    Eigen::Vector2d last = Eigen::Vector2d::Constant(1e9);
    for (const ScanPoint& point : points) {
      if ((point.position - last).norm() < kViewSpacing) continue;
      last = point.position;
      view.points.push_back(point);
    }
    views.push_back(std::move(view));
  }
  return views;
}

TrackPlacement PlaceTrack(const std::vector<KeyView>& map,
                          const std::vector<KeyView>& track,
                          const std::optional<Pose2>& start,
                          const TrackPlacementOptions& options,
                          const std::function<bool()>& stop) {
  TrackPlacement placement;
  if (options.window_keys < 1) {
    throw PLUMBLINE_ERROR(
        "window_keys is " + std::to_string(options.window_keys), "1 or more");
  }
  if (map.empty() || track.empty()) {
    placement.why_not = "there are no scans to compare";
    return placement;
  }
  Search search(map, track, start, options);
  const std::size_t windows = search.num_windows();
  const std::size_t searches =
      std::min(windows, static_cast<std::size_t>(options.max_searches));
  const std::size_t batches = (searches + kBatch - 1) / kBatch;
  // Each batch is spread over the whole track.
  for (std::size_t batch = 0; batch < batches; ++batch) {
    for (std::size_t i = batch; i < searches; i += batches) {
      if (stop && stop()) return TrackPlacement();
      search.Look((2 * i + 1) * windows / (2 * searches));
    }
    const std::size_t most = (batch + 1) * options.max_candidates;
    if (!search.JudgeFound(most, stop)) return TrackPlacement();
    placement = search.Decide();
    if (placement.found &&
        placement.agreeing >= kClear * options.min_agreeing) {
      break;
    }
  }
  return placement;
}

}  // namespace plumbline
