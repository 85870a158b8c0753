#ifndef PLUMBLINE_FRONTEND_ODOMETRY_CHECK_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_CHECK_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>

#include <vector>

namespace plumbline {

/// Options for when odometry and a map cannot both be right.
struct OdometryCheckOptions {
  /// Way by odometry between the scans that are looked at, m; a longer one
  /// between two scans is a jump, which says nothing.
  double spacing = 0.4;
  double jump = 1.5;
  /// Stretches of this much way by odometry, m, of which the map has less than
  /// this share are disputed. Wheels slip by a third for some metres.
  double stretch = 6.0;
  double min_share = 0.7;
  /// A metre of odometry's that is this many times the map's, or its inverse,
  /// is disputed, ...
  double max_scale = 1.25;
  /// ... where the robot went this far, m; so is a direction of its way that is
  /// this far from odometry's in its own frame, rad, where it goes straight on:
  /// turns by less than this between two scans that are looked at, rad.
  double min_way = 10.0;
  double max_course = 0.12;
  double straight = 0.3;
  /// Scans that turn the other way than odometry do so in all turns between
  /// scans of this much and more, rad: the correlation is below minus this, and
  /// the turns add up to this, rad.
  double turn = 0.1;
  double opposite = 0.7;
  double min_turns = 3.0;
};

/// A stretch of which the map has less than odometry.
struct DisputedWay {
  /// First and last scan: indices.
  int begin = 0;
  int end = 0;
  /// m; by odometry in metres of the map's as far as they are believed.
  double by_map = 0.0;
  double by_odometry = 0.0;
};

/// How odometry agrees with the trajectory of a map.
struct OdometryAgreement {
  /// Stretches, in the order of scans.
  std::vector<DisputedWay> disputed;
  /// A metre of odometry's in the map, m (median over the way); 1 where the
  /// robot went less far than OdometryCheckOptions::min_way.
  double scale = 1.0;
  /// Whether that is far from 1.
  bool is_scale_disputed = false;
  /// How far to the left of where odometry has it the robot goes in the map,
  /// in its own frame, rad: what the mounting of the laser is off by.
  double course = 0.0;
  bool is_course_disputed = false;
  /// Whether the map turns left where odometry turns right: the order of the
  /// beams is another than the log says, or a sign of odometry's.
  bool turns_are_opposite = false;
};

/// Compares odometry with `trajectory` (the pose of every scan, map frame).
/// Matching follows what it sees: where that goes along with the robot, or is
/// not what the log says that it is, odometry is the only one to object. A way
/// that is longer in the map than by odometry is not disputed: wheels that are
/// not read are told elsewhere. Throws Error when numbers differ. Cost: linear
/// in scans.
OdometryAgreement CompareWithOdometry(const std::vector<Scan>& scans,
                                      const std::vector<Pose2>& trajectory,
                                      const OdometryCheckOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_CHECK_H_
