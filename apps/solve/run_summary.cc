#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/run_summary.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/error.h>
#include <plumbline/core/stopwatch.h>
#include <plumbline/core/utf8.h>
#include <plumbline/outputs/marginals_output.h>

#include <filesystem>
#include <string>
#include <vector>

namespace plumbline {

Summary BeginSummary() {
  Summary summary;
  summary.input = FLAGS_input;
  summary.seed = FLAGS_seed;
  summary.flags = ChangedFlags();
  return summary;
}

void Summarize(const CostReport& initial, const CostReport& last,
               const EmReport& em, Summary* summary) {
  summary->initial_cost = initial.total();
  summary->measurement_cost = last.measurement;
  summary->structure_cost = last.structure;
  summary->em_iterations = em.iterations;
  summary->em_termination = em.termination;
  summary->detect_seconds = em.detect_seconds;
  summary->solve_seconds = em.solve_seconds;
}

void TellPhase(const EmPhase& phase) {
  Detail("EM %d %s: cost %.6g + %.6g, %d structure constraints, %d broken",
         phase.iteration, phase.phase.c_str(), phase.cost.measurement,
         phase.cost.structure, phase.structure_constraints,
         phase.broken_constraints);
  for (const auto& [detector, counts] : phase.detections) {
    std::string list;
    for (const auto& [name, number] : counts) {
      if (number == 0) continue;
      list += (list.empty() ? "" : ", ") + name + " " + std::to_string(number);
    }
    if (!list.empty()) Detail("  %s: %s", detector.c_str(), list.c_str());
  }
}

void TakeMarginals(const SolverSession* session, SolveOutcome* outcome) {
  const Stopwatch watch;
  std::vector<std::string> missing;
  try {
    outcome->covariances = ComputeMarginals(
        *outcome->graph, session,
        ParseMarginalsSelection(FLAGS_marginals, *outcome->registry),
        FLAGS_marginals_hold_gauge, &missing);
  } catch (const Error& error) {
    // The map stands without them.
    Remark("the map is written without covariances: %s", error.what());
  }
  if (!missing.empty()) {
    std::string list;
    for (const std::string& what : missing) {
      list += (list.empty() ? "" : ", ") + what;
    }
    Remark(
        "--marginals=%s: the map has %s%s; map.json names the types of "
        "features and their numbers",
        FLAGS_marginals.c_str(), list.c_str(),
        outcome->covariances.empty() ? ", and so no covariances" : "");
  }
  outcome->ellipse_sigmas = FLAGS_ellipse_sigmas;
  if (!outcome->covariances.empty()) {
    Detail("covariances of %zu features in %.1f s", outcome->covariances.size(),
           watch.Seconds());
  }
}

std::string TitleOf(const std::string& name) {
  std::filesystem::path path(name);
  // Of a folder that ends in a slash, too.
  if (path.filename().empty()) path = path.parent_path();
  return PrintableUtf8(path.filename().string());
}

}  // namespace plumbline
