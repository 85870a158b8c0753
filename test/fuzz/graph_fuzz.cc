// Feeds arbitrary text to the g2o reader, and solves what is read when it is
// small. A graph that is read is written, read again and written as the same.

#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/initial_guess.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/pipeline/graph_solver.h>

#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>

namespace {

const plumbline::Registry& BuiltIns() {
  static const plumbline::Registry& registry =
      []() -> const plumbline::Registry& {
    static plumbline::Registry made;
    plumbline::RegisterBuiltins(&made);
    return made;
  }();
  return registry;
}

void Solve(plumbline::Graph* graph) {
  plumbline::GraphSolverOptions options;
  options.session.max_iterations = 5;
  options.em.max_iterations = 2;
  try {
    plumbline::MakeInitialGuess({}, graph);
    plumbline::GraphSolver solver(BuiltIns(), options, graph);
    int steps = 0;
    solver.Run([&steps] { return ++steps > 20; });
  } catch (const plumbline::Error&) {
    // Numbers may overflow.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    plumbline::Graph graph;
    std::istringstream input(text);
    const plumbline::G2oFile file =
        plumbline::ReadG2o(input, "fuzz", BuiltIns(), &graph);
    std::ostringstream written;
    plumbline::WriteG2o(graph, nullptr, written);
    plumbline::Graph again;
    std::istringstream second(written.str());
    plumbline::ReadG2o(second, "again", BuiltIns(), &again);
    std::ostringstream rewritten;
    plumbline::WriteG2o(again, nullptr, rewritten);
    if (rewritten.str() != written.str()) std::abort();
    std::ostringstream json;
    plumbline::WriteGraphJson(graph, json);
    plumbline::Graph from_json;
    std::istringstream map(json.str());
    plumbline::ReadGraphJson(map, "map", BuiltIns(), &from_json);
    if (graph.num_features() <= 20) Solve(&graph);
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}
