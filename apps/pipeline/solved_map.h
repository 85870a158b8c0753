#ifndef PLUMBLINE_PIPELINE_SOLVED_MAP_H_
#define PLUMBLINE_PIPELINE_SOLVED_MAP_H_

#include <plumbline/core/break_log.h>
#include <plumbline/core/em.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/hierarchy.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/session.h>
#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>

#include <memory>
#include <vector>

namespace plumbline {

/// A graph and what solves it while its log is worked on: the session and EM,
/// which know nothing but what is in the graph and are made anew with every
/// stage, and what is kept over all of them, the trace and the log of breaks.
class SolvedMap {
 public:
  /// An empty graph, with a session but no detectors. The registry must outlive
  /// the map.
  SolvedMap(const Registry& registry, const SessionOptions& session,
            const EmOptions& em);
  ~SolvedMap();
  SolvedMap(const SolvedMap&) = delete;
  SolvedMap& operator=(const SolvedMap&) = delete;

  /// The graph as it stands. References end with Discard, StartOver and
  /// RestoreGraph; those to the session and EM with Renew as well.
  Graph& graph() { return *graph_; }
  /// The same, to be read.
  const Graph& graph() const { return *graph_; }
  /// The session on this graph.
  SolverSession& session() { return *session_; }
  /// The same, to be read.
  const SolverSession& session() const { return *session_; }
  /// EM on this graph.
  EmOrchestrator& em() { return *em_; }

  /// Makes the session and EM anew, which is not traced until Trace.
  void Renew(Hierarchy detectors = Hierarchy());
  /// Makes EM alone anew, with these options in place of its own, and traces
  /// it.
  void ReplaceEm(Hierarchy detectors, const EmOptions& options);
  /// Keeps the phases of the present EM from now on; their iterations count on
  /// from those of earlier ones.
  void Trace();

  /// Another graph, empty, without a session or EM until Renew. Pointers to the
  /// graph that there was are void. StartOver also forgets what was broken.
  void Discard();
  void StartOver();
  /// Takes everything out of the graph, which stays the same one.
  void Clear();

  /// Moves all features rigidly. False, and nothing is done, where something
  /// cannot be moved (rigid_motion.h): a relation to the map frame, a plug-in's
  /// feature. The session has to be renewed.
  bool Move(const Pose2& by);

  /// The graph alone, as it stands.
  void WriteGraph(StateWriter* state) const;
  /// Another graph, with what WriteGraph wrote; session and EM are made anew.
  void RestoreGraph(StateReader* state);

  /// Sums over every EM so far.
  EmReport totals() const;
  /// Phases that were traced, of every EM so far.
  const std::vector<EmPhase>& trace() const { return trace_; }
  const BreakRecords& breaks() const { return break_log_.records(); }

  /// Everything but the session and EM. What is read goes into the graph that
  /// is there, which must be empty.
  void ExchangeState(StateWriter& state);
  void ExchangeState(StateReader& state);

 private:
  // Adds the totals of the present EM to those of the ones before.
  void CountEm();
  void DropEm();

  const Registry& registry_;
  SessionOptions session_options_;
  EmOptions em_options_;
  std::unique_ptr<Graph> graph_;
  // Of what is broken in the graph.
  BreakLog break_log_;
  std::unique_ptr<SolverSession> session_;
  std::unique_ptr<EmOrchestrator> em_;
  // Sums over the orchestrators that were there before.
  EmReport em_before_;
  std::vector<EmPhase> trace_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_SOLVED_MAP_H_
