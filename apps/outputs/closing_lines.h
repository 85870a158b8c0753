#ifndef PLUMBLINE_OUTPUTS_CLOSING_LINES_H_
#define PLUMBLINE_OUTPUTS_CLOSING_LINES_H_

#include <plumbline/outputs/solve_outputs.h>

#include <string>
#include <vector>

namespace plumbline {

/// The last words of a run, two lines or three: what is in the map in `folder`
/// (walls, shared directions, rooms and doors where they were looked for,
/// closures), what is worth a look, if anything (a run that was interrupted or
/// did not converge, a weakly tied track, logs that were kept apart, rooms
/// without a door, long walls that their direction was refuted for), and which
/// file shows it. The outputs have been written.
std::vector<std::string> ClosingLines(const SolveOutcome& outcome,
                                      const std::string& folder);

/// The same of a run that found the robot in an earlier map, `map`: how many
/// poses it has there and how much of each log agreed with it.
std::vector<std::string> ClosingLinesInMap(const SolveOutcome& outcome,
                                           const std::string& folder,
                                           const std::string& map);

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_CLOSING_LINES_H_
