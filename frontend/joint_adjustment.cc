#include <plumbline/core/error.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/information.h>
#include <plumbline/frontend/frontend_state.h>
#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/place_chain.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

constexpr char kSource[] = "refinement";
constexpr char kVoteRelation[] = "pose_segment_points";

// Where along a wall its position is, is a choice and no measurement, m: as
// good as exact, or what it is wide would be in every covariance as seen from
// the fixed wall, which only this ties along itself.
constexpr double kAlongSigma = 1e-3;

Pose2 PoseOf(const Feature& feature) {
  return Pose2(feature.parameters[0], feature.parameters[1],
               feature.parameters[2]);
}

// The points that have a normal, in the frame that `pose` is given in.
void AddReference(const std::vector<ScanPoint>& points, const Pose2& pose,
                  std::vector<ScanPoint>* reference) {
  const PoseTransform transform(pose);
  reference->reserve(reference->size() + points.size());
  for (const ScanPoint& point : points) {
    if (point.normal.squaredNorm() == 0.0) continue;
    reference->push_back(Moved(point, transform));
  }
}

// The same of returns alone: votes are counted.
void AddReturns(const std::vector<ScanPoint>& points, const Pose2& pose,
                std::vector<SurfaceReturn>* returns) {
  const PoseTransform transform(pose);
  for (const ScanPoint& point : points) {
    if (point.is_between || point.normal.squaredNorm() == 0.0) continue;
    returns->push_back({transform.Point(point.position).cast<float>(),
                        transform.Direction(point.normal).cast<float>()});
  }
}

// Of the scans [begin, end), within reach.
std::size_t CountReturns(const std::vector<Scan>& scans, std::size_t begin,
                         std::size_t end, const ScanPointsOptions& options) {
  std::size_t count = 0;
  for (std::size_t i = begin; i < end; ++i) {
    for (const float range : scans[i].ranges) {
      if (range >= options.minimum_range && range <= options.usable_range) {
        ++count;
      }
    }
  }
  return count;
}

// Chi-square of a relative pose at the present state.
double ChiSquare(const Graph& graph, FeatureId from, FeatureId to,
                 const Pose2& expected, const Eigen::Matrix3d& information) {
  Eigen::Vector3d error =
      Between(PoseOf(graph.GetFeature(from)), PoseOf(graph.GetFeature(to))) -
      expected;
  error[2] = NormalizeAngle(error[2]);
  return error.dot(information * error);
}

// Chi-square of what a vote's returns alone say of the wall's place against
// where it is (offset and direction).
double VoteChiSquare(const Graph& graph, const Constraint& vote) {
  using RowMajor =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Feature& pose = graph.GetFeature(vote.features[0]);
  const Feature& wall = graph.GetFeature(vote.features[1]);
  RelationArguments arguments;
  arguments.expected = vote.expected;
  arguments.sqrt_information = SqrtInformation(vote.information);
  arguments.features = {&pose, &wall};
  const auto cost = vote.type->make_cost(arguments);
  const double* parameters[] = {pose.data(), wall.data()};
  Eigen::VectorXd residual(vote.type->residual_size);
  RowMajor jacobian(vote.type->residual_size, wall.type->size);
  double* jacobians[] = {nullptr, jacobian.data()};
  if (!cost->Evaluate(parameters, residual.data(), jacobians)) return 0.0;
  const Eigen::Matrix3d information = jacobian.transpose() * jacobian;
  const Eigen::Vector3d gradient = jacobian.transpose() * residual;
  // Along itself the wall may lie anywhere.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
  double chi_square = 0.0;
  for (int i = 1; i < 3; ++i) {
    const double value = solver.eigenvalues()[i];
    if (value <= 1e-9 * solver.eigenvalues()[2]) continue;
    const double along = solver.eigenvectors().col(i).dot(gradient);
    chi_square += along * along / value;
  }
  return chi_square;
}

// Relative change of the cost at which a solve ends after which votes and
// weights are taken anew.
constexpr double kRoundTolerance = 1e-4;

// Medians of chi-square with two and three degrees of freedom.
constexpr double kMedianOf2 = 1.386;
constexpr double kMedianOf3 = 2.366;

// Exceeded by one in a hundred of chi-squares with three degrees of freedom.
constexpr double kOutlierOf3 = 11.34;

// How much larger than 1 the variance of unit weight of a group of links is, of
// which so large a share is redundant. `expected`: median of their chi-square.
double VarianceFactor(std::vector<double> chi_squares, double expected,
                      double redundancy, double prior_links) {
  if (chi_squares.empty() || redundancy <= 0.0) return 1.0;
  const auto middle = chi_squares.begin() + chi_squares.size() / 2;
  std::nth_element(chi_squares.begin(), middle, chi_squares.end());
  const double factor = *middle / (expected * redundancy);
  const double links = redundancy * static_cast<double>(chi_squares.size());
  return std::exp(std::log(std::max(factor, 1e-12)) * links /
                  (links + prior_links));
}

// The motion from the place before to this one, which is not the first.
UncertainPose2 MotionTo(const std::vector<KeyScanRecord>& records,
                        const PlaceArrival& arrival) {
  UncertainPose2 motion;
  for (const std::size_t k : arrival.steps) {
    motion = Compose(motion, records[k].motion);
  }
  return motion;
}

}  // namespace

std::vector<Place> GatherPlaces(const std::vector<Scan>& scans,
                                const std::vector<RefinedScan>& refined,
                                const std::vector<KeyScanRecord>& records,
                                const JointAdjustmentOptions& options,
                                const std::function<bool()>& stop) {
  const std::vector<std::size_t> begins =
      PlaceBegins(records, options.place_stride);
  std::vector<Place> places(begins.size());
  ParallelFor(places.size(), options.num_threads, [&](std::size_t p) {
    Place& place = places[p];
    place.num_scans = 0;
    if (stop && stop()) return;
    std::vector<ScanPoint> points;
    Pose2 key = Pose2::Zero();
    const std::size_t last =
        p + 1 < begins.size() ? begins[p + 1] : records.size();
    if (begins[p] < last) {
      place.returns.reserve(CountReturns(
          scans, records[begins[p]].scan,
          last < records.size() ? records[last].scan : refined.size(),
          options.points));
    }
    for (std::size_t k = begins[p]; k < last; ++k) {
      if (k > begins[p]) key = Compose(key, records[k].motion.mean);
      const std::size_t begin = records[k].scan;
      const std::size_t end =
          k + 1 < records.size() ? records[k + 1].scan : refined.size();
      for (std::size_t i = begin; i < end; ++i) {
        ExtractScanPoints(scans[i], options.points, &points);
        if (place.num_scans == 0) place.scan = points;
        const Pose2 pose =
            i == begin ? key : Compose(key, refined[i].since_key.mean);
        if (i == begin) AddReference(points, pose, &place.reference);
        AddReturns(points, pose, &place.returns);
        ++place.num_scans;
      }
    }
  });
  return places;
}

JointAdjustment::JointAdjustment(Graph* graph, SolverSession* session,
                                 const Registry& registry,
                                 const std::vector<Scan>& scans,
                                 const std::vector<RefinedScan>& refined,
                                 const std::vector<KeyScanRecord>& records,
                                 const JointAdjustmentOptions& options,
                                 std::function<bool()> stop,
                                 std::vector<Place> places)
    : graph_(graph),
      session_(session),
      registry_(registry),
      options_(options),
      stop_(std::move(stop)),
      records_(records),
      places_(std::move(places)) {
  options_.relations.num_threads = options_.num_threads;
  options_.votes.num_threads = options_.num_threads;
  begins_ = PlaceBegins(records_, options_.place_stride);
  if (places_.empty()) {
    places_ = GatherPlaces(scans, refined, records_, options_);
  }
  if (places_.size() != begins_.size()) {
    throw PLUMBLINE_ERROR(std::to_string(places_.size()) + " places",
                          std::to_string(begins_.size()));
  }
  for (std::size_t p = 0; p < places_.size(); ++p) {
    places_[p].follows_previous = FollowsTheOneBefore(records_[begins_[p]]);
    if (p > 0) {
      places_[p].since_previous =
          MotionTo(records_, ArrivalAt(records_, begins_, p)).mean;
    }
  }
  options_.relations.num_held =
      static_cast<int>(std::lower_bound(begins_.begin(), begins_.end(),
                                        options_.num_held_records) -
                       begins_.begin());
  finder_ = std::make_unique<ScanMatchFinder>(places_, options_.relations);
}

JointAdjustment::JointAdjustment(
    Graph* graph, SolverSession* session, const Registry& registry,
    const std::vector<Scan>& scans, const std::vector<RefinedScan>& refined,
    const std::vector<KeyScanRecord>& records, StateReader* state,
    const JointAdjustmentOptions& options, std::function<bool()> stop)
    : JointAdjustment(graph, session, registry, scans, refined, records,
                      options, std::move(stop), {}) {
  finder_->ReadState(state);
  ExchangeState(*state);
  if (poses_.size() != places_.size()) {
    throw PLUMBLINE_ERROR(
        "the state is of " + std::to_string(poses_.size()) + " places",
        std::to_string(places_.size()));
  }
}

void JointAdjustment::WriteState(StateWriter* state) {
  finder_->WriteState(state);
  ExchangeState(*state);
}

template <typename Archive>
void JointAdjustment::ExchangeState(Archive& archive) {
  ExchangeAll(archive, poses_, relations_, relation_constraints_, motions_,
              motion_factor_, relation_factor_, vote_factor_, vote_excess_,
              votes_);
}

JointAdjustment::JointAdjustment(
    Graph* graph, SolverSession* session, const Registry& registry,
    const std::vector<Scan>& scans, const std::vector<RefinedScan>& refined,
    const std::vector<KeyScanRecord>& records,
    const std::vector<Pose2>& key_poses, FeatureId robot,
    const JointAdjustmentOptions& options, std::function<bool()> stop,
    std::vector<Place> places)
    : JointAdjustment(graph, session, registry, scans, refined, records,
                      options, std::move(stop), std::move(places)) {
  if (records.size() != key_poses.size()) {
    throw PLUMBLINE_ERROR(
        std::to_string(key_poses.size()) + " poses",
        "one for each of " + std::to_string(records.size()) + " key scans");
  }
  std::vector<Pose2> poses;
  for (const std::size_t k : begins_) poses.push_back(key_poses[k]);

  Transaction transaction;
  std::vector<FeatureId> provisional;
  const FeatureType& pose_type = registry_.GetFeature("pose");
  const RelationType& pose_pose = registry_.GetRelation("pose_pose");
  const bool has_map = graph_->num_features() > 0;
  for (const Pose2& pose : poses) {
    Feature feature;
    feature.type = &pose_type;
    // Without a map the frame is that of the first pose.
    const auto num_held = static_cast<std::size_t>(options_.relations.num_held);
    feature.fixed =
        (!has_map && provisional.empty()) || provisional.size() < num_held;
    feature.parameters = {pose[0], pose[1], pose[2]};
    feature.observations = 1;
    feature.source = kSource;
    provisional.push_back(transaction.AddFeature(feature));
  }
  for (std::size_t p = 1; p < poses.size(); ++p) {
    const PlaceArrival arrival = ArrivalAt(records_, begins_, p);
    if (static_cast<int>(p) < options_.relations.num_held) continue;
    const UncertainPose2 motion = MotionTo(records_, arrival);
    const Eigen::Matrix3d information = motion.covariance.inverse();
    transaction.AddConstraint(MakeMeasurement(
        pose_pose, {provisional[arrival.from], provisional[p]}, motion.mean,
        0.5 * (information + information.transpose()), kSource));
  }
  const TransactionResult added = graph_->Apply(std::move(transaction));
  poses_ = added.features;
  for (const ConstraintId id : added.constraints) {
    motions_.emplace_back(id, graph_->GetConstraint(id).information);
  }
  // What stood for the poses goes, where the returns speak themselves.
  Transaction change;
  const std::map<FeatureId, std::size_t> places_of = HoldAlong(poses, &change);
  for (const Constraint* constraint : std::as_const(*graph_).Constraints()) {
    if (constraint->kind != ConstraintClass::kMeasurement) continue;
    bool goes = true;
    for (const FeatureId id : constraint->features) {
      goes = goes && (id == robot || places_of.count(id) > 0);
    }
    for (const FeatureId id : constraint->features) goes = goes || id == robot;
    if (goes) change.RemoveConstraint(constraint->id);
  }
  if (robot != kNoId) change.RemoveFeature(robot);
  graph_->Apply(std::move(change));
  Match();
}

std::map<FeatureId, std::size_t> JointAdjustment::HoldAlong(
    const std::vector<Pose2>& poses, Transaction* change) const {
  std::map<FeatureId, std::pair<int, std::size_t>> most_votes;
  const std::vector<std::vector<WallVote>> votes =
      CollectWallVotes(*graph_, places_, poses, options_.votes);
  for (std::size_t k = 0; k < votes.size(); ++k) {
    for (const WallVote& vote : votes[k]) {
      const auto inserted =
          most_votes.emplace(vote.wall, std::make_pair(vote.points, k));
      if (vote.points > inserted.first->second.first) {
        inserted.first->second = {vote.points, k};
      }
    }
  }
  // Votes say nothing about a wall's place along itself, which is arbitrary:
  // one pose each holds it where it is.
  std::map<FeatureId, std::size_t> places_of;
  for (const auto& [wall, most] : most_votes) {
    const std::size_t k = most.second;
    places_of.emplace(wall, k);
    const Eigen::Vector3d information(1.0 / (kAlongSigma * kAlongSigma), 0.0,
                                      0.0);
    change->AddConstraint(
        MakeMeasurement(registry_.GetRelation("pose_pose"), {wall, poses_[k]},
                        Between(PoseOf(graph_->GetFeature(wall)), poses[k]),
                        information.asDiagonal(), kSource));
  }
  return places_of;
}

void JointAdjustment::AddWalls(Transaction walls) {
  const std::vector<FeatureId> added = graph_->Apply(std::move(walls)).features;
  Transaction change;
  const std::map<FeatureId, std::size_t> places_of =
      HoldAlong(PlacePoses(), &change);
  // A wall that no return votes for is held by nothing.
  for (const FeatureId id : added) {
    if (places_of.count(id) == 0) change.RemoveFeature(id);
  }
  graph_->Apply(std::move(change));
}

void JointAdjustment::MatchAnew() {
  finder_->TrustPoses();
  Match();
}

void JointAdjustment::Match() {
  relations_ = finder_->Find(PlacePoses(), stop_);
  const RelationType& pose_pose = registry_.GetRelation("pose_pose");
  std::vector<Constraint> wanted;
  wanted.reserve(relations_.size());
  for (const ScanRelation& relation : relations_) {
    wanted.push_back(
        MakeMeasurement(pose_pose, {poses_[relation.from], poses_[relation.to]},
                        relation.mean, WeighedInformation(relation), kSource));
  }
  relation_constraints_ = Replace(relation_constraints_, std::move(wanted));
}

void JointAdjustment::Vote() {
  const RelationType& relation = registry_.GetRelation(kVoteRelation);
  const std::vector<std::vector<WallVote>> votes =
      CollectWallVotes(*graph_, places_, PlacePoses(), options_.votes);
  std::vector<Constraint> wanted;
  for (std::size_t k = 0; k < votes.size(); ++k) {
    for (const WallVote& vote : votes[k]) {
      wanted.push_back(MakeMeasurement(
          relation, {poses_[k], vote.wall}, Eigen::Vector3d::Zero(),
          vote.information / vote_factor_, kSource));
    }
  }
  votes_ = Replace(votes_, std::move(wanted));
}

std::vector<ConstraintId> JointAdjustment::Replace(
    const std::vector<ConstraintId>& old,
    std::vector<Constraint> wanted) const {
  struct Old {
    std::array<FeatureId, 2> features;
    ConstraintId id;
    bool operator<(const Old& other) const {
      return std::tie(features, id) < std::tie(other.features, other.id);
    }
  };
  const auto features_of = [](const Constraint& constraint) {
    return std::array<FeatureId, 2>{constraint.features[0],
                                    constraint.features[1]};
  };
  std::vector<Old> sorted;
  for (const ConstraintId id : old) {
    sorted.push_back(
        {features_of(std::as_const(*graph_).GetConstraint(id)), id});
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<bool> is_kept(sorted.size(), false);
  std::vector<ConstraintId> ids;
  std::vector<std::size_t> added;
  Transaction transaction;
  for (Constraint& constraint : wanted) {
    const std::array<FeatureId, 2> features = features_of(constraint);
    auto found = std::lower_bound(sorted.begin(), sorted.end(),
                                  Old{features, ConstraintId()});
    const auto place = static_cast<std::size_t>(found - sorted.begin());
    if (found != sorted.end() && found->features == features &&
        !is_kept[place]) {
      is_kept[place] = true;
      graph_->UpdateConstraint(found->id, constraint.expected,
                               constraint.information);
      ids.push_back(found->id);
      continue;
    }
    added.push_back(ids.size());
    ids.push_back(kNoId);
    transaction.AddConstraint(std::move(constraint));
  }
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    if (!is_kept[k]) transaction.RemoveConstraint(sorted[k].id);
  }
  const std::vector<ConstraintId> new_ids =
      graph_->Apply(std::move(transaction)).constraints;
  for (std::size_t i = 0; i < new_ids.size(); ++i) ids[added[i]] = new_ids[i];
  return ids;
}

Eigen::Matrix3d JointAdjustment::WeighedInformation(
    const ScanRelation& relation) const {
  const Eigen::Matrix3d information = relation.information / relation_factor_;
  const double squared =
      ChiSquare(*graph_, poses_[relation.from], poses_[relation.to],
                relation.mean, information);
  return information /
         (1.0 + squared / (options_.loss_scale * options_.loss_scale));
}

void JointAdjustment::Reweigh() {
  for (std::size_t i = 0; i < relations_.size(); ++i) {
    graph_->UpdateConstraint(relation_constraints_[i], relations_[i].mean,
                             WeighedInformation(relations_[i]));
  }
}

void JointAdjustment::Solve(bool is_last) {
  const SessionOptions& options = session_->options();
  const SolveReport report =
      is_last ? session_->SolveGlobal()
              : session_->SolveGlobal(
                    std::max(kRoundTolerance, options.function_tolerance),
                    options.initial_trust_region_radius);
  if (!report.usable) {
    throw PLUMBLINE_ERROR("joint adjustment failed: " + report.message,
                          "a usable solution");
  }
}

void JointAdjustment::EstimateVariances() {
  std::vector<double> of_motions;
  for (const auto& [id, information] : motions_) {
    const Constraint& motion = graph_->GetConstraint(id);
    of_motions.push_back(ChiSquare(*graph_, motion.features[0],
                                   motion.features[1], motion.expected,
                                   information));
  }
  std::vector<double> of_relations;
  for (const ScanRelation& relation : relations_) {
    of_relations.push_back(ChiSquare(*graph_, poses_[relation.from],
                                     poses_[relation.to], relation.mean,
                                     relation.information));
  }
  std::vector<double> of_votes;
  std::set<FeatureId> walls;
  for (const ConstraintId id : votes_) {
    const Constraint& vote = graph_->GetConstraint(id);
    of_votes.push_back(vote_factor_ * VoteChiSquare(*graph_, vote));
    walls.insert(vote.features[1]);
  }
  const auto rows = static_cast<double>(
      3 * (of_motions.size() + of_relations.size()) + 2 * of_votes.size());
  if (rows == 0.0) return;
  // Odometry alone ties the poses, and one vote each the walls.
  const double redundancy =
      static_cast<double>(3 * of_relations.size() +
                          2 * (of_votes.size() - walls.size())) /
      rows;
  const auto factor = [&](std::vector<double> chi_squares, double expected) {
    return VarianceFactor(std::move(chi_squares), expected, redundancy,
                          kPriorLinks);
  };
  const auto within_bounds = [&](double value) {
    return std::clamp(value, options_.min_variance_factor,
                      options_.max_variance_factor);
  };
  motion_factor_ = within_bounds(factor(std::move(of_motions), kMedianOf3));
  relation_factor_ = within_bounds(factor(std::move(of_relations), kMedianOf3));
  const double shown = factor(std::move(of_votes), kMedianOf2);
  const double vote_factor = within_bounds(shown);
  vote_excess_ = std::max(
      1.0, vote_factor / std::max(shown, options_.min_reported_factor));
  for (const ConstraintId id : votes_) {
    const Constraint& vote = graph_->GetConstraint(id);
    const Eigen::VectorXd expected = vote.expected;
    const Eigen::MatrixXd information =
        vote.information * (vote_factor_ / vote_factor);
    graph_->UpdateConstraint(id, expected, information);
  }
  vote_factor_ = vote_factor;
  const SolveStop solve_stop(session_, stop_);
  for (const auto& [id, information] : motions_) {
    const Eigen::VectorXd expected = graph_->GetConstraint(id).expected;
    graph_->UpdateConstraint(id, expected, information / motion_factor_);
  }
  Reweigh();
  Solve(/*is_last=*/true);
}

double JointAdjustment::Misfit() const {
  const double scale = options_.loss_scale * options_.loss_scale;
  double squares = 0.0;
  for (const auto& [id, information] : motions_) {
    const Constraint& motion = graph_->GetConstraint(id);
    squares += scale * std::log1p(ChiSquare(*graph_, motion.features[0],
                                            motion.features[1], motion.expected,
                                            information) /
                                  scale);
  }
  for (const ScanRelation& relation : relations_) {
    squares += scale * std::log1p(ChiSquare(*graph_, poses_[relation.from],
                                            poses_[relation.to], relation.mean,
                                            relation.information) /
                                  scale);
  }
  return squares;
}

bool JointAdjustment::FitsBetterThan(double misfit,
                                     std::int64_t num_relations) const {
  const double scale = options_.loss_scale * options_.loss_scale;
  const double outlier = scale * std::log1p(kOutlierOf3 / scale);
  const auto more = static_cast<double>(num_relations - this->num_relations());
  return Misfit() + outlier * more < misfit;
}

void ReportVoteVariances(double excess, const Registry& registry,
                         Graph* graph) {
  if (excess == 1.0) return;
  const RelationType& relation = registry.GetRelation(kVoteRelation);
  for (const Constraint* vote : std::as_const(*graph).Constraints()) {
    if (vote->type != &relation || vote->state != ConstraintState::kLive) {
      continue;
    }
    const Eigen::VectorXd expected = vote->expected;
    const Eigen::MatrixXd information = excess * vote->information;
    graph->UpdateConstraint(vote->id, expected, information);
  }
}

void JointAdjustment::Adjust() {
  const SolveStop solve_stop(session_, stop_);
  for (int pass = 0; pass < options_.max_passes; ++pass) {
    const std::vector<Pose2> before = PlacePoses();
    for (int round = 0; round < options_.rounds; ++round) {
      if (stop_ && stop_()) return;
      // Walls as they were given come first.
      if (pass > 0 || round > 0) {
        MoveWallJunctions(options_.junctions, graph_);
      }
      Vote();
      Reweigh();
      Solve(/*is_last=*/false);
    }
    const std::vector<Pose2> after = PlacePoses();
    double moved = 0.0;
    for (std::size_t p = 0; p < after.size(); ++p) {
      moved = std::max(moved, (after[p] - before[p]).head<2>().norm());
    }
    if (moved <= options_.settled_distance || (stop_ && stop_())) break;
    if (pass + 1 < options_.max_passes) Match();
  }
  // What lies between two matchings need not be exact.
  if (!(stop_ && stop_())) Solve(/*is_last=*/true);
  DropWallsWithoutVotes();
}

void JointAdjustment::DropWallsWithoutVotes() {
  Transaction change;
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    if (!feature->type->Is(FeatureRole::kWall) || feature->level != 0 ||
        feature->fixed) {
      continue;
    }
    bool is_held = false;
    for (const ConstraintId id : graph_->ConstraintsOf(feature->id)) {
      const Constraint& constraint = std::as_const(*graph_).GetConstraint(id);
      // What holds it along itself holds nothing else.
      is_held = is_held ||
                (constraint.state == ConstraintState::kLive &&
                 constraint.kind == ConstraintClass::kMeasurement &&
                 constraint.information.trace() > constraint.information(0, 0));
    }
    if (is_held) continue;
    for (const ConstraintId id : graph_->ConstraintsOf(feature->id)) {
      change.RemoveConstraint(id);
    }
    change.RemoveFeature(feature->id);
  }
  if (!change.empty()) graph_->Apply(std::move(change));
}

std::vector<Pose2> JointAdjustment::PlacePoses() const {
  std::vector<Pose2> poses;
  poses.reserve(poses_.size());
  for (const FeatureId id : poses_) {
    poses.push_back(PoseOf(graph_->GetFeature(id)));
  }
  return poses;
}

std::vector<Pose2> JointAdjustment::KeyPoses() const {
  return KeyPosesOfPlaces(*graph_, poses_, records_, options_.place_stride);
}

std::vector<Pose2> KeyPosesOfPlaces(const Graph& graph,
                                    const std::vector<FeatureId>& places,
                                    const std::vector<KeyScanRecord>& records,
                                    int place_stride) {
  const std::vector<std::size_t> begins = PlaceBegins(records, place_stride);
  if (begins.size() != places.size()) {
    throw PLUMBLINE_ERROR(std::to_string(places.size()) + " places",
                          std::to_string(begins.size()));
  }
  std::vector<Pose2> keys(records.size(), Pose2::Zero());
  for (std::size_t p = 0; p < places.size(); ++p) {
    const Pose2 place = PoseOf(graph.GetFeature(places[p]));
    const std::size_t begin = begins[p];
    const bool has_next = p + 1 < places.size();
    const std::size_t end = has_next ? begins[p + 1] : records.size();
    Pose2 relative = Pose2::Zero();
    for (std::size_t k = begin; k < end; ++k) {
      if (k > begin) relative = Compose(relative, records[k].motion.mean);
      keys[k] = relative;
    }
    Pose2 missing = Pose2::Zero();
    if (has_next && FollowsTheOneBefore(records[end])) {
      missing =
          Between(Compose(place, Compose(relative, records[end].motion.mean)),
                  PoseOf(graph.GetFeature(places[p + 1])));
    }
    for (std::size_t k = begin; k < end; ++k) {
      const double share = static_cast<double>(k - begin) / (end - begin);
      keys[k] = Compose(Compose(place, keys[k]), Pose2(share * missing));
    }
  }
  return keys;
}

}  // namespace plumbline
