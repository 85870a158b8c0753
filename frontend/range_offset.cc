#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/range_offset.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace plumbline {
namespace {

// Scans that are compared lie this far apart, m, on a way that turns by no more
// than this, rad: walls ahead in the one are abreast in the other.
constexpr double kShortestWay = 0.8;
constexpr double kLongestWay = 1.6;
constexpr double kMostTurn = 0.35;
// Pairs that are compared, spread over the log; fewer say nothing.
constexpr std::size_t kMostPairs = 500;
constexpr std::size_t kFewestPairs = 40;
// Returns farther away add nothing, m: an offset moves them alike in both.
constexpr double kUsableRange = 8.0;
// Two returns lie on one surface where they are nearer to each other than this,
// m, and their normals agree to this cosine: beginning with odometry's motion,
// and with one that was matched before.
constexpr std::array<double, 5> kGates = {0.5, 0.3, 0.2, 0.1, 0.1};
constexpr std::size_t kGateOfMatched = 3;
constexpr double kAlike = 0.9;
// A pair needs this many returns in common. More than so many are not looked
// for.
constexpr int kFewestReturns = 30;
constexpr std::size_t kMostReturns = 180;
// Residuals of this size have half the weight, m.
constexpr double kCauchy = 0.03;
// Where one wall only is seen the motion along it is open, 1/m^2 and 1/rad^2.
constexpr double kRidge = 1.0;
// Pairs that one thread compares in turn.
constexpr std::size_t kPairsInTurn = 25;
// The log is taken in so many parts, which differ by chance.
constexpr std::size_t kParts = 8;
// What is compared moves with what is taken out: done again, at most so often,
// until less than this changes, m. The first time shows at least this share of
// an offset.
constexpr int kMostRounds = 8;
constexpr double kSettled = 0.001;
constexpr double kShownAtFirst = 0.3;
// No laser is off by more, m.
constexpr double kLargest = 0.3;

// A return with the direction of its beam, robot's frame.
struct Return {
  Eigen::Vector2d position;
  Eigen::Vector2d normal;
  Eigen::Vector2d beam;
};

// What a pair says of the offset: information * offset = moment.
struct Equation {
  double information = 0.0;
  double moment = 0.0;
};

Equation& operator+=(Equation& sum, const Equation& other) {
  sum.information += other.information;
  sum.moment += other.moment;
  return sum;
}

double Solved(const Equation& equation) {
  return equation.information > 0.0 ? equation.moment / equation.information
                                    : 0.0;
}

// Two scans of a log, and the motion between them.
struct Pair {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 motion = Pose2::Zero();
  bool is_matched = false;
};

class PairComparison {
 public:
  // With `known`, m, taken out of all ranges before.
  Equation Compare(const std::vector<Scan>& scans, double known, Pair* pair) {
    TakeReturns(scans[pair->from], known, &from_);
    TakeReturns(scans[pair->to], known, &to_);
    Pose2 motion = pair->motion;
    for (std::size_t k = pair->is_matched ? kGateOfMatched : 0;
         k < kGates.size(); ++k) {
      if (!Linearize(motion, kGates[k])) return {};
      const auto motions = normal_.topLeftCorner<3, 3>().ldlt();
      const Eigen::Vector3d by_offset =
          motions.solve(normal_.topRightCorner<3, 1>());
      equation_ = {
          normal_(3, 3) - by_offset.dot(normal_.topRightCorner<3, 1>()),
          right_[3] - by_offset.dot(right_.head<3>())};
      motion -= motions.solve(right_.head<3>());
    }
    pair->motion = motion;
    pair->is_matched = true;
    return equation_;
  }

 private:
  void TakeReturns(const Scan& scan, double known,
                   std::vector<Return>* returns) {
    corrected_ = scan;
    TakeOutRangeOffset(known, &corrected_);
    ExtractScanPoints(corrected_, options_, &points_);
    returns->clear();
    for (const ScanPoint& point : points_) {
      if (point.is_between || point.normal.isZero(0.0) ||
          point.range > kUsableRange) {
        continue;
      }
      const Eigen::Vector2d beam =
          (point.position - scan.laser_offset.head<2>()).normalized();
      returns->push_back({point.position, point.normal, beam});
    }
  }

  // Normal equations of the motion and the offset; false when the scans have
  // too little in common.
  bool Linearize(const Pose2& motion, double gate) {
    const PoseTransform transform(motion);
    normal_.setZero();
    right_.setZero();
    int common = 0;
    const std::size_t step = 1 + (to_.size() - 1) / kMostReturns;
    for (std::size_t i = 0; i < to_.size(); i += step) {
      const Return& source = to_[i];
      const Eigen::Vector2d position = transform.Point(source.position);
      const Return* const target = Nearest(position, gate);
      if (target == nullptr) continue;
      const Eigen::Vector2d& n = target->normal;
      if (transform.Direction(source.normal).dot(n) < kAlike) continue;
      const double residual = n.dot(position - target->position);
      const double by_offset =
          n.dot(transform.Direction(source.beam) - target->beam);
      const Eigen::Vector2d arm = position - motion.head<2>();
      const Eigen::Vector4d row(n[0], n[1], n[1] * arm[0] - n[0] * arm[1],
                                by_offset);
      const double weight =
          1.0 / (1.0 + residual * residual / (kCauchy * kCauchy));
      normal_ += weight * row * row.transpose();
      right_ += weight * residual * row;
      ++common;
    }
    normal_.diagonal().head<3>().array() += kRidge;
    return common >= kFewestReturns;
  }

  const Return* Nearest(const Eigen::Vector2d& position, double gate) const {
    const Return* nearest = nullptr;
    double least = gate * gate;
    for (const Return& target : from_) {
      const double squared = (target.position - position).squaredNorm();
      if (squared >= least) continue;
      least = squared;
      nearest = &target;
    }
    return nearest;
  }

  const ScanPointsOptions options_;
  Scan corrected_;
  std::vector<ScanPoint> points_;
  std::vector<Return> from_;
  std::vector<Return> to_;
  Eigen::Matrix4d normal_;
  Eigen::Vector4d right_;
  Equation equation_;
};

std::vector<Pair> PairsToCompare(const std::vector<Scan>& scans) {
  std::vector<Pair> pairs;
  std::size_t from = 0;
  for (std::size_t to = 1; to < scans.size(); ++to) {
    const Pose2 motion = Between(scans[from].odometry, scans[to].odometry);
    const double way = motion.head<2>().norm();
    const bool turned = std::abs(motion[2]) > kMostTurn;
    if (way < kShortestWay && !turned) continue;
    if (!turned && way <= kLongestWay) pairs.push_back({from, to, motion});
    from = to;
  }
  if (pairs.size() <= kMostPairs) return pairs;
  std::vector<Pair> spread;
  for (std::size_t i = 0; i < kMostPairs; ++i) {
    spread.push_back(pairs[i * pairs.size() / kMostPairs]);
  }
  return spread;
}

std::vector<Equation> CompareAll(const std::vector<Scan>& scans, double known,
                                 std::vector<Pair>* pairs) {
  std::vector<Equation> of_pairs(pairs->size());
  const std::size_t turns = (pairs->size() + kPairsInTurn - 1) / kPairsInTurn;
  ParallelFor(turns, ThreadsHere(), [&](std::size_t turn) {
    PairComparison comparison;
    const std::size_t end = std::min(pairs->size(), (turn + 1) * kPairsInTurn);
    for (std::size_t i = turn * kPairsInTurn; i < end; ++i) {
      of_pairs[i] = comparison.Compare(scans, known, &(*pairs)[i]);
    }
  });
  std::vector<Equation> equations;
  for (const Equation& equation : of_pairs) {
    if (equation.information > 0.0) equations.push_back(equation);
  }
  return equations;
}

Equation Sum(const std::vector<Equation>& equations, std::size_t begin,
             std::size_t end) {
  Equation sum;
  for (std::size_t i = begin; i < end; ++i) sum += equations[i];
  return sum;
}

// Standard deviation of what all say, from how the parts differ: neighbouring
// pairs see the same walls.
double SpreadOfParts(const std::vector<Equation>& equations, double all) {
  double squares = 0.0;
  double information = 0.0;
  for (std::size_t part = 0; part < kParts; ++part) {
    const Equation sum = Sum(equations, part * equations.size() / kParts,
                             (part + 1) * equations.size() / kParts);
    const double apart = Solved(sum) - all;
    squares += sum.information * apart * apart;
    information += sum.information;
  }
  return std::sqrt(squares / information / (kParts - 1.0));
}

}  // namespace

RangeOffset FindRangeOffset(const std::vector<Scan>& scans) {
  RangeOffset result;
  std::vector<Pair> pairs = PairsToCompare(scans);
  std::vector<Equation> equations = CompareAll(scans, 0.0, &pairs);
  result.pairs = static_cast<int>(equations.size());
  if (equations.size() < kFewestPairs) return result;
  result.first = Solved(Sum(equations, 0, equations.size()));
  result.sigma = SpreadOfParts(equations, result.first);
  if (std::abs(result.first) <= std::max(RangeOffset::kSigmas * result.sigma,
                                         kShownAtFirst * RangeOffset::kLeast)) {
    return result;
  }
  double offset = result.first;
  // What is there is taken out in the end. Where a laser sees little, each time
  // may show more, however much was taken out.
  bool is_settled = false;
  for (int round = 1; round < kMostRounds && !is_settled; ++round) {
    equations = CompareAll(scans, offset, &pairs);
    const double more = Solved(Sum(equations, 0, equations.size()));
    offset += more;
    is_settled = std::abs(more) < kSettled;
  }
  const double size = std::abs(offset);
  if (is_settled && size >= RangeOffset::kLeast && size <= kLargest) {
    result.offset = offset;
  }
  return result;
}

void TakeOutRangeOffset(double offset, Scan* scan) {
  for (float& range : scan->ranges) {
    if (!(range > 0.0f)) continue;
    range = static_cast<float>(std::max(0.0, range - offset));
  }
}

}  // namespace plumbline
