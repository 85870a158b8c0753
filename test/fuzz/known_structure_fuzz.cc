// Feeds arbitrary text to the readers of what is known of a building
// beforehand, statements and drawings, and binds what is read to a small map.

#include <plumbline/core/error.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/plan_dxf.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

using plumbline::Pose2;

// Drawings of more lines take longer than a run of the fuzzer.
constexpr std::size_t kMostLines = 40;

void Require(bool holds) {
  if (!holds) std::abort();
}

const plumbline::Registry& BuiltIns() {
  static const plumbline::Registry& registry =
      []() -> const plumbline::Registry& {
    static plumbline::Registry made;
    plumbline::RegisterBuiltins(&made);
    return made;
  }();
  return registry;
}

// Walls as those of the corpus' drawing; returns the pose that sees them.
plumbline::FeatureId MakeMap(plumbline::Graph* graph) {
  plumbline::Transaction transaction;
  plumbline::Feature pose;
  pose.type = &BuiltIns().GetFeature("pose");
  pose.fixed = true;
  transaction.AddFeature(pose);
  for (const Pose2& at :
       {Pose2(2.0, 0.0, 0.0), Pose2(4.0, 1.5, 1.5), Pose2(2.0, 3.0, 3.14)}) {
    plumbline::Feature wall;
    wall.type = &BuiltIns().GetFeature("segment");
    wall.parameters = {at[0], at[1], at[2]};
    wall.extent_begin = -1.5;
    wall.extent_end = 1.5;
    transaction.AddFeature(wall);
  }
  return graph->Apply(std::move(transaction)).features.front();
}

void Bind(const plumbline::KnownStructure& known) {
  plumbline::Graph graph;
  plumbline::KnownStructureBinder binder(known, BuiltIns(), MakeMap(&graph),
                                         &graph);
  binder.AddStatements();
  binder.TieToPlan();
  for (const std::string& note : binder.Notes()) Require(!note.empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  plumbline::KnownStructure known;
  known.min_agreeing_length = 3.0;
  try {
    known.statements = plumbline::ReadWallStatements(text, "fuzz");
    for (const plumbline::WallStatement& statement : known.statements) {
      Require(statement.first.allFinite() && statement.second.allFinite());
      Require(statement.sigma_offset > 0.0 && statement.sigma_angle > 0.0);
    }
    Bind(known);
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  known.statements.clear();
  try {
    known.plan = plumbline::ReadPlanDxf(text, "fuzz", {}, &known.notes);
    for (const plumbline::PlanLine& line : known.plan) {
      Require(line.begin.allFinite() && line.end.allFinite());
    }
    if (known.plan.size() <= kMostLines) Bind(known);
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}
