#ifndef PLUMBLINE_FRONTEND_GUESSED_TURNS_H_
#define PLUMBLINE_FRONTEND_GUESSED_TURNS_H_

#include <plumbline/factors/angle.h>
#include <plumbline/frontend/part_joining.h>
#include <plumbline/frontend/track_search.h>

#include <vector>

namespace plumbline {

/// When the turn of a guess is corrected by the directions of walls.
struct GuessedTurnOptions {
  /// Key scans before the guess and after it whose walls are compared: so many
  /// nearest ones, and as many in the middle of each two stretches in which a
  /// track has to keep its directions.
  int window_keys = 80;
  /// The least that says what a direction is, key scans.
  int least_keys = 20;
  /// Returns whose walls lie within this of the direction that most have, or of
  /// a right angle to it, belong to it, rad.
  double width = DegToRad(5.0);
  /// Share of all returns that belong to the direction at least, and share of
  /// these that any other direction may have.
  double least_share = 0.45;
  double most_of_rival = 0.4;
  /// A track whose directions change by more than this from window to window,
  /// rad, goes through wings at other angles.
  double most_change = DegToRad(5.0);
  /// Odometry that tells of the way over a gap is off by no more than this
  /// share of what the robot turned from before the gap to behind it, and
  /// `least_turn`. No guess is turned by more than `most_turn`, rad.
  double most_share = 0.25;
  double least_turn = DegToRad(3.0);
  double most_turn = DegToRad(20.0);
};

/// A guess (the first scan of its track) and by how much more the robot turned
/// over the gap than the guess has it, rad.
struct GuessedTurn {
  int scan = 0;
  double turn = 0.0;
  /// Its entry among the loose tracks.
  int loose = 0;
};

/// Where the track of a robot goes on by a guess, its turn is odometry's, which
/// may be off by 15 degrees after a quick turn, and the building beyond it
/// stands askew. Walls of a building share their directions or are at right
/// angles (the paper's premise): where the walls in sight before the gap and
/// after it each have one pair of directions, and the robot saw no other pair
/// all along both tracks, the two are the same pair.
///
/// `seen`: key scans in the order of the log; where the number of the part
/// changes to a new one a guess lies. Poses of neighboring parts are as the
/// guesses have them. `loose_of`: by part but the first, its entry among the
/// loose tracks. `blind`: the ways of which odometry tells. Returns the turns
/// in the order of scans; guesses without clear directions, and those that
/// would turn by more than odometry can be off (a wing at another angle may lie
/// there), are left out. Cost: linear in the key scans.
std::vector<GuessedTurn> FindGuessedTurns(const std::vector<SeenKey>& seen,
                                          const std::vector<int>& loose_of,
                                          const std::vector<BlindWay>& blind,
                                          const GuessedTurnOptions& options);

/// The motion to the first scan of a guessed track with so much more turn: the
/// robot turned on the way, half of it before it had gone anywhere.
Pose2 WithTurn(const Pose2& motion, double turn);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_GUESSED_TURNS_H_
