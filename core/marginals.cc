#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/disjoint_sets.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/information_factor.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Constraints that one thread linearizes at a time.
constexpr std::size_t kConstraintsAtOnce = 256;

std::string Describe(const Feature& feature) {
  return feature.type->name + " " + std::to_string(feature.id);
}

// As SolverSession::Linearize, with the weight of the last E-step.
LinearizedConstraint LinearizeByDelta(const Graph& graph,
                                      const Constraint& constraint) {
  const auto cost =
      MakeCost(constraint, SqrtInformation(constraint.information),
               FeaturesOf(graph, constraint));
  LinearizedConstraint linearized = Linearize(graph, constraint, *cost);
  if (constraint.kind != ConstraintClass::kStructure) return linearized;
  return Weighted(std::move(linearized),
                  std::sqrt(std::max(constraint.delta, kDeltaFloor)));
}

// Whether the parameters are a frame of the plane and nothing else.
bool IsFrame(const FeatureType& type) {
  return type.traits.leading == Leading::kFrame && type.size == 3;
}

}  // namespace

struct Marginals::Impl {
  // What is known of a feature.
  struct Entry {
    std::string name;
    bool is_pose = false;
    int size = 0;
    // Held constant: fixed, or the gauge.
    bool is_constant = false;
    bool has_constraint = false;
    // First row in the normal matrix, and how many.
    int column = -1;
    int tangent_size = 0;
    // Parameters by tangent space: the derivative of Plus at zero.
    Eigen::MatrixXd lift;
    Pose2 pose = Pose2::Zero();
    std::size_t part = 0;

    // In the normal matrix; none when it is constant.
    InformationRows rows() const {
      if (column < 0) return {};
      return {column, tangent_size};
    }
  };

  using Linearizer = std::function<LinearizedConstraint(const Constraint&)>;

  Impl(const Graph& graph, const MarginalsOptions& options,
       const Linearizer& linearize) {
    const std::vector<FeatureId> ids = AddEntries(graph, options.features);
    const std::vector<const Constraint*> constraints =
        ConstraintsAmong(graph, ids);
    FindParts(graph, ids, constraints, options.hold_gauge);
    Factorize(linearize, ids, constraints);
  }

  // Adds the features of the graph or scope, ascending; returns their ids.
  std::vector<FeatureId> AddEntries(const Graph& graph,
                                    const std::vector<FeatureId>* scope) {
    std::vector<FeatureId> ids;
    if (scope == nullptr) {
      for (const Feature* feature : graph.Features()) {
        ids.push_back(feature->id);
      }
    } else {
      ids = *scope;
      std::sort(ids.begin(), ids.end());
      ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    }
    entries.resize(static_cast<std::size_t>(graph.feature_id_end()));
    for (const FeatureId id : ids) {
      const Feature& feature = graph.GetFeature(id);
      auto entry = std::make_unique<Entry>();
      entry->name = Describe(feature);
      entry->size = feature.type->size;
      entry->is_constant = feature.fixed;
      entry->is_pose = IsFrame(*feature.type);
      if (entry->is_pose) entry->pose = Eigen::Vector3d(feature.data());
      entry->tangent_size = entry->size;
      if (feature.type->make_manifold) {
        const auto manifold = feature.type->make_manifold();
        entry->tangent_size = manifold->TangentSize();
        Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>
            lift(entry->size, entry->tangent_size);
        if (!manifold->PlusJacobian(feature.data(), lift.data())) {
          throw PLUMBLINE_ERROR(entry->name + " has no tangent space",
                                "a state in which its manifold has one");
        }
        entry->lift = lift;
      } else {
        entry->lift = Eigen::MatrixXd::Identity(entry->size, entry->size);
      }
      entries[static_cast<std::size_t>(id)] = std::move(entry);
    }
    return ids;
  }

  // The live constraints among the entries, ascending.
  std::vector<const Constraint*> ConstraintsAmong(
      const Graph& graph, const std::vector<FeatureId>& ids) {
    std::vector<ConstraintId> constraint_ids;
    for (const FeatureId id : ids) {
      const std::vector<ConstraintId>& on = graph.ConstraintsOf(id);
      constraint_ids.insert(constraint_ids.end(), on.begin(), on.end());
    }
    std::sort(constraint_ids.begin(), constraint_ids.end());
    constraint_ids.erase(
        std::unique(constraint_ids.begin(), constraint_ids.end()),
        constraint_ids.end());
    std::vector<const Constraint*> constraints;
    for (const ConstraintId id : constraint_ids) {
      const Constraint& constraint = graph.GetConstraint(id);
      if (constraint.state == ConstraintState::kLive &&
          std::all_of(
              constraint.features.begin(), constraint.features.end(),
              [this](FeatureId feature) { return Find(feature) != nullptr; })) {
        constraints.push_back(&constraint);
      }
    }
    return constraints;
  }

  // Connected parts and what ties them to the plane.
  void FindParts(const Graph& graph, const std::vector<FeatureId>& ids,
                 const std::vector<const Constraint*>& constraints,
                 bool hold_gauge) {
    DisjointSets parts(entries.size());
    has_gauge.assign(entries.size(), false);
    for (const Constraint* constraint : constraints) {
      const std::vector<FeatureId>& features = constraint->features;
      for (const FeatureId id : features) {
        parts.Join(static_cast<std::size_t>(features[0]),
                   static_cast<std::size_t>(id));
        entries[static_cast<std::size_t>(id)]->has_constraint = true;
      }
    }
    for (const FeatureId id : ids) {
      Entry& entry = *entries[static_cast<std::size_t>(id)];
      entry.part = parts.Find(static_cast<std::size_t>(id));
      if (entry.is_constant) has_gauge[entry.part] = true;
    }
    for (const Constraint* constraint : constraints) {
      if (constraint->features.size() == 1) {
        has_gauge[parts.Find(
            static_cast<std::size_t>(constraint->features[0]))] = true;
      }
    }
    // A part without gauge is held all the same, so that what is relative can
    // be asked for.
    std::map<std::size_t, FeatureId> held;
    for (const FeatureId id : ids) {
      const Entry& entry = *entries[static_cast<std::size_t>(id)];
      if (!entry.has_constraint || has_gauge[entry.part]) continue;
      const auto [lowest, is_new] = held.emplace(entry.part, id);
      if (!is_new &&
          graph.GetFeature(id).level < graph.GetFeature(lowest->second).level) {
        lowest->second = id;
      }
    }
    for (const auto& [part, id] : held) {
      entries[static_cast<std::size_t>(id)]->is_constant = true;
      if (hold_gauge) has_gauge[part] = true;
    }
  }

  // J' J of the constraints in the tangent spaces of the features.
  void Factorize(const Linearizer& linearize, const std::vector<FeatureId>& ids,
                 const std::vector<const Constraint*>& constraints) {
    for (const FeatureId id : ids) {
      Entry& entry = *entries[static_cast<std::size_t>(id)];
      if (entry.is_constant || !entry.has_constraint) continue;
      entry.column = columns;
      columns += entry.tangent_size;
    }
    if (columns == 0) return;
    using Triplets = std::vector<Eigen::Triplet<double>>;
    std::vector<Triplets> parts((constraints.size() + kConstraintsAtOnce - 1) /
                                kConstraintsAtOnce);
    ParallelFor(parts.size(), ThreadsHere(), [&](std::size_t part) {
      const std::size_t begin = part * kConstraintsAtOnce;
      const std::size_t end =
          std::min(constraints.size(), begin + kConstraintsAtOnce);
      for (std::size_t k = begin; k < end; ++k) {
        AddNormal(*constraints[k], linearize(*constraints[k]), &parts[part]);
      }
    });
    Triplets triplets;
    for (const Triplets& part : parts) {
      triplets.insert(triplets.end(), part.begin(), part.end());
    }
    Eigen::SparseMatrix<double> normal(columns, columns);
    normal.setFromTriplets(triplets.begin(), triplets.end());
    factor.Factorize(std::move(normal), kUndeterminedVariance);
  }

  // The share of a constraint in the lower triangle of the normal matrix.
  void AddNormal(const Constraint& constraint,
                 const LinearizedConstraint& linearized,
                 std::vector<Eigen::Triplet<double>>* triplets) const {
    std::vector<Eigen::MatrixXd> jacobians;
    for (std::size_t i = 0; i < constraint.features.size(); ++i) {
      jacobians.push_back(linearized.jacobians[i] *
                          Find(constraint.features[i])->lift);
    }
    for (std::size_t i = 0; i < jacobians.size(); ++i) {
      const Entry& a = *Find(constraint.features[i]);
      if (a.column < 0) continue;
      for (std::size_t j = 0; j < jacobians.size(); ++j) {
        const Entry& b = *Find(constraint.features[j]);
        if (b.column < 0 || b.column > a.column) continue;
        const Eigen::MatrixXd block = jacobians[i].transpose() * jacobians[j];
        for (Eigen::Index r = 0; r < block.rows(); ++r) {
          for (Eigen::Index c = 0; c < block.cols(); ++c) {
            const int row = a.column + static_cast<int>(r);
            const int column = b.column + static_cast<int>(c);
            if (row >= column) {
              triplets->emplace_back(row, column, block(r, c));
            }
          }
        }
      }
    }
  }

  const Entry* Find(FeatureId id) const {
    if (id < 0 || static_cast<std::size_t>(id) >= entries.size()) {
      return nullptr;
    }
    return entries[static_cast<std::size_t>(id)].get();
  }

  // Of a feature with something to say about it.
  const Entry& Get(FeatureId id) const {
    const Entry* entry = Find(id);
    if (entry == nullptr) {
      throw PLUMBLINE_ERROR("no feature " + std::to_string(id),
                            "a feature of the graph, or of the scope");
    }
    if (!entry->is_constant && !entry->has_constraint) {
      throw PLUMBLINE_ERROR(entry->name + " has no covariance",
                            "a live constraint on it");
    }
    return *entry;
  }

  const Entry& GetWithGauge(FeatureId id) const {
    const Entry& entry = Get(id);
    if (!has_gauge[entry.part]) {
      throw PLUMBLINE_ERROR("the gauge of " + entry.name +
                                " is not fixed: nothing ties it, or "
                                "what it is connected with, to the plane",
                            "a fixed feature (FIX) or a prior there");
    }
    return entry;
  }

  // Throws unless there is something to say about `to` seen from `from`.
  void CheckRelative(FeatureId from, FeatureId to) const {
    const Entry& a = Get(from);
    const Entry& b = Get(to);
    for (const Entry* entry : {&a, &b}) {
      if (!entry->is_pose) {
        throw PLUMBLINE_ERROR(entry->name + " has no relative pose",
                              "a feature with the parameters x, y, theta");
      }
    }
    // Parts that are both tied to the plane are connected by it.
    if (a.part != b.part && !(has_gauge[a.part] && has_gauge[b.part])) {
      throw PLUMBLINE_ERROR("nothing connects " + a.name + " and " + b.name,
                            "features of one connected part");
    }
  }

  // sum of B_i Cov(i, j) B_j' over features and their Jacobians (rows x
  // parameters).
  Eigen::MatrixXd Propagate(
      const std::vector<std::pair<const Entry*, Eigen::MatrixXd>>& terms)
      const {
    const Eigen::Index rows = terms.front().second.rows();
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(columns, rows);
    for (const auto& [entry, jacobian] : terms) {
      if (entry->column < 0) continue;
      right.middleRows(entry->column, entry->tangent_size) +=
          (jacobian * entry->lift).transpose();
    }
    if (columns == 0) return Eigen::MatrixXd::Zero(rows, rows);
    std::vector<InformationRows> at;
    for (const auto& term : terms) at.push_back(term.first->rows());
    const Eigen::MatrixXd solved = factor.SolveAt(right, at, at);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(rows, rows);
    for (const auto& [entry, jacobian] : terms) {
      if (entry->column < 0) continue;
      covariance += jacobian * entry->lift *
                    solved.middleRows(entry->column, entry->tangent_size);
    }
    return 0.5 * (covariance + covariance.transpose());
  }

  // Covariance of a feature; without a gauge, of its place relative to what is
  // held in its part.
  const Eigen::MatrixXd& Block(FeatureId id) {
    const Entry& entry = Get(id);
    const auto found = blocks.find(id);
    if (found != blocks.end()) return found->second;
    const Eigen::MatrixXd identity =
        Eigen::MatrixXd::Identity(entry.size, entry.size);
    return blocks.emplace(id, Propagate({{&entry, identity}})).first->second;
  }

  void ComputeBlocks(const std::vector<FeatureId>& ids) {
    std::vector<FeatureId> missing;
    for (const FeatureId id : ids) {
      if (Get(id).column >= 0 && blocks.count(id) == 0) {
        missing.push_back(id);
      }
    }
    // The pass over the factor costs about as much as a few solves for each
    // column of a typical elimination front.
    constexpr std::size_t kFewFeatures = 10;
    if (missing.size() < kFewFeatures) return;
    std::vector<InformationRows> rows;
    for (const FeatureId id : missing) rows.push_back(Find(id)->rows());
    const std::vector<Eigen::MatrixXd> tangents = factor.InverseBlocks(rows);
    for (std::size_t i = 0; i < missing.size(); ++i) {
      const Entry& entry = *Find(missing[i]);
      blocks.emplace(missing[i],
                     entry.lift * tangents[i] * entry.lift.transpose());
    }
  }

  // By feature id; null for those outside the scope.
  std::vector<std::unique_ptr<Entry>> entries;
  // By root of a part.
  std::vector<bool> has_gauge;
  // Of the normal matrix.
  int columns = 0;
  InformationFactor factor;
  // Covariances that were asked for.
  std::map<FeatureId, Eigen::MatrixXd> blocks;
};

Marginals::Marginals(const Graph& graph, const SolverSession& session,
                     const MarginalsOptions& options)
    : impl_(std::make_unique<Impl>(graph, options,
                                   [&](const Constraint& constraint) {
                                     return session.Linearize(constraint);
                                   })) {}

Marginals::Marginals(const Graph& graph, const MarginalsOptions& options)
    : impl_(std::make_unique<Impl>(graph, options,
                                   [&](const Constraint& constraint) {
                                     return LinearizeByDelta(graph, constraint);
                                   })) {}

Marginals::~Marginals() = default;
Marginals::Marginals(Marginals&&) noexcept = default;
Marginals& Marginals::operator=(Marginals&&) noexcept = default;

Eigen::MatrixXd Marginals::Covariance(FeatureId id) {
  impl_->GetWithGauge(id);
  return impl_->Block(id);
}

Eigen::MatrixXd Marginals::JointCovariance(const std::vector<FeatureId>& ids) {
  Eigen::Index size = 0;
  for (const FeatureId id : ids) size += impl_->GetWithGauge(id).size;
  std::vector<std::pair<const Impl::Entry*, Eigen::MatrixXd>> terms;
  Eigen::Index row = 0;
  for (const FeatureId id : ids) {
    const Impl::Entry& entry = impl_->GetWithGauge(id);
    Eigen::MatrixXd selection = Eigen::MatrixXd::Zero(size, entry.size);
    selection.middleRows(row, entry.size).setIdentity();
    row += entry.size;
    terms.emplace_back(&entry, std::move(selection));
  }
  if (terms.empty()) return Eigen::MatrixXd(0, 0);
  return impl_->Propagate(terms);
}

Eigen::MatrixXd Marginals::PropagatedCovariance(
    const std::vector<FeatureId>& ids,
    const std::vector<Eigen::MatrixXd>& jacobians) {
  bool fits = !ids.empty() && ids.size() == jacobians.size();
  std::vector<std::pair<const Impl::Entry*, Eigen::MatrixXd>> terms;
  for (std::size_t i = 0; fits && i < ids.size(); ++i) {
    const Impl::Entry& entry = impl_->Get(ids[i]);
    fits = jacobians[i].rows() == jacobians[0].rows() &&
           jacobians[i].cols() == entry.size;
    terms.emplace_back(&entry, jacobians[i]);
  }
  if (!fits) {
    throw PLUMBLINE_ERROR("features and Jacobians do not fit",
                          "one of rows x size for each, of at least one");
  }
  return impl_->Propagate(terms);
}

Eigen::Matrix3d Marginals::RelativeCovariance(FeatureId from, FeatureId to) {
  impl_->CheckRelative(from, to);
  if (from == to) return Eigen::Matrix3d::Zero();
  const Impl::Entry& a = impl_->Get(from);
  const Impl::Entry& b = impl_->Get(to);
  return impl_->Propagate({{&a, BetweenJacobianFirst(a.pose, b.pose)},
                           {&b, BetweenJacobianSecond(a.pose)}});
}

std::vector<Eigen::Matrix3d> Marginals::RelativeCovariances(
    FeatureId from, const std::vector<FeatureId>& to) {
  for (const FeatureId id : to) impl_->CheckRelative(from, id);
  impl_->ComputeBlocks(to);
  const Impl::Entry& a = impl_->Get(from);
  using ThreeColumns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  ThreeColumns columns;
  Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
  if (a.column >= 0) {
    ThreeColumns right = ThreeColumns::Zero(impl_->columns, 3);
    right.middleRows(a.column, a.tangent_size) = a.lift.transpose();
    std::vector<InformationRows> wanted = {a.rows()};
    for (const FeatureId id : to) wanted.push_back(impl_->Get(id).rows());
    columns = impl_->factor.SolveAt(right, {a.rows()}, wanted);
    own = a.lift * columns.middleRows(a.column, a.tangent_size);
  }
  std::vector<Eigen::Matrix3d> covariances;
  covariances.reserve(to.size());
  for (const FeatureId id : to) {
    const Impl::Entry& b = impl_->Get(id);
    if (id == from) {
      covariances.push_back(Eigen::Matrix3d::Zero());
      continue;
    }
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
    if (a.column >= 0 && b.column >= 0) {
      cross = b.lift * columns.middleRows(b.column, b.tangent_size);
    }
    const Eigen::Matrix3d first = BetweenJacobianFirst(a.pose, b.pose);
    const Eigen::Matrix3d second = BetweenJacobianSecond(a.pose);
    const Eigen::Matrix3d mixed = second * cross * first.transpose();
    const Eigen::Matrix3d covariance =
        first * own * first.transpose() +
        second * impl_->Block(id) * second.transpose() + mixed +
        mixed.transpose();
    covariances.push_back(0.5 * (covariance + covariance.transpose()));
  }
  return covariances;
}

void Marginals::Compute(const std::vector<FeatureId>& ids) {
  for (const FeatureId id : ids) impl_->GetWithGauge(id);
  impl_->ComputeBlocks(ids);
}

bool Marginals::IsDetermined(FeatureId id) {
  return Covariance(id).diagonal().maxCoeff() < 1e-2 * kUndeterminedVariance;
}

}  // namespace plumbline
