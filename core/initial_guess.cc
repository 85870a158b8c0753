#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <queue>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Complex = std::complex<double>;

// Pull towards the start of a linear problem, relative to the diagonal: decides
// in directions of which no measurement speaks, moves nothing else.
constexpr double kPull = 1e-13;
// A relaxed heading shorter than this says nothing.
constexpr double kShortHeading = 1e-6;
constexpr int kNone = -1;

// A relation that tells where a pose or a landmark is.
struct PoseSighting {
  ConstraintId id;
  // Places among the poses; the first is kNone for a prior.
  int first;
  int second;
  Pose2 value;
  Eigen::Matrix3d information;
};
struct PositionSighting {
  // Places among the poses and among the landmarks.
  int pose;
  int landmark;
  Eigen::Vector2d value;
  Eigen::Matrix2d information;
};

Eigen::Matrix2d Rotation(double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Eigen::Matrix2d rotation;
  rotation << c, -s, s, c;
  return rotation;
}

Complex ToComplex(const Eigen::Vector2d& v) { return {v[0], v[1]}; }

bool IsMeasurement(const Constraint& constraint) {
  return constraint.state == ConstraintState::kLive &&
         constraint.kind == ConstraintClass::kMeasurement &&
         !constraint.information.isZero(0.0);
}

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
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<Scalar>> factor(normal);
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

class Guess {
 public:
  Guess(InitialGuessMethod method, Graph* graph)
      : method_(method), graph_(graph) {
    const auto size = static_cast<std::size_t>(graph->feature_id_end());
    pose_of_.assign(size, kNone);
    landmark_of_.assign(size, kNone);
    is_placed_.assign(size, false);
    FindPoses();
    FindSightings();
    FindRoots();
  }

  InitialGuessReport Make() {
    GrowTrees();
    PlaceLandmarks();
    if (method_ == InitialGuessMethod::kChordal) Relax();
    WritePoses();
    PlaceOthers();
    for (const Feature* feature : std::as_const(*graph_).Features()) {
      if (!feature->is_virtual && !feature->fixed &&
          !is_placed_[static_cast<std::size_t>(feature->id)]) {
        ++report_.kept;
      }
    }
    return report_;
  }

 private:
  static std::size_t At(int i) { return static_cast<std::size_t>(i); }
  int& PoseOf(FeatureId id) { return pose_of_[static_cast<std::size_t>(id)]; }
  int& LandmarkOf(FeatureId id) {
    return landmark_of_[static_cast<std::size_t>(id)];
  }

  void FindPoses() {
    for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
      if (!IsMeasurement(*constraint) ||
          !constraint->type->Is(RelationRole::kPose)) {
        continue;
      }
      for (const FeatureId id : constraint->features) PoseOf(id) = 0;
    }
    for (Feature* feature : graph_->MutableFeatures()) {
      if (PoseOf(feature->id) == kNone) continue;
      PoseOf(feature->id) = static_cast<int>(poses_.size());
      features_.push_back(feature);
      poses_.emplace_back(feature->parameters[0], feature->parameters[1],
                          feature->parameters[2]);
    }
    links_.resize(poses_.size());
  }

  void FindSightings() {
    for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
      if (!IsMeasurement(*constraint)) continue;
      const std::vector<FeatureId>& ids = constraint->features;
      if (constraint->type->Is(RelationRole::kPose)) {
        const int index = static_cast<int>(pose_sightings_.size());
        pose_sightings_.push_back({constraint->id,
                                   ids.size() == 1 ? kNone : PoseOf(ids[0]),
                                   PoseOf(ids.back()), constraint->expected,
                                   constraint->information});
        for (const FeatureId id : ids) {
          links_[At(PoseOf(id))].push_back(index);
        }
      } else if (constraint->type->Is(RelationRole::kPosition) &&
                 PoseOf(ids[0]) != kNone && PoseOf(ids[1]) == kNone) {
        if (LandmarkOf(ids[1]) == kNone) {
          LandmarkOf(ids[1]) = static_cast<int>(landmarks_.size());
          landmarks_.push_back(graph_->FindFeature(ids[1]));
        }
        position_sightings_.push_back({PoseOf(ids[0]), LandmarkOf(ids[1]),
                                       constraint->expected,
                                       constraint->information});
      }
    }
  }

  // Fixed poses; in a part without, the lowest one with a prior; else the
  // lowest. What holds landmarks holds no heading, so they are no roots, and
  // parts are those that poses alone make.
  void FindRoots() {
    DisjointSets parts(poses_.size());
    std::vector<int> priors(poses_.size(), kNone);
    for (std::size_t i = 0; i < pose_sightings_.size(); ++i) {
      const PoseSighting& sighting = pose_sightings_[i];
      if (sighting.first == kNone) {
        int& prior = priors[At(sighting.second)];
        if (prior == kNone) prior = static_cast<int>(i);
      } else {
        parts.Join(At(sighting.first), At(sighting.second));
      }
    }
    is_known_.resize(poses_.size());
    std::vector<bool> has_fixed(poses_.size(), false);
    std::vector<int> prior_pose(poses_.size(), kNone);
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const std::size_t part = parts.Find(i);
      is_known_[i] = features_[i]->fixed;
      if (is_known_[i]) has_fixed[part] = true;
      if (priors[i] != kNone && prior_pose[part] == kNone) {
        prior_pose[part] = static_cast<int>(i);
      }
    }
    is_root_ = is_known_;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (parts.Find(i) != i) continue;
      ++report_.parts;
      if (has_fixed[i]) continue;
      if (prior_pose[i] == kNone) {
        is_root_[i] = is_known_[i] = true;
      } else {
        // Free in the linear problems, where the prior holds it.
        is_root_[At(prior_pose[i])] = true;
        poses_[At(prior_pose[i])] =
            pose_sightings_[At(priors[At(prior_pose[i])])].value;
      }
    }
  }

  // What it costs to go over a relation.
  double StepCost(const PoseSighting& sighting) const {
    if (method_ == InitialGuessMethod::kOdometry) {
      return std::abs(sighting.first - sighting.second);
    }
    // Never zero, so that of equals the shorter way is taken.
    return 1.0 / std::max(sighting.information(2, 2),
                          std::numeric_limits<double>::min());
  }

  void GrowTrees() {
    const bool adds_up = method_ != InitialGuessMethod::kOdometry;
    // Cost, relation, pose to place and the one to place it from.
    using Step = std::tuple<double, ConstraintId, int, int, int>;
    std::priority_queue<Step, std::vector<Step>, std::greater<Step>> steps;
    std::vector<bool> is_done(poses_.size(), false);
    const auto leave = [&](int pose, double cost) {
      is_done[At(pose)] = true;
      for (const int index : links_[At(pose)]) {
        const PoseSighting& sighting = pose_sightings_[At(index)];
        if (sighting.first == kNone) continue;
        const int other =
            sighting.first == pose ? sighting.second : sighting.first;
        if (is_done[At(other)]) continue;
        steps.emplace((adds_up ? cost : 0.0) + StepCost(sighting), sighting.id,
                      index, other, pose);
      }
    };
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (is_root_[i]) leave(static_cast<int>(i), 0.0);
    }
    while (!steps.empty()) {
      const auto [cost, id, index, to, from] = steps.top();
      steps.pop();
      if (is_done[At(to)]) continue;
      const PoseSighting& sighting = pose_sightings_[At(index)];
      poses_[At(to)] = Compose(poses_[At(from)], sighting.first == from
                                                     ? sighting.value
                                                     : Inverse(sighting.value));
      leave(to, cost);
    }
  }

  // Landmarks at the mean of where the poses see them.
  void PlaceLandmarks() {
    positions_.assign(landmarks_.size(), Eigen::Vector2d::Zero());
    std::vector<int> counts(landmarks_.size(), 0);
    for (const PositionSighting& sighting : position_sightings_) {
      positions_[At(sighting.landmark)] +=
          TransformPoint(poses_[At(sighting.pose)], sighting.value);
      ++counts[At(sighting.landmark)];
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (landmarks_[i]->fixed) {
        positions_[i] = {landmarks_[i]->parameters[0],
                         landmarks_[i]->parameters[1]};
      } else {
        positions_[i] /= counts[i];
      }
    }
  }

  void Relax() {
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
    const int landmarks = static_cast<int>(landmarks_.size());
    // z of all poses, then t of all poses, then l.
    std::vector<bool> is_known = is_known_;
    is_known.insert(is_known.end(), is_known_.begin(), is_known_.end());
    for (const Feature* feature : landmarks_)
      is_known.push_back(feature->fixed);
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
    for (const Feature* feature : landmarks_)
      is_known.push_back(feature->fixed);
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
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
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

  static void CheckFinite(const Feature& feature, bool is_finite) {
    if (is_finite) return;
    throw PLUMBLINE_ERROR("the start of " + feature.type->name + " " +
                              std::to_string(feature.id) + " is not finite",
                          "measurements within the range of numbers");
  }

  void WritePoses() {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      CheckFinite(*features_[i], poses_[i].allFinite());
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      CheckFinite(*landmarks_[i], positions_[i].allFinite());
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      Feature& feature = *features_[i];
      is_placed_[static_cast<std::size_t>(feature.id)] = true;
      if (feature.fixed) continue;
      ++report_.poses;
      feature.parameters[0] = poses_[i][0];
      feature.parameters[1] = poses_[i][1];
      feature.parameters[2] = NormalizeAngle(poses_[i][2]);
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      Feature& feature = *landmarks_[i];
      is_placed_[static_cast<std::size_t>(feature.id)] = true;
      if (feature.fixed) continue;
      ++report_.landmarks;
      feature.parameters[0] = positions_[i][0];
      feature.parameters[1] = positions_[i][1];
    }
  }

  // What is seen otherwise: from the first relation that can tell.
  void PlaceOthers() {
    for (bool has_placed = true; has_placed;) {
      has_placed = false;
      for (const Constraint* constraint :
           std::as_const(*graph_).Constraints()) {
        if (!IsMeasurement(*constraint) || !constraint->type->place_second) {
          continue;
        }
        const Feature& first = *graph_->FindFeature(constraint->features[0]);
        Feature& second = *graph_->FindFeature(constraint->features[1]);
        if (second.fixed || second.is_virtual ||
            is_placed_[static_cast<std::size_t>(second.id)] ||
            !(first.fixed || is_placed_[static_cast<std::size_t>(first.id)])) {
          continue;
        }
        constraint->type->place_second(constraint->expected, first, &second);
        is_placed_[static_cast<std::size_t>(second.id)] = true;
        ++report_.landmarks;
        has_placed = true;
      }
    }
  }

  const InitialGuessMethod method_;
  Graph* const graph_;
  InitialGuessReport report_;
  // By feature id: place among the poses, or the landmarks; kNone.
  std::vector<int> pose_of_;
  std::vector<int> landmark_of_;
  std::vector<bool> is_placed_;
  // Poses in the order of ids.
  std::vector<Feature*> features_;
  std::vector<Pose2> poses_;
  // Where trees begin, and what linear problems hold.
  std::vector<bool> is_root_;
  std::vector<bool> is_known_;
  std::vector<Feature*> landmarks_;
  std::vector<Eigen::Vector2d> positions_;
  std::vector<PoseSighting> pose_sightings_;
  std::vector<PositionSighting> position_sightings_;
  // Places in pose_sightings_ by pose.
  std::vector<std::vector<int>> links_;
};

}  // namespace

InitialGuessReport MakeInitialGuess(const InitialGuessOptions& options,
                                    Graph* graph) {
  if (options.method == InitialGuessMethod::kFile) return {};
  return Guess(options.method, graph).Make();
}

}  // namespace plumbline
