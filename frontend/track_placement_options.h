#ifndef PLUMBLINE_FRONTEND_TRACK_PLACEMENT_OPTIONS_H_
#define PLUMBLINE_FRONTEND_TRACK_PLACEMENT_OPTIONS_H_

#include <plumbline/factors/angle.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <limits>

namespace plumbline {

/// Options of PlaceTrack: what it takes for two maps to be of one building.
struct TrackPlacementOptions {
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  /// Consecutive key scans that are looked for together: a window.
  int window_keys = 16;
  /// Windows that are looked for in the whole map at most, spread evenly over
  /// the track, and poses that each may have there.
  int max_searches = 24;
  int max_peaks = 8;
  /// Places of the track that are looked at closely at most for every few
  /// windows.
  int max_candidates = 8;
  /// A window is compared with what was seen from within this radius, m, by at
  /// most this many key scans.
  double radius = 6.0;
  int max_views = 60;
  /// A window may lie so far from where its neighbors place it, m and rad.
  double max_shift = 0.8;
  double max_turn = DegToRad(8.0);
  /// A window agrees with the map when this share of its returns is not in the
  /// unknown, this share of those lies on what the map has, no more than this
  /// share of what the map has there is looked through, and this share of
  /// returns finds a partner; it contradicts the map when more than these
  /// shares (of the known returns, of what the map has) say so.
  double min_known = 0.4;
  double min_support = 0.85;
  double max_seen_through = 0.2;
  double min_inliers = 0.6;
  double max_intruders = 0.3;
  double max_looked_through = 0.4;
  /// Windows that have to agree, the share of the windows that agree or
  /// contradict which may contradict, and the share of the best place's
  /// support that a rival may have.
  int min_agreeing = 3;
  double max_contradicting = 0.1;
  double rival_share = 0.6;
  /// What the returns say of the track's place in the direction that they say
  /// least of is at least this share of what they say across it.
  double min_information_share = 0.02;
  /// RMS distance, m, of the windows that agree from where the track as a whole
  /// has them, and what is added to it for each metre (RMS) that they lie from
  /// their middle: buildings of one kind may agree piece by piece where the
  /// track bends, but not as a whole.
  double max_misfit = 0.1;
  double max_misfit_per_metre = 0.003;
  /// Longest piece of wall, m, that two scans of one of both see and that those
  /// of the other look through, without the 0.3 m at either end that count for
  /// nothing: doors are opened and closed between two logs and furniture is
  /// moved, but walls of over 1.7 m are not. Corridors of two buildings may
  /// agree wherever both were seen, but for the mouth of a wing.
  double max_contradicting_stretch = 1.1;
  /// Length of all such pieces, m, for each window that agrees, from which on
  /// it is another place. Of two places one of which has more than that, and at
  /// least twice as much as the other, that one is no rival.
  double max_contradicting_per_window = std::numeric_limits<double>::infinity();
  /// Whether a place is given up only when none of the windows that speak for
  /// it agrees when it is looked at closely; else when the first does not.
  bool ask_all_voters = false;
  /// Shorter pieces are doors that were opened or shut, but where walls stand
  /// in openings of the map and the map's walls in openings of the track, it is
  /// another building, as its own mirror image is: either happens at two places
  /// at least, and on the average of both it does at this many, and at more
  /// than this share of the agreeing windows.
  int min_exchanged = 3;
  double max_exchanged_share = 0.15;
  /// Doors that stand elsewhere in the same wall (an opening and a wall in its
  /// place, up to 3 m from each other, either way): this many make it
  /// another building. People shut one door and open the next, too, but a log
  /// that is kept apart without need does less harm than two buildings in one
  /// map.
  int min_moved_doors = 1;
  /// What makes a place no more than a candidate. The share of the returns'
  /// information (min_information_share) below which the map and the track
  /// share little but a straight corridor, which many buildings have. The share
  /// of the best place's support from which on a rival is one where more than a
  /// few windows agree; else any is. Agreeing windows for each place that has a
  /// wall in one and an opening in the other. And the share of the agreeing
  /// windows that the mirror image of the track may find in the map where there
  /// is such a place: a building that looks like its own mirror image, or
  /// nearly, is not told from that by anything but what differs.
  double min_certain_information_share = 0.3;
  double max_certain_rival = 0.3;
  int min_agreeing_per_change = 6;
  double max_mirrored_share = 0.5;
  /// What makes a place plain though doors were opened and shut and furniture
  /// was moved, so that of the bounds on changes and rivals above only
  /// rival_share keeps the logs apart, and that the map shares more than a
  /// straight corridor with the track: so many windows agree, no more than
  /// these shares contradict, of the windows that say yes or no and of all that
  /// either has where the other one knows, and the mirror image of the track
  /// finds no more than this share of its support (where fewer agree more is a
  /// doubt: two corridors and a corner are like others). For each place with a
  /// wall in one and an opening in the other so many windows agree, and for
  /// each pair of these which may be a door that stands elsewhere; which is one
  /// for certain where the two are nearer to each other than two doors of a
  /// wall can be, m.
  int min_plain_agreeing = 12;
  double max_plain_contradicting = 0.15;
  double max_plain_contradicted_share = 0.03;
  double max_plain_mirrored_share = 0.67;
  double min_plain_agreeing_per_change = 1.5;
  int min_plain_agreeing_per_moved_door = 12;
  double min_door_spacing = 1.2;
  /// What makes a place plain though more doors were opened and shut, as over
  /// hours in a large building (and double doors, so that a piece of wall that
  /// contradicts may be this long, m): so many windows agree, no more than this
  /// share of those that say yes or no contradicts, no other place, nor the
  /// mirror image, finds more than this share of its support, no door stands
  /// elsewhere, and the returns say at least this share of its place in the
  /// direction that they say least of.
  int min_sure_agreeing = 24;
  double max_sure_contradicting = 0.05;
  double max_sure_rival = 0.2;
  double min_sure_information_share = 0.2;
  double max_sure_contradicting_stretch = 1.4;
  /// With a start that somebody gave walls may have been put up and taken down
  /// where min_plain_agreeing windows agree, at any number of places: longest
  /// piece, m.
  double max_contradicting_stretch_at_start =
      std::numeric_limits<double>::infinity();
  /// With a start that somebody gave: windows that have to agree, doors that
  /// stand elsewhere, and how far from it the track may start, m and rad. Where
  /// it would start farther from there by more than start_precision, m, is no
  /// rival that keeps it apart: it is told as a doubt.
  int min_agreeing_at_start = 1;
  int min_moved_doors_at_start = 2;
  double start_distance = 3.0;
  double start_precision = 1.0;
  double start_turn = DegToRad(45.0);

  /// Adapts the distances to a laser noisier by this factor
  /// (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    matcher.ScaleToNoise(scale);
  }
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TRACK_PLACEMENT_OPTIONS_H_
