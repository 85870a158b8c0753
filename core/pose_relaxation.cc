#include <plumbline/core/error.h>
#include <plumbline/core/pose_relaxation.h>
#include <plumbline/core/symmetric_ordering.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <utility>

namespace plumbline {
namespace {

using Complex = std::complex<double>;

// Pull towards the start of a linear problem, relative to the diagonal: decides
// in directions of which no measurement speaks, moves nothing else.
constexpr double kPull = 1e-13;
// A relaxed heading shorter than this says nothing.
constexpr double kShortHeading = 1e-6;
constexpr int kNone = PoseSighting::kNone;

Eigen::Matrix2d Rotation(double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Eigen::Matrix2d rotation;
  rotation << c, -s, s, c;
  return rotation;
}

Complex ToComplex(const Eigen::Vector2d& v) { return {v[0], v[1]}; }

// Normal equations of a linear least-squares problem in blocks, some of them
// known, solved for the change from a start.
template <typename Scalar, int kSize>
class LinearProblem {
 public:
  using Block = Eigen::Matrix<Scalar, kSize, kSize>;
  using Vector = Eigen::Matrix<Scalar, kSize, 1>;
  using Values = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  explicit LinearProblem(const std::vector<bool>& is_known)
      : columns_(is_known.size(), kNone) {
    int columns = 0;
    for (std::size_t i = 0; i < is_known.size(); ++i) {
      if (is_known[i]) continue;
      columns_[i] = columns;
      columns += kSize;
    }
    gradient_ = Values::Zero(columns);
  }

  // Adds |sum_k J_k x_k - b|^2 with the J given as products: J_k' J_l and
  // J_k' r, where r is the residual at the start.
  void AddProduct(int k, int l, const Block& product) {
    const int row = columns_[static_cast<std::size_t>(k)];
    const int column = columns_[static_cast<std::size_t>(l)];
    if (row == kNone || column == kNone || row < column) return;
    for (int i = 0; i < kSize; ++i) {
      for (int j = 0; j < kSize; ++j) {
        if (row + i < column + j) continue;  // the lower triangle
        entries_.emplace_back(row + i, column + j, product(i, j));
      }
    }
  }
  void AddGradient(int k, const Vector& gradient) {
    const int row = columns_[static_cast<std::size_t>(k)];
    if (row != kNone) gradient_.template segment<kSize>(row) += gradient;
  }

  // The change of every block, zero for known ones.
  std::vector<Vector> Solve() {
    std::vector<Vector> changes(columns_.size(), Vector::Zero());
    const Eigen::Index size = gradient_.size();
    if (size == 0) return changes;
    Eigen::SparseMatrix<Scalar> normal(size, size);
    normal.setFromTriplets(entries_.begin(), entries_.end());
    double largest = 0.0;
    for (Eigen::Index i = 0; i < size; ++i) {
      largest = std::max(largest, std::abs(normal.coeff(i, i)));
    }
    // Nothing is known of anything: all of it stays.
    if (largest == 0.0) largest = 1.0;
    for (Eigen::Index i = 0; i < size; ++i) {
      Scalar& diagonal = normal.coeffRef(i, i);
      diagonal += kPull * std::max(std::abs(diagonal), kPull * largest);
    }
    SymmetricFactor<Scalar> factor(normal);
    Values solution;
    if (factor.info() == Eigen::Success) solution = factor.solve(-gradient_);
    if (factor.info() != Eigen::Success || !solution.allFinite()) {
      throw PLUMBLINE_ERROR("the linear problem of the start has no solution",
                            "information within the range of numbers");
    }
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (columns_[i] == kNone) continue;
      changes[i] = solution.template segment<kSize>(columns_[i]);
    }
    return changes;
  }

 private:
  // First column of each block; kNone for known ones.
  std::vector<int> columns_;
  std::vector<Eigen::Triplet<Scalar>> entries_;
  Values gradient_;
};

class Relaxation {
 public:
  explicit Relaxation(PoseNetwork* network)
      : poses_(network->poses),
        positions_(network->landmarks),
        is_known_(network->is_known_pose),
        is_known_landmark_(network->is_known_landmark),
        pose_sightings_(network->pose_sightings),
        position_sightings_(network->position_sightings) {}

  void Run() {
    RelaxHeadings();
    SolvePositions();
    if (position_sightings_.empty()) return;
    const std::vector<Pose2> poses = poses_;
    const std::vector<Eigen::Vector2d> positions = positions_;
    const double objective = Objective();
    RelaxJointly();
    SolvePositions();
    // Not a number is worse than anything.
    if (!(Objective() < objective)) {
      poses_ = poses;
      positions_ = positions;
    }
  }

 private:
  static std::size_t At(int i) { return static_cast<std::size_t>(i); }

  static Pose2 Error(const PoseSighting& sighting, const Pose2& from,
                     const Pose2& to) {
    Pose2 error = Between(from, to);
    // That of a prior is seen from where it expects the pose.
    if (sighting.first != kNone) error -= sighting.value;
    error[2] = NormalizeAngle(error[2]);
    return error;
  }
  Pose2 From(const PoseSighting& sighting) const {
    return sighting.first == kNone ? sighting.value
                                   : poses_[At(sighting.first)];
  }
  Eigen::Vector2d Error(const PositionSighting& sighting) const {
    const Pose2& from = poses_[At(sighting.pose)];
    return Rotation(from[2]).transpose() *
               (positions_[At(sighting.landmark)] - from.head<2>()) -
           sighting.value;
  }

  double Objective() const {
    double sum = 0.0;
    for (const PoseSighting& sighting : pose_sightings_) {
      const Pose2 error =
          Error(sighting, From(sighting), poses_[At(sighting.second)]);
      sum += error.dot(sighting.information * error);
    }
    for (const PositionSighting& sighting : position_sightings_) {
      const Eigen::Vector2d error = Error(sighting);
      sum += error.dot(sighting.information * error);
    }
    return sum;
  }

  void TakeHeading(std::size_t pose, Complex heading) {
    if (std::abs(heading) > kShortHeading) {
      poses_[pose][2] = std::arg(heading);
    }
  }

  // Headings z of the plane: sum of w |z_j - z_i exp(i u)|^2.
  void RelaxHeadings() {
    using Problem = LinearProblem<Complex, 1>;
    const auto block = [](Complex value) { return Problem::Block(value); };
    Problem problem(is_known_);
    for (const PoseSighting& sighting : pose_sightings_) {
      const double weight = sighting.information(2, 2);
      const int j = sighting.second;
      const Complex turn = std::polar(1.0, sighting.value[2]);
      const Complex z_j = std::polar(1.0, poses_[At(j)][2]);
      problem.AddProduct(j, j, block(weight));
      if (sighting.first == kNone) {
        problem.AddGradient(j, block(weight * (z_j - turn)));
        continue;
      }
      const int i = sighting.first;
      const Complex residual = z_j - std::polar(1.0, poses_[At(i)][2]) * turn;
      problem.AddProduct(i, i, block(weight));
      problem.AddProduct(j, i, block(-weight * turn));
      problem.AddProduct(i, j, block(-weight * std::conj(turn)));
      problem.AddGradient(j, block(weight * residual));
      problem.AddGradient(i, block(-weight * std::conj(turn) * residual));
    }
    const std::vector<Problem::Vector> changes = problem.Solve();
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      TakeHeading(i, std::polar(1.0, poses_[i][2]) + changes[i][0]);
    }
  }

  // Headings z, positions t of poses and l of landmarks together:
  // w_z |z_j - z_i exp(i u)|^2 + w_t |t_j - t_i - z_i d|^2, the same with l;
  // every one linear in all unknowns.
  void RelaxJointly() {
    using Problem = LinearProblem<Complex, 1>;
    const int poses = static_cast<int>(poses_.size());
    const int landmarks = static_cast<int>(positions_.size());
    // z of all poses, then t of all poses, then l.
    std::vector<bool> is_known = is_known_;
    is_known.insert(is_known.end(), is_known_.begin(), is_known_.end());
    is_known.insert(is_known.end(), is_known_landmark_.begin(),
                    is_known_landmark_.end());
    std::vector<Complex> values(At(2 * poses + landmarks));
    for (int i = 0; i < poses; ++i) {
      values[At(i)] = std::polar(1.0, poses_[At(i)][2]);
      values[At(poses + i)] = ToComplex(poses_[At(i)].head<2>());
    }
    for (int i = 0; i < landmarks; ++i) {
      values[At(2 * poses + i)] = ToComplex(positions_[At(i)]);
    }
    Problem problem(is_known);
    // w |sum of c_k x_k - b|^2
    const auto add = [&](double weight,
                         const std::vector<std::pair<int, Complex>>& terms,
                         Complex expected) {
      Complex residual = -expected;
      for (const auto& [k, c] : terms) residual += c * values[At(k)];
      for (const auto& [k, c] : terms) {
        problem.AddGradient(k,
                            Problem::Vector(weight * std::conj(c) * residual));
        for (const auto& [l, d] : terms) {
          problem.AddProduct(k, l, Problem::Block(weight * std::conj(c) * d));
        }
      }
    };
    for (const PoseSighting& sighting : pose_sightings_) {
      const double heading_weight = sighting.information(2, 2);
      const double weight =
          sighting.information.topLeftCorner<2, 2>().trace() / 2;
      const Complex turn = std::polar(1.0, sighting.value[2]);
      const Complex step = ToComplex(sighting.value.head<2>());
      const int j = sighting.second;
      const int i = sighting.first;
      if (i == kNone) {
        add(heading_weight, {{j, 1.0}}, turn);
        add(weight, {{poses + j, 1.0}}, step);
      } else {
        add(heading_weight, {{j, 1.0}, {i, -turn}}, 0.0);
        add(weight, {{poses + j, 1.0}, {poses + i, -1.0}, {i, -step}}, 0.0);
      }
    }
    for (const PositionSighting& sighting : position_sightings_) {
      add(sighting.information.trace() / 2,
          {{2 * poses + sighting.landmark, 1.0},
           {poses + sighting.pose, -1.0},
           {sighting.pose, -ToComplex(sighting.value)}},
          0.0);
    }
    const std::vector<Problem::Vector> changes = problem.Solve();
    for (int i = 0; i < poses; ++i) {
      TakeHeading(At(i), values[At(i)] + changes[At(i)][0]);
    }
  }

  // Positions that minimize the objective itself at these headings.
  void SolvePositions() {
    using Problem = LinearProblem<double, 2>;
    const int poses = static_cast<int>(poses_.size());
    std::vector<bool> is_known = is_known_;
    is_known.insert(is_known.end(), is_known_landmark_.begin(),
                    is_known_landmark_.end());
    Problem problem(is_known);
    for (const PoseSighting& sighting : pose_sightings_) {
      const Pose2 from = From(sighting);
      const Pose2 error = Error(sighting, from, poses_[At(sighting.second)]);
      const Eigen::Matrix2d rotation = Rotation(from[2]);
      Add(sighting.first, sighting.second,
          rotation * sighting.information.topLeftCorner<2, 2>() *
              rotation.transpose(),
          rotation * (sighting.information.topRows<2>() * error), &problem);
    }
    for (const PositionSighting& sighting : position_sightings_) {
      const Eigen::Vector2d error = Error(sighting);
      const Eigen::Matrix2d rotation = Rotation(poses_[At(sighting.pose)][2]);
      Add(sighting.pose, poses + sighting.landmark,
          rotation * sighting.information * rotation.transpose(),
          rotation * (sighting.information * error), &problem);
    }
    const std::vector<Problem::Vector> changes = problem.Solve();
    for (int i = 0; i < poses; ++i) poses_[At(i)].head<2>() += changes[At(i)];
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      positions_[i] += changes[At(poses) + i];
    }
  }

  static void Add(int i, int j, const Eigen::Matrix2d& product,
                  const Eigen::Vector2d& gradient,
                  LinearProblem<double, 2>* problem) {
    problem->AddProduct(j, j, product);
    problem->AddGradient(j, gradient);
    if (i == kNone) return;
    problem->AddProduct(i, i, product);
    problem->AddProduct(i, j, -product);
    problem->AddProduct(j, i, -product);
    problem->AddGradient(i, -gradient);
  }

  std::vector<Pose2>& poses_;
  std::vector<Eigen::Vector2d>& positions_;
  const std::vector<bool>& is_known_;
  const std::vector<bool>& is_known_landmark_;
  const std::vector<PoseSighting>& pose_sightings_;
  const std::vector<PositionSighting>& position_sightings_;
};

}  // namespace

void RelaxPoses(PoseNetwork* network) { Relaxation(network).Run(); }

}  // namespace plumbline
