#ifndef PLUMBLINE_PIPELINE_GUESSED_PARTS_H_
#define PLUMBLINE_PIPELINE_GUESSED_PARTS_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/track_placement_options.h>
#include <plumbline/pipeline/log_solver.h>

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace plumbline {

/// Two parts of a log, one of which was found in the other by all that they
/// saw: their records, ascending.
struct FoundPart {
  std::vector<std::size_t> rest;
  std::vector<std::size_t> part;
};

/// What is known of the ties of parts, by the scans that the parts begin with.
struct PartTies {
  /// Found by more than a few scans, or confirmed by them.
  std::set<int> sure;
  /// Why a part that much of the rest looks like was not found all the same,
  /// for people.
  std::map<int, std::string> doubts;
  /// Those that were moved to where they were found.
  std::vector<FoundPart> found;
};

/// Whether the place of some part of the log is a guess (TrackTie::kLoose), was
/// found by a few of its scans (TrackTie::kMatched), follows scans that are
/// missing for over 10 s, or scans that odometry alone had placed and missed by
/// over 0.5 m or 10 degrees (RefinedScan::missed), but for tracks that begin
/// with the scans `sure`.
bool HasUnsureParts(const std::vector<Scan>& scans,
                    const LogSolverResult& result, const std::set<int>& sure);

/// Options of PlaceTrack for two parts of one log. That both are of one
/// building is known, or as good as: doors that stand elsewhere, and the mirror
/// image that fits as well, say nothing against it. What is asked for is that
/// no other place of the building comes near.
TrackPlacementOptions WithinOneBuilding(TrackPlacementOptions options);

/// Looks for these parts among what the largest part saw, largest first, when
/// the poses of either are straight: drift over a thousand metres makes parts
/// contradict each other that are right (JoinParts has no other poses). The
/// largest part grows by what is found; where nothing more is found in it parts
/// are looked for in each other, and go together from then on. What was found
/// by a few scans stays where it was unless much more of it agrees elsewhere,
/// also where some of it would fit in another place, too. A guess of which a
/// few windows say where it may lie, and nothing speaks against that, is put
/// there, and stays told as a guess; so is what was found by a few scans, and
/// most of what it saw contradicts that, or nothing agrees with it.
///
/// `poses`: of the records' scans, in a frame in which the first one stays
/// where it is; parts that were found elsewhere are moved in them, with what
/// hangs on them. In `result` their ties become matched ones, and
/// LogSolverResult::loose tells that they were found. `options` are those of
/// WithinOneBuilding, for the noise of the laser. `ties`: what is known before
/// and after. Returns whether any was moved or tied; when `stop` (may be null)
/// has returned true nothing more is.
bool PlaceUnsureParts(const std::vector<Scan>& scans,
                      const TrackPlacementOptions& options,
                      const std::function<bool()>& stop,
                      LogSolverResult* result, std::vector<Pose2>* poses,
                      PartTies* ties);

/// Tells in LogSolverResult::loose of parts that were found by a few scans:
/// where what they saw afterwards speaks against it, and where it would fit in
/// another place, too, though all of it may fit where it is; and of parts that
/// were found by all that they saw, where some of it still contradicts the
/// place when all was adjusted, and where what they were found in hangs on a
/// guess. Of either it is told where a door stands elsewhere in the same wall
/// than before (CountMovedDoors): the robot may have been carried to another
/// floor of the same walls. `poses`: as in PlaceUnsureParts, but as they are in
/// the end; `ties` as it has left them.
void TellOfDoubtfulParts(const std::vector<Scan>& scans,
                         const TrackPlacementOptions& options,
                         const std::function<bool()>& stop,
                         LogSolverResult* result, std::vector<Pose2> poses,
                         PartTies ties);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_GUESSED_PARTS_H_
