#ifndef PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/odometry_scale.h>
#include <plumbline/frontend/range_noise.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/steady_motion.h>

#include <Eigen/Core>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// How far wheel odometry is trusted (one standard deviation). Wide: the public
/// logs turn away by degrees a metre and by tens of degrees in corners.
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

/// Options for when the track of the scans is lost, and how its tie to the
/// earlier track is found again.
struct TrackingOptions {
  /// Shares of the returns that stand where the reference has looked through,
  /// and of the reference's points that the scan looks through, from which on
  /// they contradict a match. After a gap in the log the second pair counts.
  double max_intruders = 0.2;
  double max_seen_through = 0.25;
  double max_intruders_after_gap = 0.15;
  double max_seen_through_after_gap = 0.15;
  /// Inlier ratio, of what is known, that a match after a gap needs when it
  /// agrees with odometry; else OdometryRefinementOptions::good_inlier_ratio.
  double min_ratio_after_gap = 0.6;
  /// Chi-square of a match against odometry from which on contradictions count
  /// without a gap, too: people contradict, but odometry agrees.
  double max_innovation = 15.0;
  /// Scale of Cauchy's loss on that chi-square: how much better the returns
  /// must fit at a pose that odometry speaks against.
  double odometry_tail = 9.0;
  /// Returns that lie 0.15 m apart or more that a match which leaves odometry
  /// by more than that has to have on what the reference has seen. With fewer
  /// it may leave odometry by less, in proportion. At least 1.
  int min_hits = 15;
  /// A time between scans that is longer than this, s, and this many times the
  /// usual one is a gap.
  double gap_seconds = 1.0;
  double gap_factor = 4.0;
  /// Scans in a row that are refused, the last for contradicting, after which a
  /// track of its own begins where there was no gap.
  int min_contradictions = 3;
  /// Way (m) and turn (rad) without any match after which a track of its own
  /// begins.
  double max_blind_way = 1.5;
  double max_blind_turn = DegToRad(40.0);
  /// A tie by odometry alone is accepted when there was neither a gap nor a
  /// contradiction and its standard deviations, for odometry as it was on this
  /// log so far, are no larger than these, m and rad.
  double max_odometry_sigma = 0.75;
  double max_odometry_angle = DegToRad(20.0);
  /// From this way without any match on it is reported, m.
  double max_silent_way = 3.0;
  /// What a tie needs: scans of the track, share of returns that lie on what
  /// the reference knows of all that do not lie in the unknown, the same by
  /// the directions of surfaces too, score of the search, largest share
  /// of the reference that is looked through, share of the returns that are
  /// not in the unknown, and returns a scan that lie on the reference.
  int min_tie_keys = 3;
  double min_tie_support = 0.85;
  double min_tie_inliers = 0.5;
  double min_tie_score = 0.4;
  double max_tie_seen_through = 0.15;
  double min_tie_known = 0.4;
  int min_tie_hits = 15;
  /// The same share where odometry, which a gap or a contradiction has put in
  /// doubt, speaks of another place: also for a single scan after a gap.
  double min_unexpected_support = 0.97;
  /// What a tie needs that was found in everything seen so far, where many
  /// places look alike and the right one need not be among them.
  double min_global_support = 0.96;
  double min_global_inliers = 0.65;
  /// A rival pose must be worse by this factor.
  double rival_share = 0.75;
  /// Speed at which the robot may have gone in a gap, m/s, and how far the
  /// search near the last pose goes at most, m. A match that asks for a faster
  /// move which odometry does not have, and which is longer than
  /// search_translation by that, does not count: wheels slip, but a robot does
  /// not leap. A scan may show another time than its stamp says.
  double gap_speed = 0.8;
  double max_local_search = 6.0;
  /// Key scans of the track at which the whole map is searched first, and after
  /// which the tie is given up.
  int first_global_keys = 10;
  int max_open_keys = 150;
  /// Pieces of a part that hangs loose in the end that are looked for in what
  /// the rest of the track saw.
  int max_late_windows = 12;
};

/// How scans are matched with what was seen last, and how far odometry is
/// trusted.
struct OdometryRefinementOptions {
  /// False: scans are taken as keys by the same rule, but poses are the raw
  /// odometry's (the paper's method).
  bool match_scans = true;
  ScanPointsOptions points;
  ClutterOptions clutter;
  /// A match that is not good, or whose chi-square against odometry is larger
  /// than this, is asked for without the returns on clutter, too, when they
  /// have more than this share: along a corridor a single person may be all
  /// that says how far the robot went. What the rest says stands when the two
  /// lie farther apart than this, m and rad: something moves.
  double clutter_innovation = 4.0;
  double max_clutter = 0.02;
  double clutter_distance = 0.05;
  double clutter_rotation = DegToRad(1.5);
  /// Scans after that in which clutter is distrusted and kept out of the
  /// reference.
  int clutter_memory = 20;
  ScanMatcherOptions matcher;
  OdometryNoise noise;
  MatchDrift drift;
  /// A new key scan is taken after this much motion, m and rad.
  double key_distance = 0.3;
  double key_rotation = 0.15;
  /// Key scans that a new scan is matched with.
  int window = 12;
  /// Share of matched returns below which a match is looked for again, more
  /// widely, and below which it is rejected.
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
  TrackingOptions tracking;
  /// Noise of the laser's ranges (standard deviation, m); 0: as the scans so
  /// far show it.
  double range_sigma = 0.0;

  /// Adapts the distances to a laser noisier by this factor (RangeNoiseScale).
  void ScaleToNoise(double scale) {
    points.ScaleToNoise(scale);
    matcher.ScaleToNoise(scale);
  }
};

/// How a track of scans hangs on what was before it.
enum class TrackTie {
  /// It goes on: nothing was lost.
  kNone,
  /// Lost, and found again on what had been seen before.
  kMatched,
  /// By odometry over a short way that nothing contradicts.
  kOdometry,
  /// Unknown: where the track lies is a guess from odometry.
  kLoose,
};

/// Result for one scan.
struct RefinedScan {
  /// Pose of the robot in the refined odometry's frame, which starts at the
  /// raw odometry's first pose and drifts.
  Pose2 pose = Pose2::Zero();
  /// Motion since the last key scan before this one, in that scan's frame, and
  /// its covariance. For the first scan: zero.
  UncertainPose2 since_key;
  /// Index of the scan that since_key counts from when it is not the last key
  /// scan before this one; -1 otherwise.
  int since = -1;
  bool is_key = false;
  /// The match was refused or impossible: odometry stands.
  bool odometry_only = false;
  /// Of the first scan of a track that was lost; a key scan.
  TrackTie tie = TrackTie::kNone;
};

/// A scan whose place in the track is settled.
struct SettledScan {
  /// Counted from 0 in the order of Process.
  int index = 0;
  RefinedScan refined;
  /// The returns of a key scan, robot's frame; empty otherwise.
  std::vector<ScanPoint> points;
};

/// A part of the track that is weakly tied to the rest.
struct LooseTrack {
  /// Last scan before it that is sure, and its own last one, or the first one
  /// that was found again.
  int begin = 0;
  int end = 0;
  std::string why;
  /// It was found again on what had been seen earlier: the tie is one match,
  /// not a guess.
  bool found = false;
};

/// A tie found once all scans were in, for a part of the track that was settled
/// as loose.
struct LateTie {
  /// First scan of the part; its RefinedScan::tie was kLoose.
  int scan = 0;
  /// What RefinedScan::since and since_key of it are now.
  int since = 0;
  UncertainPose2 since_key;
};

/// Refines odometry by matching each scan with the last key scans
/// (core/method.md, section 7, step 0).
///
/// A scan that contradicts what was seen before it, or that follows a gap or a
/// way without matches and cannot be matched, begins a track of its own. Its
/// tie to the rest is open: it is looked for by matching the track's key scans
/// with what was seen last, over the full circle, and then with all that was
/// ever seen, and holds when one pose explains them clearly better than every
/// other. Until then the track's scans are not settled. When it cannot be told
/// the track is settled as loose, and looked for once more in the end, when all
/// that was ever seen is there.
class OdometryRefiner {
 public:
  /// Starts with nothing seen.
  explicit OdometryRefiner(const OdometryRefinementOptions& options);

  /// Scans in the order of the log. Returns what is known of the scan now;
  /// while a tie is open its pose is a guess.
  RefinedScan Process(const Scan& scan);

  /// Takes out the next scan that is settled, in the order of Process; false
  /// when there is none.
  bool TakeSettled(SettledScan* settled);

  /// Settles what is open, and looks for loose parts in all that was seen: no
  /// scan follows. `stop` (may be null) is asked now and then; once it has
  /// returned true nothing more is looked for, and no part is found.
  void Finish(const std::function<bool()>& stop = nullptr);

  /// Parts that Finish found, in the order of scans.
  const std::vector<LateTie>& late_ties() const { return late_ties_; }

  /// Whether no tie is open and all that is settled was taken out.
  bool IsSettled() const { return open_ == nullptr && settled_.empty(); }

  /// Writes what it knows between two scans while IsSettled, to be read by
  /// another one with the same options.
  void WriteState(StateWriter* state);
  void ReadState(StateReader* state);

  /// The returns of the last scan that was processed, in the robot's frame.
  const std::vector<ScanPoint>& points() const { return points_; }

  /// Scans that took the wide search, and that fell back on odometry.
  int wide_searches() const { return wide_searches_; }
  int refusals() const { return refusals_; }
  /// Tracks that were lost, and those of them that were tied again.
  int losses() const { return losses_; }
  /// Weakly tied parts of the track, in the order of scans. A part that is tied
  /// by a guess ends where the next such part begins.
  const std::vector<LooseTrack>& loose() const { return loose_; }

  /// Noise of the laser's ranges (standard deviation, m): what the options say,
  /// or what the scans so far show, 0 while they are too few.
  double range_sigma() const;
  /// What a metre of odometry is presently taken for, m.
  double odometry_scale() const { return odometry_scale_.scale(); }
  /// Factor by which the laser is noisier than usual, as presently allowed for.
  double noise_scale() const { return noise_scale_; }

  /// Calls `trace` with a line on each decision that was not clear-cut.
  void SetTrace(std::function<void(const std::string&)> trace) {
    trace_ = std::move(trace);
  }

 private:
  struct KeyScan {
    int scan;
    Pose2 pose;
    std::vector<ScanPoint> points;
    // Position of the laser in the robot's frame, m.
    Eigen::Vector2d laser;

    template <typename Archive>
    friend void Exchange(Archive& archive, KeyScan& key) {
      auto& [scan, pose, points, laser] = key;
      ExchangeAll(archive, scan, pose, points, laser);
    }
  };
  // Scans that are matched with each other.
  struct Track {
    std::deque<KeyScan> keys;
    ScanMatcher matcher;
    Pose2 last_pose = Pose2::Zero();
    UncertainPose2 since_key;
    // Since the last scan that was matched: way (m), turn (rad), scans.
    double way = 0.0;
    double turn = 0.0;
    int refused = 0;
    // Time since then, s.
    double seconds = 0.0;
    // Scans for which it is known that something moves.
    int moving = 0;
    bool after_gap = false;
    // Odometry has jumped since.
    bool jumped = false;
    // Returns of the last scan.
    std::vector<ScanPoint> last_points;
    explicit Track(const ScanMatcherOptions& options) : matcher(options) {}

    // The matcher is made anew from the keys.
    template <typename Archive>
    friend void Exchange(Archive& archive, Track& track) {
      auto& [keys, matcher, last_pose, since_key, way, turn, refused, seconds,
             moving, after_gap, jumped, last_points] = track;
      ExchangeAll(archive, keys, last_pose, since_key, way, turn, refused,
                  seconds, moving, after_gap, jumped, last_points);
    }
  };
  // A track whose tie to the one before is not known.
  struct OpenTie {
    explicit OpenTie(Track lost) : before(std::move(lost)) {}
    Track before;
    // Last scan that is sure, first one of the track.
    int last_sure = 0;
    int first = 0;
    // Way (m), turn (rad) and time (s) by odometry since the last scan that is
    // sure; way and turn of it up to the first of the track.
    double way = 0.0;
    double turn = 0.0;
    double seconds = 0.0;
    double blind_way = 0.0;
    double blind_turn = 0.0;
    // Neither a gap nor a contradiction.
    bool odometry_holds = true;
    // Share of the reference that was looked through before all this.
    double seen_through = 0.0;
    std::string why;
    // Key scans of the track.
    std::vector<KeyScan> keys;
    int next_attempt = 0;
    int next_global = 0;
  };
  // What matching says of a scan.
  struct Outcome;

  // Allows for the noise that the scans show, this one among them.
  void AllowForNoise(const Scan& scan);
  void SetNoiseScale(double scale);
  template <typename Archive>
  void ExchangeState(Archive& archive);
  void RebuildReference(Track* track);
  // The motion since the scan before: odometry's, or the robot's own steady one
  // while odometry is known to stand still although the robot moves.
  UncertainPose2 StepOf(const Pose2& by_wheels);
  // Whether a motion by odometry, the first one since it stood still, is that
  // of all scans since rather than that of one.
  bool IsLate(const Pose2& motion) const;
  // Matches the scan, which moved by `step` since the one before. `leapt`:
  // farther than a robot can.
  Outcome Match(const Scan& scan, const UncertainPose2& step, bool leapt);
  // While odometry stands still or leaps: whether the returns say that the
  // robot goes on as before, against `match`, which follows odometry. If so
  // sets where it is, and its match.
  bool MovesOn(bool leapt, UncertainPose2* since_key, MatchPrior* prior,
               MatchResult* match);
  // Whether a match goes where the robot cannot have got to by itself.
  bool Leaps(const Pose2& matched, const Pose2& motion) const;
  // The pose by odometry, as uncertain as all odometry since the last match.
  MatchPrior PriorOf(const Pose2& pose, const UncertainPose2& step) const;
  // The best pose of `points` near the prior's.
  MatchResult MatchPoints(const std::vector<ScanPoint>& points,
                          const MatchPrior& prior, const Pose2& motion);
  // Returns of the last scan that do not lie on clutter; none when there is
  // little of it.
  std::vector<ScanPoint> WithoutClutter(const Scan& scan) const;
  // Takes the match of the returns that do not lie on clutter where it is
  // another one.
  void MatchWithoutClutter(const Scan& scan, const MatchPrior& prior,
                           const Pose2& motion, MatchResult* match);
  // Takes the match of the returns that are no intruders where it agrees with
  // the reference at least as well as the present one, `here`.
  void MatchWithoutIntruders(const std::vector<bool>& intruders,
                             const MatchPrior& prior,
                             const Eigen::Vector2d& laser, MatchResult* match,
                             ScanAgreement* here) const;
  // Whether a match that is not plainly good stands up to what the reference
  // knows of solid and free space. Otherwise the outcome says if the scan
  // contradicts the reference. `innovation`: chi-square against the prior.
  bool StandsUpTo(const Scan& scan, const MatchPrior& prior, double innovation,
                  MatchResult* match, Outcome* outcome) const;
  // Whether more is intruding or seen through than may be; `seen_through`:
  // share that was before.
  bool Contradicts(const ScanAgreement& agreement, double seen_through) const;
  // Time since the scan before, s.
  void NoteGap(double seconds);
  // Way and turn without a match.
  void NoteMatch(const Outcome& outcome, const Pose2& motion);
  bool IsContradicted(const Outcome& outcome) const;
  bool IsLost(const Outcome& outcome) const;
  // Opens a tie, or starts the open one again, at this scan.
  void Lose(int scan, double seconds, const Outcome& outcome);
  // The first scan of a track, and the ones after it.
  void BeginTrack(const Scan& scan, SettledScan* first);
  void ContinueTrack(const Scan& scan, const Eigen::Matrix3d& information,
                     SettledScan* next);
  // Looks for the tie; settles the track when it is found or `last`.
  void Tie(bool last);
  // Scans that a tie is judged by, and where it would hang.
  struct Visit {
    const ScanMatcher* matcher;
    // Of the archive, [begin, end); empty for what was seen last.
    std::size_t begin = 0;
    std::size_t end = 0;
  };
  struct Hypothesis {
    Pose2 pose = Pose2::Zero();
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    // Share of the returns on what was seen there, of all that do not lie in
    // the unknown.
    double support = 0.0;
    double quality = 0.0;
    bool holds = false;
    std::size_t begin = 0;
    std::size_t end = 0;
  };
  // What key scans of a track have seen, in the frame of their middle.
  struct TrackView {
    std::vector<const KeyScan*> keys;
    std::vector<Pose2> relative;
    // To search with, and those with normals to match with.
    std::vector<Eigen::Vector2d> sparse;
    std::vector<ScanPoint> dense;
  };
  static TrackView ViewOf(const std::vector<KeyScan>& keys, std::size_t begin,
                          std::size_t end);
  // What a visit says of a pose of the track; false when nothing there holds
  // it. `seen_through`: share of the reference that was before.
  bool Judge(const TrackView& view, const ScoredPose& peak, const Visit& visit,
             double seen_through, bool is_global, Hypothesis* hypothesis) const;
  // The pose of the middle of the open track's key scans [begin, end) that
  // explains them best, if it is clear. `visits` gives what was seen around a
  // pose, each time that the robot was there.
  // `is_global`: it was looked for in all that was seen.
  bool FindTie(const std::vector<KeyScan>& keys, const ScanMatcher& reference,
               const std::function<std::vector<Visit>(const Pose2&)>& visits,
               const Pose2& center, double translation_window,
               std::size_t begin, std::size_t end, double seen_through,
               bool is_global, std::int64_t* nodes, Hypothesis* found);
  // What was seen from some key scans of the archive, ascending, to be searched
  // in: around its middle, m each way.
  struct ArchiveView {
    const std::vector<std::size_t>& where;
    ScanMatcher matcher;
    Pose2 center;
    double window;
  };
  ArchiveView ViewOfArchive(const std::vector<std::size_t>& where) const;
  // FindTie in it. The visits of `found` are positions in its `where`. `nodes`:
  // as ScanMatcher::Peaks has it.
  bool FindInArchive(const std::vector<KeyScan>& keys,
                     const ArchiveView& archive, std::size_t begin,
                     std::size_t end, double seen_through, std::int64_t* nodes,
                     Hypothesis* found);
  // Takes note of how odometry's motion since the last key scan agrees with the
  // match of this one, and begins anew.
  // `information`: of the returns alone, in that key scan's frame.
  void CompareOdometry(const Scan& scan, const RefinedScan& refined,
                       const Eigen::Matrix3d& information);
  // Odometry's variances on this log, of those in the options.
  double OdometryVarianceScale() const;
  // From the last sure key scan to the first of the open track, by odometry.
  UncertainPose2 BlindMotion() const;
  // Whether a pose of the open track's key scan `middle` lies within what
  // odometry and the tracks leave open since the archive's key scan `since`;
  // true where they say nothing of it.
  bool AgreesWithOdometry(const Hypothesis& found, std::size_t middle,
                          std::size_t since) const;
  // Of the visit's key scans the nearest one to what was found there.
  std::size_t NearestOf(const Hypothesis& found,
                        const std::vector<std::size_t>& where) const;
  // Sets what was seen from these key scans of the archive, [begin, end).
  void SetArchive(const std::vector<std::size_t>& where, std::size_t begin,
                  std::size_t end, ScanMatcher* matcher) const;
  // Of these key scans of the archive, ascending, at most so many for each
  // stretch of floor, in even steps: what the same place looked like the
  // twentieth time says nothing new.
  std::vector<std::size_t> Thinned(const std::vector<std::size_t>& where) const;
  // Covariance of a match, in the axes of `from`.
  Eigen::Matrix3d TieCovariance(const Hypothesis& found,
                                const Pose2& from) const;
  // The last of the poses of a track seen from the first.
  UncertainPose2 Along(const std::vector<Pose2>& poses) const;
  Eigen::Matrix3d DriftCovariance(const Pose2& motion) const;
  // Looks for the parts that hang loose in each other.
  void JoinParts();
  // Key scans of the archive by part.
  std::vector<std::vector<std::size_t>> Parts() const;
  // Where the second part lies in the first.
  bool JoinPart(const std::vector<std::size_t>& rest,
                const std::vector<std::size_t>& part);
  // Where a window of a part's key scans lies in the rest: its middle one.
  struct LateVote {
    std::size_t middle;
    Hypothesis found;
  };
  // How many windows of this size are looked for of so many key scans.
  std::size_t NumLateWindows(std::size_t keys, std::size_t size) const;
  // Starts of the windows of a part that fit somewhere at all, the clearest one
  // first.
  std::vector<std::size_t> WindowsOf(const std::vector<KeyScan>& keys,
                                     std::size_t size,
                                     const ArchiveView& rest) const;
  // The tie that follows from a match.
  LateTie LateTieOf(const std::vector<std::size_t>& rest,
                    const std::vector<std::size_t>& part,
                    const LateVote& vote) const;
  // `is_rough`: it says little more than where to look.
  void AddLateTie(const std::vector<std::size_t>& rest,
                  const std::vector<std::size_t>& part, const LateVote& vote,
                  const LateTie& tie, bool is_rough);
  void Settle(const Pose2& shift, const RefinedScan& first);
  void Archive(const KeyScan& key);

  const OdometryRefinementOptions usual_options_;
  // For the laser's noise.
  OdometryRefinementOptions options_;
  RangeNoise noise_;
  double noise_scale_ = 1.0;
  std::function<void(const std::string&)> trace_;
  // While Finish runs.
  std::function<bool()> stop_;
  Track track_;
  std::vector<ScanPoint> points_;
  bool started_ = false;
  int count_ = 0;
  Pose2 last_odometry_ = Pose2::Zero();
  double last_time_ = 0.0;
  double usual_step_ = 0.0;
  // Order of settled scans: front to be taken first.
  std::deque<SettledScan> settled_;
  // Scans of the open track, and what was lost with it.
  std::vector<SettledScan> pending_;
  std::unique_ptr<OpenTie> open_;
  // What was seen from key scans that are settled, thinned out.
  struct ArchivedKey {
    int scan;
    // Key scans whose relative poses are known are one part.
    int part;
    Pose2 pose;
    Eigen::Vector2d laser;
    // Position and normal, robot's frame.
    std::vector<Eigen::Vector4f> points;

    template <typename Archive>
    friend void Exchange(Archive& archive, ArchivedKey& key) {
      auto& [scan, part, pose, laser, points] = key;
      ExchangeAll(archive, scan, part, pose, laser, points);
    }
  };
  std::vector<ArchivedKey> archive_;
  int part_ = 0;
  int num_parts_ = 1;
  // By part but the first: its entry in loose_.
  std::vector<int> loose_of_;
  std::vector<LateTie> late_ties_;
  // Odometry at the last key scan; sum of chi-squares of the motions that were
  // compared with matches.
  Pose2 key_odometry_ = Pose2::Zero();
  double squared_innovations_ = 0.0;
  int compared_motions_ = 0;
  OdometryScale odometry_scale_;
  // How the robot moved of late, by its scans.
  SteadyMotion steady_;
  // For so many scans odometry did not move; its last motion before, and where
  // the robot was then. Dead: the robot is known to have gone on.
  int still_ = 0;
  Pose2 last_motion_ = Pose2::Zero();
  Pose2 still_pose_ = Pose2::Zero();
  bool is_dead_ = false;
  // Where the robot is if it goes on while odometry stands still: the pose, the
  // same since the key scan, the motion that goes on.
  struct Ahead {
    bool exists = false;
    Pose2 pose = Pose2::Zero();
    UncertainPose2 since_key;
    UncertainPose2 step;

    template <typename Archive>
    friend void Exchange(Archive& archive, Ahead& ahead) {
      auto& [exists, pose, since_key, step] = ahead;
      ExchangeAll(archive, exists, pose, since_key, step);
    }
  };
  Ahead ahead_;
  int wide_searches_ = 0;
  int refusals_ = 0;
  int losses_ = 0;
  std::vector<LooseTrack> loose_;
  // The one that goes on and is a guess; -1: none.
  int guessed_ = -1;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_
