#ifndef PLUMBLINE_DETECTORS_PLACE_MATCH_H_
#define PLUMBLINE_DETECTORS_PLACE_MATCH_H_

#include <plumbline/core/feature.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <limits>
#include <vector>

namespace plumbline {

/// One face of a wall as it stands in the map.
struct PlaceWall {
  FeatureId id = kNoId;
  /// Reference point (map frame, m) and direction (rad); the robot that saw it
  /// stood on one side, so directions are compared modulo 2 pi.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  double direction = 0.0;
  /// Visible part, m along the direction from the reference point.
  double begin = 0.0;
  double end = 0.0;
  /// Walls of one group (0 or more) are one wall already.
  int group = -1;
};

/// Gates of matching the walls of two places.
struct PlaceMatchOptions {
  /// Displacements up to this many standard deviations are looked at.
  double gate = 3.0;
  /// Once a place is moved onto the other, walls that are one lie this close, m
  /// ...
  double tolerance = 0.08;
  /// ... have directions this close (standard deviation, rad), apart from what
  /// their lengths bring (direction_noise for 1 m, falling with length^1.5) ...
  double angle_tolerance = DegToRad(0.7);
  double direction_noise = DegToRad(0.7);
  /// ... and lie side by side over this length, m.
  double min_overlap = 0.3;
  /// Walls of which one stands in front of the other by less, m, contradict
  /// each other: the one behind would not have been seen.
  double conflict_depth = 0.6;
  /// A search no wider than this to either side, m, does not reach another
  /// corridor: there the place is known and only its walls are in question.
  double narrow = 0.6;
  /// In a wider search matches need this much evidence (nats) beyond what a
  /// chance alignment somewhere in it gives.
  double min_evidence = 3.0;
  /// Another displacement that is not worse by this much (nats) and puts a wall
  /// elsewhere by more than rival_offset (m) makes the wall's match ambiguous.
  double rival_margin = 2.0;
  double rival_offset = 0.15;
  /// A place whose turn is known worse than this (standard deviation, rad) is
  /// not looked for: any wall could be any other.
  double max_turn = DegToRad(12.0);
  /// Most displacements, each from two pairs of walls, that are tried: the
  /// longest walls of the second place are paired until there are this many.
  /// Places of coherent logs need some hundred.
  int max_tried_pairs = 2000;
};

/// Two walls that are one, if the places are.
struct WallMatch {
  /// Indices into the places.
  int first = -1;
  int second = -1;
  /// Middle of the part where they lie side by side: m along the second wall
  /// from its reference point.
  double along = 0.0;
  /// Length of that part, and how far the second is to the left of the first
  /// once it is moved, m.
  double overlap = 0.0;
  double offset = 0.0;
};

/// Result of MatchPlaces.
struct PlaceMatch {
  /// Why there are no matches.
  enum class Outcome {
    /// There are matches.
    kMatched,
    /// All walls that could be one are one already.
    kNoNews,
    /// No displacement within the gate brings walls together.
    kNothingFits,
    /// Explanations that are nearly as good agree on no wall.
    kAmbiguous,
    /// In a wide search chance would give as much.
    kTooLittleEvidence,
    /// The turn is hardly known.
    kTurnUnknown,
    /// Every wall that could be one asks for a wider search than is looked at.
    kTooWide,
  };
  /// Of this comparison.
  Outcome outcome = Outcome::kMatched;
  /// Moves the second place onto the first: x, y (m) of the pivot, and the turn
  /// about it (rad); the most probable one given the matches below. Components
  /// that no match constrains stay at zero.
  Eigen::Vector3d displacement = Eigen::Vector3d::Zero();
  /// Matches that all explanations which are nearly as good agree on, in the
  /// order of (second, first). Empty: nothing can be said.
  std::vector<WallMatch> matches;
  /// Of these matches against chance, nats.
  double evidence = 0.0;
  /// Half width of the search across the matched walls, the widest, m; of
  /// kTooWide the least that a match would have.
  double search = 0.0;
};

/// Compares two places: sets of walls seen in one visit each, whose walls are
/// well known relative to each other, while the second place as a whole is
/// displaced against the first by an unknown (x, y, turn about `pivot`), normal
/// with mean zero and this covariance (map axes; m, m, rad). Throws Error when
/// the covariance is not positive definite.
///
/// Every displacement that puts one wall, or two that are not parallel, onto
/// walls of the first place is tried and refined with all walls that it brings
/// together (least squares with the prior). Its worth in nats:
///
///     sum over matched lines of  w log(range / (k tolerance))
///       - conflicts - d^2 / 2
///
/// where a line is made of all matched walls in line, w <= 1 grows with its
/// length, the fraction is the inverse of the chance that a line somewhere in
/// the search range hits one of the k lines there (an a-contrario model:
/// Desolneux, Moisan and Morel 2000), and d is the Mahalanobis distance of the
/// displacement. A match is kept when no displacement of nearly the same worth
/// puts its wall elsewhere: along a corridor that says nothing about the way
/// along it, only what is across is kept.
///
/// In a wide search the evidence must also outweigh the number of displacements
/// that could be tried: the first line of each direction fixes the displacement
/// and proves nothing, and the opposite wall of a corridor counts half, as
/// corridors of one width are common.
///
/// Where all walls that could be one are of one group already, there is nothing
/// to find and no match is returned. Nor is where the search would be wider
/// than `widest` (half width, m) across every one of them.
PlaceMatch MatchPlaces(const std::vector<PlaceWall>& first,
                       const std::vector<PlaceWall>& second,
                       const Eigen::Vector2d& pivot,
                       const Eigen::Matrix3d& covariance,
                       const PlaceMatchOptions& options,
                       double widest = std::numeric_limits<double>::infinity());

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_PLACE_MATCH_H_
