#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/cell_index.h>
#include <plumbline/frontend/missed_steps.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Cells in which points lie on one surface, or next to it, m.
constexpr double kCell = 0.1;
// Returns that are counted lie so far from each other, m.
constexpr double kApart = 0.15;
// Cosine of the largest angle between the normals of one surface.
constexpr double kSameSide = 0.7;
// A step that leads back by the way between two scans, to within this, m, has
// all in the later one where it was in the robot's frame.
constexpr double kAlong = 0.3;
// Bearings by which it is told how far a scan looks.
constexpr std::size_t kBearings = 360;
// A longer motion between key scans is a jump, not a way, m.
constexpr double kLongestStep = 1.5;
// Rounds of the search, each with the steps found before it made.
constexpr int kMostRounds = 4;
// Key scans that are looked at at once.
constexpr std::size_t kAtOnce = 64;

// What a key scan saw, in the frame of the track.
class View {
 public:
  void Read(const Scan& scan, const Pose2& pose,
            const MissedStepOptions& options) {
    std::vector<ScanPoint> points;
    ExtractScanPoints(scan, options.points, &points);
    const PoseTransform transform(pose);
    eye_ = transform.Point(scan.laser_offset.head<2>());
    for (const ScanPoint& point : points) {
      if (point.range > options.max_range) continue;
      points_.push_back(Moved(point, transform));
      const Vector2d ray = points_.back().position - eye_;
      double& nearest = looks_[BearingOf(ray)];
      const double range = ray.norm();
      nearest = nearest == 0.0 ? range : std::min(nearest, range);
    }
    // What lies next to a point is that surface, unless another one is there.
    for (int radius = 0; radius <= 1; ++radius) {
      for (const ScanPoint& point : points_) {
        // Ends of surfaces are alike on either side.
        if (point.normal.isZero()) continue;
        for (int dx = -radius; dx <= radius; ++dx) {
          for (int dy = -radius; dy <= radius; ++dy) {
            Add(point, dx, dy);
          }
        }
      }
    }
  }

  const std::vector<ScanPoint>& points() const { return points_; }

  // Whether a point lies on what this saw.
  bool Has(const Vector2d& point, const Vector2d& normal) const {
    const int cell = cells_.Find(KeyOf(point, 0, 0));
    if (cell < 0) return false;
    return normals_[static_cast<std::size_t>(cell)].dot(normal) >= kSameSide;
  }

  // Whether this looked through where it lies.
  bool LooksThrough(const Vector2d& point,
                    const MissedStepOptions& options) const {
    const Vector2d ray = point - eye_;
    const std::size_t bearing = BearingOf(ray);
    double free = 0.0;
    for (const std::size_t k :
         {bearing + kBearings - 1, bearing, bearing + 1}) {
      const double look = looks_[k % kBearings];
      if (look > 0.0) free = free == 0.0 ? look : std::min(free, look);
    }
    return free > ray.norm() * (1.0 + options.free_share) + options.free_margin;
  }

 private:
  static std::size_t BearingOf(const Vector2d& ray) {
    const double turn = std::atan2(ray.y(), ray.x()) / (2.0 * kPi) + 0.5;
    return static_cast<std::size_t>(turn * kBearings) % kBearings;
  }

  static std::int64_t KeyOf(const Vector2d& point, int dx, int dy) {
    return CellKey(
        static_cast<std::int64_t>(std::floor(point.x() / kCell)) + dx,
        static_cast<std::int64_t>(std::floor(point.y() / kCell)) + dy);
  }

  void Add(const ScanPoint& point, int dx, int dy) {
    const int next = static_cast<int>(normals_.size());
    if (cells_.FindOrAdd(KeyOf(point.position, dx, dy), next) == next) {
      normals_.push_back(point.normal);
    }
  }

  Vector2d eye_ = Vector2d::Zero();
  std::vector<ScanPoint> points_;
  std::array<double, kBearings> looks_{};
  CellIndex cells_;
  std::vector<Vector2d> normals_;
};

// How many returns fit, and how many stand in the way.
struct Fit {
  int on = 0;
  int intruding = 0;

  int value() const { return on - intruding; }
  Fit& operator+=(const Fit& other) {
    on += other.on;
    intruding += other.intruding;
    return *this;
  }
};

// Two views of one way, which lie some way apart.
class Comparison {
 public:
  // The views must outlive it. `between`: from the earlier one to the later.
  Comparison(const View& earlier, const View& later, const Vector2d& between,
             const MissedStepOptions& options)
      : earlier_(earlier),
        later_(later),
        length_(between.norm()),
        along_(between.normalized()),
        options_(options),
        of_earlier_(Telling(earlier)),
        of_later_(Telling(later)) {}

  // Returns that say something of a step.
  int telling() const {
    return static_cast<int>(of_earlier_.size() + of_later_.size());
  }

  // How the two fit when the later one lies farther by a step.
  Fit FitWith(double step) const {
    Fit fit;
    Compare(step, [&](const View& view, const Vector2d& place,
                      const Vector2d& normal, const Vector2d&) {
      if (view.Has(place, normal)) {
        ++fit.on;
      } else if (view.LooksThrough(place, options_)) {
        ++fit.intruding;
      }
    });
    return fit;
  }

  // How many returns fit then, at a fraction of the cost.
  int NumOn(double step) const {
    int on = 0;
    Compare(step,
            [&](const View& view, const Vector2d& place, const Vector2d& normal,
                const Vector2d&) { on += view.Has(place, normal); });
    return on;
  }

  // Adds the places of these, along the way and across it.
  void AddPlaces(double step, std::vector<Vector2d>* places) const {
    Compare(step, [&](const View& view, const Vector2d& place,
                      const Vector2d& normal, const Vector2d& by_earlier) {
      if (!view.Has(place, normal)) return;
      places->emplace_back(along_.dot(by_earlier),
                           Vector2d(-along_.y(), along_.x()).dot(by_earlier));
    });
  }

 private:
  std::vector<const ScanPoint*> Telling(const View& view) const {
    std::vector<const ScanPoint*> telling;
    for (const ScanPoint& point : view.points()) {
      if (std::abs(point.normal.dot(along_)) < options_.min_cosine) continue;
      if (!telling.empty() &&
          (point.position - telling.back()->position).norm() < kApart) {
        continue;
      }
      telling.push_back(&point);
    }
    return telling;
  }

  // Calls `use` with the view that a return is compared with, its place there
  // and its normal, and its place as the earlier view has it.
  template <typename Use>
  void Compare(double step, const Use& use) const {
    // What goes along with the robot fits so.
    if (std::abs(step + length_) <= kAlong) return;
    for (const ScanPoint* point : of_later_) {
      const Vector2d place = point->position + step * along_;
      use(earlier_, place, point->normal, place);
    }
    for (const ScanPoint* point : of_earlier_) {
      use(later_, point->position - step * along_, point->normal,
          point->position);
    }
  }

  const View& earlier_;
  const View& later_;
  const double length_;
  const Vector2d along_;
  const MissedStepOptions& options_;
  std::vector<const ScanPoint*> of_earlier_;
  std::vector<const ScanPoint*> of_later_;
};

// Compares key scans of one track.
class Search {
 public:
  Search(const std::vector<Scan>& scans, std::vector<RefinedScan> refined,
         const MissedStepOptions& options, const std::function<bool()>& stop)
      : scans_(scans),
        refined_(std::move(refined)),
        options_(options),
        stop_(stop),
        half_(static_cast<int>(
            std::lround(options.max_step / options.resolution))) {}

  std::vector<MissedStep> Run();

 private:
  // A key scan that is compared.
  struct Station {
    std::size_t scan = 0;
    // From the first scan, m.
    double way = 0.0;
    // The robot came here from the station before, all the way.
    bool follows = false;
  };
  // Two stations, the first one earlier, and the way from it to the second.
  struct Pair {
    std::size_t first = 0;
    std::size_t second = 0;
    Vector2d between = Vector2d::Zero();
    // How they fit as they are, and of how many returns.
    Fit fit;
    int telling = 0;
  };

  bool Stops() const { return stop_ && stop_(); }
  const Pose2& PoseOf(std::size_t station) const {
    return refined_[stations_[station].scan].pose;
  }
  double StepOf(int index) const { return index * options_.resolution; }
  void FindStations();
  void FindPairs();
  // What the way to these stations lies between, and nothing else.
  void LoadViews(std::size_t begin, std::size_t end);
  Comparison Compared(const Pair& pair) const {
    return Comparison(*views_[pair.first], *views_[pair.second], pair.between,
                      options_);
  }
  // All pairs that the way to a station lies between.
  std::vector<Comparison> Over(std::size_t station) const;
  // The step that was missed on the way to a station; 0: none.
  double StepTo(std::size_t station, Fit* with) const;
  // Whether more than one scan on either side says so.
  bool IsShared(std::size_t station, double step) const;
  // Whether what fits with a step is more than one thing that may have moved.
  bool IsSure(std::size_t station, double step) const;
  // Where on this way it was.
  MissedStep Locate(std::size_t station, double step) const;
  std::vector<MissedStep> RunOnce();

  const std::vector<Scan>& scans_;
  std::vector<RefinedScan> refined_;
  const MissedStepOptions& options_;
  const std::function<bool()>& stop_;
  const int half_;
  std::vector<Station> stations_;
  // Of stations near those that are looked at; null for others.
  std::vector<std::unique_ptr<View>> views_;
  // By their second stations; so many were compared.
  std::vector<Pair> pairs_;
  std::size_t compared_ = 0;
  // By station: pairs that the way to it lies between.
  std::vector<std::vector<std::size_t>> over_;
};

void Search::FindStations() {
  stations_.clear();
  double way = 0.0;
  bool follows = false;
  const RefinedScan* last = nullptr;
  for (std::size_t i = 0; i < refined_.size(); ++i) {
    const RefinedScan& now = refined_[i];
    if (!now.is_key) continue;
    const double step =
        last == nullptr ? 0.0 : (now.pose - last->pose).head<2>().norm();
    const bool jumps =
        step > kLongestStep || now.tie != TrackTie::kNone || now.since >= 0;
    way += step;
    last = &now;
    if (!jumps && !stations_.empty() &&
        way - stations_.back().way < options_.spacing) {
      continue;
    }
    stations_.push_back({i, way, follows && !jumps});
    follows = true;
  }
}

void Search::FindPairs() {
  pairs_.clear();
  over_.assign(stations_.size(), {});
  for (std::size_t j = 1; j < stations_.size(); ++j) {
    for (std::size_t i = j; i-- > 0 && stations_[i + 1].follows;) {
      const double way = stations_[j].way - stations_[i].way;
      if (way > options_.reach) break;
      const Vector2d between = (PoseOf(j) - PoseOf(i)).head<2>();
      if (between.norm() < options_.min_straightness * way) continue;
      for (std::size_t k = i + 1; k <= j; ++k)
        over_[k].push_back(pairs_.size());
      pairs_.push_back({i, j, between, {}, 0});
    }
  }
}

void Search::LoadViews(std::size_t begin, std::size_t end) {
  const double first = stations_[begin].way;
  while (begin > 0 && first - stations_[begin - 1].way <= options_.reach) {
    --begin;
  }
  const double last = stations_[end - 1].way;
  while (end < stations_.size() &&
         stations_[end].way - last <= options_.reach) {
    ++end;
  }
  for (std::size_t k = 0; k < views_.size(); ++k) {
    if (k < begin || k >= end) views_[k].reset();
  }
  ParallelFor(end - begin, options_.num_threads, [&](std::size_t i) {
    std::unique_ptr<View>& view = views_[begin + i];
    if (view != nullptr) return;
    view = std::make_unique<View>();
    view->Read(scans_[stations_[begin + i].scan], PoseOf(begin + i), options_);
  });
  std::size_t next = compared_;
  while (next < pairs_.size() && pairs_[next].second < end) ++next;
  ParallelFor(next - compared_, options_.num_threads, [&](std::size_t i) {
    Pair& pair = pairs_[compared_ + i];
    const Comparison comparison = Compared(pair);
    pair.fit = comparison.FitWith(0.0);
    pair.telling = comparison.telling();
  });
  compared_ = next;
}

std::vector<Comparison> Search::Over(std::size_t station) const {
  std::vector<Comparison> comparisons;
  for (const std::size_t p : over_[station]) {
    comparisons.push_back(Compared(pairs_[p]));
  }
  return comparisons;
}

double Search::StepTo(std::size_t station, Fit* with) const {
  Fit without;
  int telling = 0;
  for (const std::size_t p : over_[station]) {
    const Pair& pair = pairs_[p];
    without += pair.fit;
    telling += pair.telling;
  }
  // Most ways are right.
  if (telling < options_.min_returns ||
      without.value() > options_.max_without * telling) {
    return 0.0;
  }
  const std::vector<Comparison> over = Over(station);
  std::vector<Fit> fits;
  int best = 0;
  for (int k = -half_; k <= half_; ++k) {
    int on = 0;
    for (const Comparison& pair : over) on += pair.NumOn(StepOf(k));
    Fit fit;
    if (on >= options_.min_returns) {
      for (const Comparison& pair : over) fit += pair.FitWith(StepOf(k));
    }
    fits.push_back(fit);
    if (fit.value() > fits[static_cast<std::size_t>(best)].value()) {
      best = k + half_;
    }
  }
  *with = fits[static_cast<std::size_t>(best)];
  if (best == 0 || best == 2 * half_ || with->value() < options_.min_returns ||
      without.on > options_.max_without * with->on) {
    return 0.0;
  }
  const double before = fits[static_cast<std::size_t>(best) - 1].value();
  const double after = fits[static_cast<std::size_t>(best) + 1].value();
  const double bend = before + after - 2.0 * with->value();
  const double step =
      StepOf(best - half_) +
      (bend < 0.0 ? 0.5 * options_.resolution * (before - after) / bend : 0.0);
  return std::abs(step) >= options_.min_step && IsShared(station, step) ? step
                                                                        : 0.0;
}

bool Search::IsShared(std::size_t station, double step) const {
  std::map<std::size_t, int> of_first;
  std::map<std::size_t, int> of_second;
  int all = 0;
  for (const std::size_t p : over_[station]) {
    const Pair& pair = pairs_[p];
    const int on = Compared(pair).NumOn(step);
    of_first[pair.first] += on;
    of_second[pair.second] += on;
    all += on;
  }
  const auto is_most = [&](const std::pair<const std::size_t, int>& one) {
    return one.second > options_.of_one_scan * all;
  };
  return std::none_of(of_first.begin(), of_first.end(), is_most) &&
         std::none_of(of_second.begin(), of_second.end(), is_most);
}

bool Search::IsSure(std::size_t station, double step) const {
  // Of what fits: along the way, and across it.
  std::vector<Vector2d> places;
  for (const Comparison& pair : Over(station)) pair.AddPlaces(step, &places);
  std::sort(places.begin(), places.end(),
            [](const Vector2d& a, const Vector2d& b) { return a.x() < b.x(); });
  std::size_t begin = 0;
  std::size_t most = 0;
  for (std::size_t first = 0, end = 0; first < places.size(); ++first) {
    while (end < places.size() &&
           places[end].x() <= places[first].x() + options_.thing) {
      ++end;
    }
    if (end - first > most) {
      begin = first;
      most = end - first;
    }
  }
  if (static_cast<double>(most) <=
      options_.of_one_thing * static_cast<double>(places.size())) {
    return true;
  }
  std::vector<double> sides;
  for (std::size_t i = begin; i < begin + most; ++i) {
    sides.push_back(places[i].y());
  }
  std::sort(sides.begin(), sides.end());
  const std::size_t few = sides.size() / 20;
  return sides[sides.size() - 1 - few] - sides[few] >= options_.min_width;
}

MissedStep Search::Locate(std::size_t station, double step) const {
  std::vector<std::size_t> keys;
  for (std::size_t i = stations_[station - 1].scan;
       i <= stations_[station].scan; ++i) {
    if (refined_[i].is_key) keys.push_back(i);
  }
  // How much better a key scan between the two fits as one after the step.
  std::size_t after = keys.size() - 1;
  int best = 0;
  int sum = 0;
  for (std::size_t k = keys.size() - 1; k-- > 1;) {
    View view;
    view.Read(scans_[keys[k]], refined_[keys[k]].pose, options_);
    for (const std::size_t p : over_[station]) {
      const Pair& pair = pairs_[p];
      if (pair.second == station) {
        const Comparison before(*views_[pair.first], view, pair.between,
                                options_);
        sum += before.FitWith(step).value() - before.FitWith(0.0).value();
      }
      if (pair.first == station - 1) {
        const Comparison after(view, *views_[pair.second], pair.between,
                               options_);
        sum += after.FitWith(0.0).value() - after.FitWith(step).value();
      }
    }
    if (sum > best) {
      best = sum;
      after = k;
    }
  }
  MissedStep missed;
  missed.begin = static_cast<int>(keys[after - 1]);
  missed.end = static_cast<int>(keys[after]);
  missed.length = step;
  missed.is_sure = IsSure(station, step);
  const Vector2d along =
      (PoseOf(station) - PoseOf(station - 1)).head<2>().normalized();
  const double heading = refined_[keys[after - 1]].pose[2];
  missed.correction.scan = missed.end;
  missed.correction.change.head<2>() =
      step *
      Vector2d(std::cos(heading) * along.x() + std::sin(heading) * along.y(),
               std::cos(heading) * along.y() - std::sin(heading) * along.x());
  return missed;
}

std::vector<MissedStep> Search::RunOnce() {
  FindStations();
  FindPairs();
  views_.clear();
  views_.resize(stations_.size());
  compared_ = 0;
  std::vector<double> steps(stations_.size(), 0.0);
  std::vector<Fit> fits(stations_.size());
  std::vector<MissedStep> missed;
  for (std::size_t begin = 0; begin < stations_.size(); begin += kAtOnce) {
    if (Stops()) return missed;
    const std::size_t end = std::min(begin + kAtOnce, stations_.size());
    LoadViews(begin, end);
    ParallelFor(end - begin, options_.num_threads, [&](std::size_t k) {
      steps[begin + k] = StepTo(begin + k, &fits[begin + k]);
    });
  }
  // The clearest one of those that lie between the same scans.
  const auto is_clearest = [&](std::size_t k) {
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      if (i == k || steps[i] == 0.0 ||
          std::abs(stations_[i].way - stations_[k].way) > options_.reach) {
        continue;
      }
      if (fits[i].value() > fits[k].value() ||
          (fits[i].value() == fits[k].value() && i < k)) {
        return false;
      }
    }
    return true;
  };
  for (std::size_t k = 0; k < stations_.size(); ++k) {
    if (steps[k] == 0.0 || !is_clearest(k)) continue;
    LoadViews(k, k + 1);
    missed.push_back(Locate(k, steps[k]));
  }
  return missed;
}

std::vector<MissedStep> Search::Run() {
  std::vector<MissedStep> all;
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<MissedStep> found = RunOnce();
    if (Stops()) return {};
    if (found.empty()) break;
    std::vector<MotionCorrection> corrections;
    for (const MissedStep& step : found) {
      if (step.is_sure) corrections.push_back(step.correction);
      const auto known =
          std::find_if(all.begin(), all.end(), [&](const MissedStep& other) {
            return !other.is_sure && other.end == step.end;
          });
      if (known == all.end()) {
        all.push_back(step);
      } else if (step.is_sure) {
        // What was unsure on poses that have been corrected since.
        *known = step;
      }
    }
    if (corrections.empty()) break;
    CorrectMotions(corrections, &refined_);
  }
  std::sort(all.begin(), all.end(),
            [](const MissedStep& a, const MissedStep& b) {
              return a.end != b.end ? a.end < b.end : a.length < b.length;
            });
  return all;
}

}  // namespace

std::vector<MissedStep> FindMissedSteps(const std::vector<Scan>& scans,
                                        const std::vector<RefinedScan>& refined,
                                        const MissedStepOptions& options,
                                        const std::function<bool()>& stop) {
  if (refined.size() != scans.size()) {
    throw PLUMBLINE_ERROR(
        "a track of " + std::to_string(refined.size()) + " scans",
        "one for each of " + std::to_string(scans.size()) + " scans");
  }
  return Search(scans, refined, options, stop).Run();
}

}  // namespace plumbline
