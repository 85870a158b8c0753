// Feeds arbitrary text to every reader of a small format: map.json, the truth
// of a building, trajectories, relations, worlds and structure priors.

#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/structure_prior.h>
#include <plumbline/frontend/tum.h>

#include <cstdint>
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

// Any other exception ends the process.
template <typename Read>
void Try(const Read& read) {
  try {
    read();
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
}

template <typename Read>
void TryInput(const std::string& text, const Read& read) {
  Try([&] {
    plumbline::InputStream input("fuzz", text);
    read(&input);
  });
}

template <typename Read>
void TryStream(const std::string& text, const Read& read) {
  Try([&] {
    std::istringstream input(text);
    read(input);
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  using plumbline::InputStream;
  const std::string text(reinterpret_cast<const char*>(data), size);
  TryInput(text, [](InputStream* in) { plumbline::ReadMapTruth(in); });
  TryInput(text, [](InputStream* in) { plumbline::ReadStraightMap(in); });
  TryInput(text, [](InputStream* in) { plumbline::ReadTum(in); });
  TryInput(text, [](InputStream* in) { plumbline::ReadRelations(in); });
  TryStream(text, [](std::istream& in) { plumbline::ReadWorld(in, "fuzz"); });
  TryStream(text, [](std::istream& in) {
    plumbline::ReadStructurePrior(in, "fuzz", BuiltIns());
  });
  TryStream(text, [](std::istream& in) {
    plumbline::Graph graph;
    plumbline::ReadGraphJson(in, "fuzz", BuiltIns(), &graph);
  });
  return 0;
}
