#ifndef PLUMBLINE_FRONTEND_SCAN_MATCHER_H_
#define PLUMBLINE_FRONTEND_SCAN_MATCHER_H_

#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/bucket_starts.h>
#include <plumbline/frontend/reference_points.h>
#include <plumbline/frontend/scan_points.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

namespace plumbline {

/// Resolution, gates and noise of point-to-line matching.
struct ScanMatcherOptions {
  /// Standard deviation of a return across its surface, m: noise of the
  /// laser and roughness of the wall together.
  double point_sigma = 0.03;
  /// A return counts as this many independent ones in the covariance: returns
  /// on one surface share the surface's own errors.
  double independence = 0.3;
  /// Farthest a return may lie from the reference point it is matched with,
  /// m: at first, and when the pose has settled.
  double initial_radius = 0.4;
  double final_radius = 0.15;
  int max_iterations = 20;
  /// A step smaller than this (m, and rad) ends the iteration.
  double convergence = 1e-4;
  /// While the radius shrinks about so many points of a scan are matched, then
  /// all.
  int coarse_points = 80;
  /// Correlative search: cell size (m), step of the search in translation (m)
  /// and rotation (rad).
  double grid_resolution = 0.1;
  double search_step = 0.15;
  double rotation_step = DegToRad(1.0);
  /// Points of a reference that lie farther than this from the middle of all
  /// along either axis, m, are left out: one wild return must not blow up the
  /// grids. Those near where they were seen from stay, where that is given.
  double reference_reach = 120.0;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) { point_sigma *= scale; }
};

/// Prior of the matcher: the motion model's pose and its information.
struct MatchPrior {
  Pose2 pose = Pose2::Zero();
  /// Inverse covariance in the frame of `pose`'s parent (m, m, rad).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  /// Whether what is plainly off it lets it go; else it holds.
  bool is_heavy_tailed = true;
};

/// Result of matching a scan.
struct MatchResult {
  Pose2 pose = Pose2::Zero();
  /// Covariance from the returns and the prior together: large along a
  /// corridor, where only the prior speaks.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Information of the returns alone; rank deficient along a corridor. The
  /// normals of a return and of its partner err independently: products of one
  /// with the other have no mean along a wall, where the squares of either
  /// would add up to a place that nothing shows.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  /// Curvature of the cost at the pose: what holds the scan there, noise of
  /// normals included.
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
  /// Share of the returns, of those that look at where the reference has
  /// something, that found a partner.
  double inlier_ratio = 0.0;
  int inliers = 0;
  /// Mean robust cost of a return in squared sigmas, unmatched ones at the
  /// bound: comparable between poses of one scan against one reference.
  double cost = 0.0;
};

/// A place from which returns of a reference were seen.
struct Viewpoint {
  /// Of the laser, in the reference's frame, m.
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  /// Index of the first of its returns; they end where the next viewpoint's
  /// begin.
  std::size_t begin = 0;
};

/// Agreement of a scan and the reference at a pose on what is solid and what is
/// free, counted in returns that lie at least some way apart.
struct ScanAgreement {
  /// Returns that lie on what the reference has seen.
  int hits = 0;
  /// Returns that stand where the reference has looked through.
  int intruders = 0;
  /// Returns that lie where the reference has not looked.
  int unknown = 0;
  /// Points of the reference that the scan looks at, and through.
  int seen = 0;
  int seen_through = 0;

  /// Share of what the scan looks at that it looks through.
  double SeenThroughShare() const {
    return seen > 0 ? static_cast<double>(seen_through) / seen : 0.0;
  }
  /// Share of the returns that do not lie in the unknown.
  double KnownShare() const {
    const int known = hits + intruders;
    return static_cast<double>(known) / std::max(1, known + unknown);
  }
  /// Share of the returns on what the reference has seen, of all that do not
  /// lie in the unknown.
  double Support() const {
    return static_cast<double>(hits) / std::max(1, hits + intruders);
  }
  /// How much of the scan the reference explains, at most 1.
  double Quality() const {
    return (hits * (1.0 - SeenThroughShare()) - 2.0 * intruders) /
           std::max(1, hits + intruders + unknown);
  }
  /// A share of all returns that found a partner as one of those that do not
  /// lie in the unknown, which are taken to be two in five at least.
  double OfKnown(double share) const {
    return share / std::max(0.4, KnownShare());
  }
};

/// A pose and how well it fits, at most 1.
struct ScoredPose {
  Pose2 pose = Pose2::Zero();
  double score = 0.0;
};

struct PeakGrid;

/// Matches a scan to a set of reference points: a correlative search over
/// rotation and translation for the neighbourhood of the right pose, then
/// robust point to line least squares. Not thread safe.
class ScanMatcher {
 public:
  /// Starts with no reference to match with.
  explicit ScanMatcher(const ScanMatcherOptions& options);

  /// Sets the reference: points and normals in the frame in which poses are
  /// given. Points need no order. Cost: linear in the points and in the cells
  /// of their bounding box.
  void SetReference(const std::vector<ScanPoint>& points);
  /// SetReference with the places that the points were seen from, ascending by
  /// `begin`: between them and their points the reference is free.
  void SetReference(const std::vector<ScanPoint>& points,
                    std::vector<Viewpoint> viewpoints);
  /// SetReference with points that are merged as this matcher does it.
  void SetReference(ReferencePoints points, std::vector<Viewpoint> viewpoints);
  /// Distance up to which points are merged, m (ReferencePoints).
  double merge_distance() const { return options_.point_sigma; }
  bool empty() const { return reference_.empty(); }

  /// ScanMatcherOptions::point_sigma from now on.
  void set_point_sigma(double sigma) { options_.point_sigma = sigma; }

  /// Point to line refinement of a pose near the truth.
  MatchResult Refine(const std::vector<ScanPoint>& scan, const Pose2& guess,
                     const MatchPrior& prior) const;

  /// Share of the returns with a normal that have a reference point within the
  /// initial radius at this pose: what Refine would start from, at a fraction
  /// of its cost. 0 without such returns.
  double Overlap(const std::vector<ScanPoint>& scan, const Pose2& pose) const;
  /// Whether that is at least so much: known before all points are looked at.
  bool OverlapsBy(double least, const std::vector<ScanPoint>& scan,
                  const Pose2& pose) const;

  /// The poses at which points fit the reference best, each at least
  /// `kPeakDistance` or `kPeakRotation` from the others, best first: all within
  /// the windows (m and rad each way, pi for the full circle) around `center`
  /// that score at least `minimum_score` and `share` of the best, and
  /// `max_peaks` at most. The score is the mean over the points: 1 on a
  /// surface, 0 where the reference has not looked, negative where it has
  /// looked through. Positions farther than `reach`, m, from all viewpoints
  /// are left out. Branch and bound: exact on its lattice. `stop` (may be null)
  /// is asked now and then; once it has returned true there are no peaks.
  /// `nodes` (may be null): how many nodes below the coarsest ones may be
  /// looked at, less those that were; the search ends with what it has when
  /// there are none left.
  std::vector<ScoredPose> Peaks(
      const std::vector<Eigen::Vector2d>& points, const Pose2& center,
      double translation_window, double rotation_window, double minimum_score,
      double share, int max_peaks,
      double reach = std::numeric_limits<double>::infinity(),
      const std::function<bool()>& stop = nullptr,
      std::int64_t* nodes = nullptr) const;

  /// A score that some of the poses of Peaks has, close to the best one's
  /// mostly, at a fraction of the cost.
  double ClearestScore(const std::vector<Eigen::Vector2d>& points,
                       const Pose2& center, double translation_window,
                       double rotation_window, double reach,
                       const std::function<bool()>& stop) const;

  /// Least distance of two peaks, m, and rad.
  static constexpr double kPeakDistance = 0.6;
  static constexpr double kPeakRotation = DegToRad(12.0);

  /// Compares the scan with the reference at this pose. `laser`: position of
  /// the laser in the robot's frame, m. Without viewpoints nothing of the
  /// reference is free. `intruders`, if not null, gets one entry per return:
  /// whether it is an intruder.
  ScanAgreement Compare(const std::vector<ScanPoint>& scan, const Pose2& pose,
                        const Eigen::Vector2d& laser,
                        std::vector<bool>* intruders = nullptr) const;

  /// How far each return lies from the surface that it is a part of at this
  /// pose, m: from the nearest one of the reference within the final radius;
  /// infinite where there is none, and without a normal.
  std::vector<double> Errors(const std::vector<ScanPoint>& scan,
                             const Pose2& pose) const;

  /// Best pose on a lattice around `center`: translations up to
  /// `translation_window` (m) each way, rotations up to `rotation_window`
  /// (rad) each way. `score`, if not null, gets the mean likelihood of a
  /// return there, in [0, 1].
  Pose2 Search(const std::vector<ScanPoint>& scan, const Pose2& center,
               double translation_window, double rotation_window,
               double* score) const;

 private:
  // Index of the nearest reference point whose normal agrees, -1 for none.
  // `hint`: one that may be near, or -1.
  int NearestReference(const Eigen::Vector2d& point,
                       const Eigen::Vector2d& normal, double radius,
                       int hint) const;
  // Index of any such reference point.
  int AnyReference(const Eigen::Vector2d& point, const Eigen::Vector2d& normal,
                   double radius, int hint) const;
  // Calls `look(begin, end)` with the reference points of the buckets within
  // `*squared_radius`, which it may lower, of a point: nearest rows first.
  template <typename Look>
  void VisitBuckets(const Eigen::Vector2d& point, const double* squared_radius,
                    const Look& look) const;
  // Calls `look(i)` with all in [begin, end) that lie within `*squared_radius`,
  // which it may lower, of a point, and some that do not.
  template <typename Look>
  void VisitNear(int begin, int end, const Eigen::Vector2d& point,
                 const double* squared_radius, const Look& look) const;

  ScanMatcherOptions options_;
  using Surface = ReferencePoint;
  std::vector<Surface> reference_;
  // The positions again, from origin_ on, to leave out what is clearly too far
  // away several at a time.
  std::vector<float> reference_x_;
  std::vector<float> reference_y_;
  // Points of the scan that is refined: those with a normal.
  mutable std::vector<Surface> points_;
  // Of each of them: its partner, and copies of the reference points around the
  // place where it was last looked up. While it stays near, its partner is one
  // of them.
  struct Lookup {
    int partner = -1;
    int begin = 0;
    int end = 0;
    // No other reference point whose normal may agree lies within `reach` of
    // `center`; negative when the points around are not known.
    double reach = -1.0;
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  };
  struct Neighbour {
    Surface surface;
    int index;
  };
  mutable std::vector<Lookup> lookups_;
  mutable std::vector<Neighbour> around_;
  // NearestReference for a point that may have been looked up before, and has
  // moved by no more than `step`, m, since the iteration before.
  int NearestAgain(const Eigen::Vector2d& point, const Eigen::Vector2d& normal,
                   double radius, double step, int hint, Lookup* lookup) const;
  // NearestReference that also keeps the reference points which are farther
  // away than the nearest by no more than `margin`, m.
  int NearestAndAround(const Eigen::Vector2d& point,
                       const Eigen::Vector2d& normal, double radius,
                       double margin, int hint, Lookup* lookup) const;
  // What the points say of a pose: sums over those with a partner in squared
  // sigmas, of one point in `stride`.
  struct Sums {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    // The same of the normals of points and of their partners.
    Eigen::Matrix3d crossed = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    double cost = 0.0;
    int inliers = 0;
    int tried = 0;
  };
  // `step`: by which the pose was changed since the iteration before.
  Sums SumUp(const Pose2& pose, double radius, std::size_t stride,
             const Eigen::Vector3d& step) const;
  // Buckets of reference points.
  static constexpr double bucket_size_ = ReferencePoints::kBucketSize;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int bucket_columns_ = 0;
  int bucket_rows_ = 0;
  BucketStarts bucket_starts_;
  // Likelihood field of the reference for the search, made at its first use.
  mutable std::vector<std::uint8_t> field_;
  mutable int field_columns_ = 0;
  mutable int field_rows_ = 0;
  mutable bool field_valid_ = false;
  void BuildField() const;
  // Cells of the field's grid that the reference has looked through, made at
  // its first use.
  std::vector<Viewpoint> viewpoints_;
  // The points and normals in the order in which they were given, when there
  // are viewpoints.
  std::vector<Surface> rays_;
  mutable std::vector<std::uint8_t> free_;
  mutable bool free_valid_ = false;
  void BuildFree() const;
  // Scores of Peaks by level: the best of 2^level cells each way from a cell
  // on; kLevelPad cells are added before the first.
  mutable std::vector<std::vector<std::int16_t>> levels_;
  void BuildLevels() const;
  PeakGrid GridOfPeaks() const;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SCAN_MATCHER_H_
