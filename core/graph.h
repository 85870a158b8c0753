#ifndef PLUMBLINE_CORE_GRAPH_H_
#define PLUMBLINE_CORE_GRAPH_H_

#include <plumbline/core/constraint.h>
#include <plumbline/core/feature.h>
#include <plumbline/core/transaction.h>

#include <Eigen/Core>
#include <map>
#include <memory>
#include <vector>

namespace plumbline {

/// A listener that is told of every change once applied, in the order of ids.
class GraphListener {
 public:
  virtual ~GraphListener() = default;
  virtual void OnFeatureAdded(const Feature& feature) = 0;
  /// The feature is still valid during the call.
  virtual void OnFeatureRemoved(const Feature& feature) = 0;
  virtual void OnConstraintAdded(const Constraint& constraint) = 0;
  /// Its expected value or information changed.
  virtual void OnConstraintChanged(const Constraint& constraint) = 0;
  /// It was broken or removed (a removed one is still valid during the call).
  virtual void OnConstraintRetired(const Constraint& constraint) = 0;
};

/// Features and constraints. Changed by transactions only; iteration is in the
/// order of ids; addresses of features and constraints are stable. Not thread
/// safe.
class Graph {
 public:
  Graph() = default;
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  /// Applies a transaction whole or not at all. Throws Error and leaves the
  /// graph as it was when an id is unknown, a constraint's features do not fit
  /// its relation, sizes disagree, a number is not finite, the information is
  /// not symmetric positive semidefinite, a level is not in [0, kMaxLevel], or
  /// a feature to be removed is used by a live constraint that stays (the
  /// message names both); a transaction that was to be moved then stays as it
  /// was.
  TransactionResult Apply(Transaction&& transaction);
  /// The same with a copy.
  TransactionResult Apply(const Transaction& transaction) {
    return Apply(Transaction(transaction));
  }

  /// Fills an empty graph with what another one had, under the same ids:
  /// features and constraints with their ids, ascending, live and broken, and
  /// the ends of both (feature_id_end, constraint_id_end). What comes next gets
  /// the same ids as it would have in the other graph. Throws Error, and leaves
  /// the graph as it was, when the graph is not new, ids do not fit, or as
  /// Apply does.
  void Restore(std::vector<Feature> features,
               std::vector<Constraint> constraints, FeatureId feature_end,
               ConstraintId constraint_end);

  /// Gives a live measurement a new expected value and information (the robot's
  /// links while it moves). Listeners hear of it when it differs from what it
  /// had. Throws Error as Apply does.
  void UpdateConstraint(ConstraintId id, const Eigen::VectorXd& expected,
                        const Eigen::MatrixXd& information);

  /// Look-ups. Find* return null for ids that are not (or no longer) there,
  /// Get* throw Error.
  const Feature* FindFeature(FeatureId id) const;
  Feature* FindFeature(FeatureId id);
  const Constraint* FindConstraint(ConstraintId id) const;
  Constraint* FindConstraint(ConstraintId id);
  const Feature& GetFeature(FeatureId id) const;
  Feature& GetFeature(FeatureId id);
  const Constraint& GetConstraint(ConstraintId id) const;
  Constraint& GetConstraint(ConstraintId id);

  /// Ids of the constraints on a feature, live and broken, ascending.
  const std::vector<ConstraintId>& ConstraintsOf(FeatureId id) const;

  /// All features and constraints in the order of ids (broken ones included).
  /// Pointers are never null; the vectors are made anew at each call, so hold
  /// on to them in a loop.
  std::vector<const Feature*> Features() const;
  std::vector<Feature*> MutableFeatures();
  std::vector<const Constraint*> Constraints() const;
  std::vector<Constraint*> MutableConstraints();

  /// Ids of the virtual features of a level, ascending: few, whatever the size
  /// of the graph. A feature's level and whether it is virtual must not be
  /// changed once it is in the graph.
  const std::vector<FeatureId>& VirtualFeatures(int level) const;
  /// The levels that have virtual features, ascending.
  std::vector<int> VirtualLevels() const;

  /// Present numbers; of constraints, broken ones included.
  std::size_t num_features() const { return num_features_; }
  std::size_t num_constraints() const { return num_constraints_; }
  /// One past the largest id ever handed out.
  FeatureId feature_id_end() const {
    return static_cast<FeatureId>(features_.size());
  }
  ConstraintId constraint_id_end() const {
    return static_cast<ConstraintId>(constraints_.size());
  }

  /// Listeners must outlive the graph or be removed. Not owned.
  void AddListener(GraphListener* listener);
  void RemoveListener(GraphListener* listener);

 private:
  struct Node {
    Feature feature;
    std::vector<ConstraintId> constraints;
  };
  struct Removals;
  struct Retired;

  // The steps of Apply: these two throw, the others must not.
  Removals CheckRemovals(const Transaction& transaction) const;
  void CheckAddition(const Constraint& constraint,
                     const std::vector<Feature>& added,
                     const Removals& removals) const;
  Retired Retire(const Removals& removals);
  TransactionResult Add(Transaction* transaction);
  void Tell(const Retired& retired, const TransactionResult& added) const;

  std::vector<std::unique_ptr<Node>> features_;
  std::vector<std::unique_ptr<Constraint>> constraints_;
  std::map<int, std::vector<FeatureId>> virtual_features_;
  std::size_t num_features_ = 0;
  std::size_t num_constraints_ = 0;
  std::vector<GraphListener*> listeners_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_GRAPH_H_
