#ifndef PLUMBLINE_APPS_SOLVE_RUN_OUTPUTS_H_
#define PLUMBLINE_APPS_SOLVE_RUN_OUTPUTS_H_

#include <plumbline/apps/solve/run_context.h>
#include <plumbline/core/registry.h>
#include <plumbline/outputs/output_folder.h>
#include <plumbline/outputs/solve_outputs.h>

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace plumbline {

/// Which files --outputs asks for. Where a log is only localized the map is as
/// it was, and so are the files that are made of it alone.
std::set<std::string> OutputsFromFlags(const Registry& registry);

/// Every name that a run may write.
std::set<std::string> NamesOfAllOutputs(const Registry& registry);

/// All files that the run reads, as far as flags name them.
std::vector<std::filesystem::path> InputFiles();

/// Where the files of a map go: those of the first log's map into the output
/// folder itself.
std::string FolderOfMap(std::size_t map);

/// "a, b, c"
std::string Joined(const std::vector<std::string>& names);

/// Writes all files and puts them in place together, the summary last: it knows
/// what the others took. Throws Error, with the folder as it was.
void WriteOutputs(SolveOutcome* outcome, RunClock* clock, OutputFolder* folder);

/// Writes the output folder's own map, removes the folders of maps that this
/// run has not (it has `num_maps`) and says the last words.
void FinishRun(const RunContext& run, std::size_t num_maps,
               SolveOutcome* outcome);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_RUN_OUTPUTS_H_
