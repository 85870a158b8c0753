#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/session.h>
#include <plumbline/core/symmetric_ordering.h>
#include <plumbline/frontend/place_chain.h>
#include <plumbline/frontend/pose_recovery.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>

namespace plumbline {
namespace {

constexpr char kSource[] = "frontend";

// Where along a wall its position is, is a choice and no measurement, m.
constexpr double kAlongSigma = 1e-3;

// Of variances where a part is (next to) nothing, m^2 and rad^2.
constexpr double kRounding = 1e-10;

// Random vectors by which traces are estimated (Hutchinson 1990).
constexpr int kProbes = 10;

// Parts of covariances: what matches tell, what they leave open, the drift of
// matching over the way and over turns, and sightings. The factors of all but
// what is left open are estimated: hardly anything shows an error there.
enum Part { kMatch, kOpen, kWay, kTurn, kSighting, kNumParts };
constexpr int kMotionParts = 4;
constexpr Part kEstimated[] = {kMatch, kWay, kTurn, kSighting};

using Parts = std::array<Eigen::MatrixXd, kNumParts>;

Eigen::MatrixXd Symmetric(const Eigen::MatrixXd& m) {
  return 0.5 * (m + m.transpose());
}

Pose2 PoseOf(const Feature& feature) {
  return Pose2(feature.parameters[0], feature.parameters[1],
               feature.parameters[2]);
}

// Parts of the covariance of a refined motion: what the returns tell, odometry
// along what they leave open, and the drift of matching.
std::array<Eigen::Matrix3d, kMotionParts> PartsOfMotion(
    const UncertainPose2& motion, const PoseRecoveryOptions& options) {
  const double way = motion.mean.head<2>().norm();
  const double turned = std::abs(motion.mean[2]);
  const MatchDrift& drift = options.drift;
  const double position =
      drift.translation_per_root_metre * drift.translation_per_root_metre * way;
  const double heading =
      drift.rotation_per_root_metre * drift.rotation_per_root_metre * way;
  std::array<Eigen::Matrix3d, kMotionParts> parts;
  parts[kMatch].setZero();
  parts[kOpen].setZero();
  parts[kWay] = Eigen::Vector3d(position, position, heading).asDiagonal();
  parts[kTurn] = Eigen::Vector3d(0.0, 0.0,
                                 drift.rotation_per_root_radian *
                                     drift.rotation_per_root_radian * turned)
                     .asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(
      Eigen::Matrix3d(motion.covariance - parts[kWay] - parts[kTurn]));
  const Eigen::Matrix3d rest =
      solver.eigenvectors() *
      solver.eigenvalues().cwiseMax(kRounding).asDiagonal() *
      solver.eigenvectors().transpose();
  // Where the rest is as wide as odometry, the returns have told nothing.
  const Eigen::Matrix3d odometry =
      OdometryCovariance(motion.mean, options.noise);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix3d> against(
      rest, odometry);
  const Eigen::Matrix3d basis = odometry * against.eigenvectors();
  for (int i = 0; i < 3; ++i) {
    const double ratio = against.eigenvalues()[i];
    const double open = std::min(1.0, ratio);
    const Eigen::Matrix3d along =
        ratio * basis.col(i) * basis.col(i).transpose();
    parts[kMatch] += (1.0 - open) * along;
    parts[kOpen] += open * along;
  }
  return parts;
}

// A measurement between a place and another place, or a segment.
struct Link {
  const RelationType* relation;
  FeatureId from, to;
  Eigen::VectorXd expected;
  // Those that are empty are not there.
  Parts parts;
  // Of its information; less than 1 for outliers.
  double weight = 1.0;

  Eigen::MatrixXd Information(
      const std::array<double, kNumParts>& factors) const {
    Eigen::MatrixXd covariance =
        Eigen::MatrixXd::Zero(expected.size(), expected.size());
    for (int p = 0; p < kNumParts; ++p) {
      if (parts[p].size() > 0) covariance += factors[p] * parts[p];
    }
    covariance.diagonal().array() += kRounding;
    return weight * Symmetric(covariance.inverse());
  }
};

// The looks at a segment from one place: the mean, weighted by information, of
// (offset of the place across it, heading against it) (Eq. 20).
struct Sighting {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d weighted = Eigen::Vector2d::Zero();
  int looks = 0;

  Eigen::Vector2d Mean() const { return information.inverse() * weighted; }

  void Add(const Pose2& seen, const Eigen::Matrix2d& covariance) {
    // Offset and direction are independent at the middle of the piece; at the
    // place's foot point the direction moves the offset.
    const Pose2 inverse = Inverse(seen);
    Eigen::Matrix2d lever;
    lever << 1.0, inverse[0], 0.0, 1.0;
    const Eigen::Matrix2d of_look =
        (lever * covariance * lever.transpose()).inverse();
    Eigen::Vector2d expected(inverse[1], inverse[2]);
    // Near the looks before, so that a mean is one.
    if (looks > 0) {
      const double mean = Mean()[1];
      expected[1] = mean + NormalizeAngle(expected[1] - mean);
    }
    information += of_look;
    weighted += of_look * expected;
    ++looks;
  }
};

class Recovery {
 public:
  // All must outlive it.
  Recovery(const std::vector<KeyScanRecord>& records,
           const std::vector<Pose2>& key_poses,
           const PoseRecoveryOptions& options, const Registry& registry,
           const Graph& graph)
      : records_(records),
        options_(options),
        registry_(registry),
        pose_pose_(registry.GetRelation("pose_pose")),
        begins_(PlaceBegins(records, options.place_stride)),
        factors_{1.0, 1.0, 1.0, 1.0, 1.0} {
    for (const std::size_t begin : begins_) {
      Feature place;
      place.type = &registry_.GetFeature("pose");
      const Pose2& pose = key_poses[begin];
      place.parameters = {pose[0], pose[1], pose[2]};
      place.observations = 1;
      place.source = kSource;
      place.fixed = provisional_.empty();
      provisional_.push_back(transaction_.AddFeature(std::move(place)));
    }
    for (std::size_t p = 1; p < begins_.size(); ++p) AddMotion(p);
    for (std::size_t p = 0; p < begins_.size(); ++p) AddSightings(p, graph);
  }

  // Whether any segment was seen.
  bool HasSightings() const { return !held_.empty(); }

  // Estimates the factors on the measurements alone.
  void Estimate(const Graph& graph) {
    Graph measured;
    Transaction transaction = transaction_;
    std::map<FeatureId, FeatureId> copies;
    for (const auto& entry : held_) {
      Feature wall = graph.GetFeature(entry.first);
      wall.id = kNoId;
      wall.fixed = false;
      copies[entry.first] = transaction.AddFeature(std::move(wall));
    }
    const auto scratch = [&](FeatureId id) {
      const auto found = copies.find(id);
      return found == copies.end() ? id : found->second;
    };
    AddConstraints(graph, scratch, &transaction);
    const std::vector<ConstraintId> ids =
        measured.Apply(std::move(transaction)).constraints;
    SolverSession session(&measured, registry_, SessionOptions());
    for (int round = 0; round < options_.rounds; ++round) {
      const SolveReport report = session.SolveGlobal();
      if (!report.usable) {
        throw PLUMBLINE_ERROR("recovery of poses failed: " + report.message,
                              "a usable solution");
      }
      if (!TakeVariances(measured, ids)) return;
      for (std::size_t i = 0; i < links_.size(); ++i) {
        measured.UpdateConstraint(ids[i], links_[i].expected,
                                  links_[i].Information(factors_));
      }
    }
  }

  // Puts the places into the graph and the measurements in place of those that
  // stood for them.
  RecoveredPoses Apply(FeatureId robot, Graph* graph) {
    for (const auto& entry : held_) {
      graph->GetFeature(entry.first).fixed = false;
    }
    for (const Constraint* constraint : std::as_const(*graph).Constraints()) {
      if (constraint->kind != ConstraintClass::kMeasurement) continue;
      bool goes = true;
      bool is_of_robot = false;
      for (const FeatureId id : constraint->features) {
        goes = goes && (id == robot || held_.count(id) > 0);
        is_of_robot = is_of_robot || id == robot;
      }
      if (goes || is_of_robot) transaction_.RemoveConstraint(constraint->id);
    }
    if (robot != kNoId) transaction_.RemoveFeature(robot);
    AddConstraints(
        *graph, [](FeatureId id) { return id; }, &transaction_);
    RecoveredPoses result;
    result.places = graph->Apply(std::move(transaction_)).features;
    result.match_variance_factor = factors_[kMatch];
    result.way_variance_factor = factors_[kWay];
    result.turn_variance_factor = factors_[kTurn];
    result.sighting_variance_factor = factors_[kSighting];
    return result;
  }

 private:
  // How the robot came to a place.
  void AddMotion(std::size_t place) {
    const PlaceArrival arrival = ArrivalAt(records_, begins_, place);
    Pose2 mean = Pose2::Zero();
    std::array<Eigen::Matrix3d, kMotionParts> sums;
    for (Eigen::Matrix3d& sum : sums) sum.setZero();
    for (const std::size_t k : arrival.steps) {
      const UncertainPose2& step = records_[k].motion;
      const Eigen::Matrix3d j1 = ComposeJacobianFirst(mean, step.mean);
      const Eigen::Matrix3d j2 = ComposeJacobianSecond(mean);
      const std::array<Eigen::Matrix3d, kMotionParts> parts =
          PartsOfMotion(step, options_);
      for (int p = 0; p < kMotionParts; ++p) {
        sums[p] =
            j1 * sums[p] * j1.transpose() + j2 * parts[p] * j2.transpose();
      }
      mean = Compose(mean, step.mean);
    }
    Link link;
    link.relation = &pose_pose_;
    link.from = provisional_[arrival.from];
    link.to = provisional_[place];
    link.expected = mean;
    for (int p = 0; p < kMotionParts; ++p) link.parts[p] = sums[p];
    links_.push_back(std::move(link));
  }

  // What was seen from a place on to the next.
  void AddSightings(std::size_t place, const Graph& graph) {
    std::map<FeatureId, Sighting> sightings;
    Pose2 since = Pose2::Zero();
    const std::size_t end =
        place + 1 < begins_.size() ? begins_[place + 1] : records_.size();
    for (std::size_t k = begins_[place]; k < end; ++k) {
      if (k > begins_[place]) since = Compose(since, records_[k].motion.mean);
      for (const FeatureMatch& match : records_[k].matches) {
        if (graph.FindFeature(match.feature) == nullptr) continue;
        sightings[match.feature].Add(Compose(since, match.observation.pose),
                                     match.observation.covariance);
      }
    }
    for (const auto& [id, sighting] : sightings) {
      Link link;
      link.relation = &registry_.GetRelation("pose_segment_collinearity");
      link.from = provisional_[place];
      link.to = id;
      Eigen::Vector2d mean = sighting.Mean();
      mean[1] = NormalizeAngle(mean[1]);
      link.expected = mean;
      // Looks from one place share what the wall does to them: together they
      // count as one.
      link.parts[kSighting] = static_cast<double>(sighting.looks) *
                              Symmetric(sighting.information.inverse());
      links_.push_back(std::move(link));
      held_.emplace(id, place);
    }
  }

  // The links, and what holds each segment along itself: the first place that
  // saw it.
  template <typename IdOf>
  void AddConstraints(const Graph& graph, const IdOf& id_of,
                      Transaction* transaction) const {
    for (const Link& link : links_) {
      transaction->AddConstraint(
          MakeMeasurement(*link.relation, {link.from, id_of(link.to)},
                          link.expected, link.Information(factors_), kSource));
    }
    for (const auto& [id, place] : held_) {
      const Feature& first =
          transaction_.added_features()[Transaction::ProvisionalIndex(
              provisional_[place])];
      const Eigen::Vector3d information(1.0 / (kAlongSigma * kAlongSigma), 0.0,
                                        0.0);
      transaction->AddConstraint(
          MakeMeasurement(pose_pose_, {id_of(id), provisional_[place]},
                          Between(PoseOf(graph.GetFeature(id)), PoseOf(first)),
                          information.asDiagonal(), kSource));
    }
  }

  // Takes factors and weights anew at the state of a graph whose constraints
  // `ids` are the links, then what holds segments along. False when it cannot
  // be told.
  bool TakeVariances(const Graph& measured,
                     const std::vector<ConstraintId>& ids) {
    std::map<FeatureId, int> columns;
    for (const Feature* feature : measured.Features()) {
      if (feature->fixed) continue;
      const int column = 3 * static_cast<int>(columns.size());
      columns.emplace(feature->id, column);
    }
    const int size = 3 * static_cast<int>(columns.size());
    std::vector<Eigen::Triplet<double>> triplets;
    std::vector<Eigen::MatrixXd> roots;
    std::vector<Eigen::VectorXd> residuals;
    std::vector<int> rows;
    int num_rows = 0;
    for (const ConstraintId id : ids) {
      const Constraint& constraint = measured.GetConstraint(id);
      roots.push_back(SqrtInformation(constraint.information));
      const auto cost =
          MakeCost(constraint, roots.back(), FeaturesOf(measured, constraint));
      const LinearizedConstraint linear =
          Linearize(measured, constraint, *cost);
      for (std::size_t f = 0; f < constraint.features.size(); ++f) {
        const auto found = columns.find(constraint.features[f]);
        if (found == columns.end()) continue;
        const Eigen::MatrixXd& jacobian = linear.jacobians[f];
        for (Eigen::Index r = 0; r < jacobian.rows(); ++r) {
          for (Eigen::Index c = 0; c < jacobian.cols(); ++c) {
            triplets.emplace_back(num_rows + static_cast<int>(r),
                                  found->second + static_cast<int>(c),
                                  jacobian(r, c));
          }
        }
      }
      rows.push_back(num_rows);
      num_rows += static_cast<int>(linear.residual.size());
      residuals.push_back(linear.residual);
    }
    Eigen::SparseMatrix<double> jacobian(num_rows, size);
    jacobian.setFromTriplets(triplets.begin(), triplets.end());
    const SymmetricFactor<double> ldlt(
        Eigen::SparseMatrix<double>(jacobian.transpose() * jacobian));
    if (ldlt.info() != Eigen::Success) return false;

    // For each part: what it has of the residuals' chi-square, and the
    // expectation of that, tr(f V W R) with W the weights and R what the fit
    // leaves of errors.
    std::array<double, kNumParts> squares{};
    std::array<double, kNumParts> redundancies{};
    const auto share = [&](std::size_t i, int part, const Eigen::VectorXd& a,
                           const Eigen::VectorXd& b) {
      const Link& link = links_[i];
      return factors_[part] / link.weight *
             (roots[i].transpose() * a)
                 .dot(link.parts[part] * (roots[i].transpose() * b));
    };
    std::mt19937 random(1);
    std::array<Eigen::VectorXd, kProbes> probes;
    std::array<Eigen::VectorXd, kProbes> left;
    for (int t = 0; t < kProbes; ++t) {
      probes[t].resize(num_rows);
      for (double& value : probes[t]) {
        value = (random() >> 16 & 1U) != 0 ? 1.0 : -1.0;
      }
      const Eigen::VectorXd solved =
          ldlt.solve(jacobian.transpose() * probes[t]);
      left[t] = probes[t] - jacobian * solved;
    }
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const Eigen::Index length = residuals[i].size();
      for (const Part part : kEstimated) {
        if (links_[i].parts[part].size() == 0) continue;
        squares[part] += share(i, part, residuals[i], residuals[i]);
        for (int t = 0; t < kProbes; ++t) {
          redundancies[part] += share(i, part, left[t].segment(rows[i], length),
                                      probes[t].segment(rows[i], length)) /
                                kProbes;
        }
      }
      if (links_[i].parts[kSighting].size() > 0) {
        const double chi_square = residuals[i].squaredNorm() / links_[i].weight;
        links_[i].weight =
            std::min(1.0, options_.outlier_chi_square / chi_square);
      }
    }
    for (const Part part : kEstimated) {
      const double prior =
          part == kWay || part == kTurn ? options_.prior_redundancy : 0.0;
      if (redundancies[part] + prior < 1.0) continue;
      factors_[part] = std::clamp((factors_[part] * squares[part] + prior) /
                                      (redundancies[part] + prior),
                                  options_.min_variance_factor,
                                  options_.max_variance_factor);
    }
    return true;
  }

  const std::vector<KeyScanRecord>& records_;
  const PoseRecoveryOptions& options_;
  const Registry& registry_;
  const RelationType& pose_pose_;
  // The record that each place begins with.
  const std::vector<std::size_t> begins_;
  // Adds the places; the provisional ids of these.
  Transaction transaction_;
  std::vector<FeatureId> provisional_;
  std::vector<Link> links_;
  // By segment: the first place that saw it.
  std::map<FeatureId, std::size_t> held_;
  std::array<double, kNumParts> factors_;
};

}  // namespace

RecoveredPoses RecoverPoses(const std::vector<KeyScanRecord>& records,
                            const std::vector<Pose2>& key_poses,
                            FeatureId robot, const PoseRecoveryOptions& options,
                            const Registry& registry, Graph* graph) {
  if (records.size() != key_poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(key_poses.size()) + " poses",
        "one for each of " + std::to_string(records.size()) + " key scans");
  }
  Recovery recovery(records, key_poses, options, registry, *graph);
  if (!recovery.HasSightings()) return {};
  recovery.Estimate(*graph);
  return recovery.Apply(robot, graph);
}

}  // namespace plumbline
