#ifndef PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <deque>
#include <vector>

namespace plumbline {

/// How far wheel odometry is believed (one standard deviation). Wide: the
/// public logs turn away by degrees a metre and by tens of degrees in corners.
struct OdometryNoise {
  /// m, and m a metre travelled.
  double translation = 0.01;
  double translation_per_metre = 0.1;
  /// rad, rad a metre travelled, rad a radian turned.
  double rotation = DegToRad(0.5);
  double rotation_per_metre = DegToRad(5.0);
  double rotation_per_radian = 0.4;
  /// m a radian turned.
  double translation_per_radian = 0.05;
};

/// Covariance of the relative motion `motion` (in its own start frame), with
/// axes along and across the motion treated alike.
Eigen::Matrix3d OdometryCovariance(const Pose2& motion,
                                   const OdometryNoise& noise);

/// Errors of scan matching that the returns do not tell of: what neighbouring
/// matches share (bent surfaces, beams that are not quite where they should be)
/// adds up along the way like a random walk.
struct MatchDrift {
  /// Standard deviations after one metre: m, and rad.
  double translation_per_root_metre = 0.01;
  double rotation_per_root_metre = DegToRad(0.1);
  /// After a turn of one radian, rad.
  double rotation_per_root_radian = DegToRad(0.7);
};

/// How scans are matched with what was seen last, and how far odometry is
/// trusted.
struct OdometryRefinementOptions {
  /// False: scans are taken as keys by the same rule, but poses are the raw
  /// odometry's (the paper's method).
  bool match_scans = true;
  ScanPointsOptions points;
  ScanMatcherOptions matcher;
  OdometryNoise noise;
  MatchDrift drift;
  /// A new key scan is taken after so much motion, m and rad.
  double key_distance = 0.3;
  double key_rotation = 0.15;
  /// Key scans that a new scan is matched with.
  int window = 12;
  /// Share of matched returns below which a match is looked for again, more
  /// widely, and below which it is not believed.
  double good_inlier_ratio = 0.8;
  double minimum_inlier_ratio = 0.4;
  /// Fewer returns than this are not matched.
  int minimum_points = 5;
  /// Windows of the wide search, m and rad; twice the distance travelled and
  /// the turn are added.
  double search_translation = 0.3;
  double search_rotation = DegToRad(6.0);
  /// The translation's window is never larger, m: odometry that jumps by more
  /// than a robot goes between two scans must not make the search endless.
  double max_search_translation = 5.0;
  /// A turn between scans from which on the wide search is always made, rad.
  double search_turn = DegToRad(4.0);
};

/// What became of one scan.
struct RefinedScan {
  /// Pose of the robot in the refined odometry's frame, which starts at the
  /// raw odometry's first pose and drifts.
  Pose2 pose = Pose2::Zero();
  /// Motion since the last key scan before this one, in that scan's frame, and
  /// its covariance. For the first scan: zero.
  UncertainPose2 since_key;
  bool is_key = false;
  /// The match was refused or impossible: odometry stands.
  bool odometry_only = false;
};

/// Refines odometry by matching each scan with the last key scans
/// (core/method.md, section 7, step 0).
class OdometryRefiner {
 public:
  /// Starts with nothing seen.
  explicit OdometryRefiner(const OdometryRefinementOptions& options);

  /// Scans in the order of the log.
  RefinedScan Process(const Scan& scan);

  /// The returns of the last scan that was processed, in the robot's frame.
  const std::vector<ScanPoint>& points() const { return points_; }

  /// Scans that took the wide search, and that fell back on odometry.
  int wide_searches() const { return wide_searches_; }
  int refusals() const { return refusals_; }

 private:
  struct KeyScan {
    Pose2 pose;
    std::vector<ScanPoint> points;
  };

  void RebuildReference();

  OdometryRefinementOptions options_;
  ScanMatcher matcher_;
  std::deque<KeyScan> keys_;
  std::vector<ScanPoint> points_;
  bool started_ = false;
  Pose2 last_odometry_ = Pose2::Zero();
  Pose2 last_pose_ = Pose2::Zero();
  UncertainPose2 since_key_;
  int wide_searches_ = 0;
  int refusals_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_
