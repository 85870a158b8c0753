#ifndef PLUMBLINE_CORE_BREAK_LOG_H_
#define PLUMBLINE_CORE_BREAK_LOG_H_

#include <plumbline/core/graph.h>

#include <Eigen/Core>
#include <map>

namespace plumbline {

/// How a structure constraint was broken.
struct BreakRecord {
  /// Iteration of EM on the whole graph (EmPhase::iteration) in which it was; 0
  /// before the first one.
  int iteration = 0;
  /// Its error f(x) (-) u in the units of its relation at the state that it was
  /// broken at; not finite where it could not be evaluated.
  Eigen::VectorXd error;
};

/// Broken constraints by id: what is broken stays in the graph, but the state
/// moves on, so that the last state does not tell why.
using BreakRecords = std::map<ConstraintId, BreakRecord>;

/// Listens to a graph and keeps a record of every structure constraint that is
/// broken. What is removed from the graph later keeps its record; an id that is
/// handed out anew and broken again gets a new one.
class BreakLog final : public GraphListener {
 public:
  /// Listens to this graph from now on; the graph must outlive the log, or
  /// Detach be called before.
  void Attach(Graph* graph);
  void Detach();
  ~BreakLog() override { Detach(); }
  BreakLog() = default;
  BreakLog(const BreakLog&) = delete;
  BreakLog& operator=(const BreakLog&) = delete;

  /// What is broken from now on is broken in this iteration.
  void SetIteration(int iteration) { iteration_ = iteration; }

  /// Of all constraints that were broken, by id.
  const BreakRecords& records() const { return records_; }
  /// The same, to be restored from a state.
  BreakRecords& records() { return records_; }

  void OnFeatureAdded(const Feature& /*feature*/) override {}
  void OnFeatureRemoved(const Feature& /*feature*/) override {}
  void OnConstraintAdded(const Constraint& /*constraint*/) override {}
  void OnConstraintChanged(const Constraint& /*constraint*/) override {}
  void OnConstraintRetired(const Constraint& constraint) override;

 private:
  Graph* graph_ = nullptr;
  int iteration_ = 0;
  BreakRecords records_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_BREAK_LOG_H_
