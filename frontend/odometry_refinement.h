#ifndef PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_
#define PLUMBLINE_FRONTEND_ODOMETRY_REFINEMENT_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/guessed_turns.h>
#include <plumbline/frontend/match_drift.h>
#include <plumbline/frontend/odometry_calibration.h>
#include <plumbline/frontend/part_joining.h>
#include <plumbline/frontend/range_noise.h>
#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/steady_motion.h>
#include <plumbline/frontend/tie_doubts.h>
#include <plumbline/frontend/track_reference.h>
#include <plumbline/frontend/track_search.h>
#include <plumbline/frontend/tracking_options.h>
#include <plumbline/frontend/wheel_track.h>

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
  /// Whether a thread prepares what the scans after the next key scan are
  /// matched with; the result is the same.
  bool prepare_ahead = false;
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
  GuessedTurnOptions guessed_turns;
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
  /// Where odometry alone had placed the scans before, or had them stand: what
  /// it had missed by this one, which was matched, seen from where it had it;
  /// and the last scan before them (-1: nothing was missed).
  Pose2 missed = Pose2::Zero();
  int missed_since = -1;
};

/// A scan whose place in the track is settled.
struct SettledScan {
  /// Counted from 0 in the order of Process.
  int index = 0;
  RefinedScan refined;
  /// The returns of a key scan, robot's frame; empty otherwise.
  std::vector<ScanPoint> points;
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
  /// The same with returns that are made elsewhere: sets those of the scan
  /// (ExtractScanPoints with the options' points, for a laser noisier by
  /// `noise_scale`).
  using ReturnsOf =
      std::function<void(double noise_scale, std::vector<ScanPoint>* points)>;
  RefinedScan Process(const Scan& scan, const ReturnsOf& returns_of);

  /// Takes out the next scan that is settled, in the order of Process; false
  /// when there is none.
  bool TakeSettled(SettledScan* settled);

  /// Settles what is open, and looks for loose parts in all that was seen: no
  /// scan follows. `stop` (may be null) is asked now and then; once it has
  /// returned true nothing more is looked for, and no part is found.
  void Finish(const std::function<bool()>& stop = nullptr);

  /// Parts that Finish found, in the order of scans.
  const std::vector<LateTie>& late_ties() const { return late_ties_; }
  /// Guesses whose turn the directions of walls correct, in the order of scans.
  const std::vector<GuessedTurn>& guessed_turns() const {
    return guessed_turns_;
  }
  /// What motions between key scans made of odometry's metre, in the order of
  /// the log (late_metre.h).
  const std::vector<MetreUse>& metre_uses() const { return metre_uses_; }

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
  double odometry_scale() const { return odometry_calibration_.scale(); }
  /// By how much the robot is presently taken to drive to the left of where its
  /// laser looks by the log, rad.
  double odometry_course() const { return odometry_calibration_.course(); }
  /// Factor by which the laser is noisier than usual, as presently allowed for.
  double noise_scale() const { return noise_scale_; }

  /// Calls `trace` with a line on each decision that was not clear-cut.
  void SetTrace(std::function<void(const std::string&)> trace) {
    trace_ = std::move(trace);
    search_.set_trace(trace_);
  }

 private:
  // Scans that are matched with each other.
  struct Track {
    std::deque<TrackKey> keys;
    ScanMatcher matcher;
    Pose2 last_pose = Pose2::Zero();
    UncertainPose2 since_key;
    // Of the last scan that was matched, and odometry's there.
    Pose2 matched_pose = Pose2::Zero();
    Pose2 matched_odometry = Pose2::Zero();
    // Where odometry has the robot, held by matches.
    WheelTrack wheels;
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
      auto& [keys, matcher, last_pose, since_key, matched_pose,
             matched_odometry, wheels, way, turn, refused, seconds, moving,
             after_gap, jumped, last_points] = track;
      ExchangeAll(archive, keys, last_pose, since_key, matched_pose,
                  matched_odometry, wheels, way, turn, refused, seconds, moving,
                  after_gap, jumped, last_points);
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
    // sure; those of it up to the first of the track.
    double way = 0.0;
    double turn = 0.0;
    double seconds = 0.0;
    double blind_way = 0.0;
    double blind_turn = 0.0;
    double blind_seconds = 0.0;
    // Neither a gap that odometry does not tell of nor a contradiction.
    bool odometry_holds = true;
    // Odometry has not moved over the gap in the log, and may not know of the
    // way yet; so many scans ago, when it does not know of it still.
    bool is_late = false;
    int late_scans = 0;
    // It has told of the way since.
    bool has_caught_up = false;
    // Share of the reference that was looked through before all this.
    double seen_through = 0.0;
    std::string why;
    // Key scans of the track.
    std::vector<TrackKey> keys;
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
  // sets where it is, and its match. `returns_lead`: they lead to one place
  // whether the robot goes on or stands.
  bool MovesOn(bool leapt, UncertainPose2* since_key, MatchPrior* prior,
               MatchResult* match, bool* returns_lead);
  // Takes the match back to where odometry has the robot when the returns do
  // not speak clearly for the place where it is.
  void StayUnlessClear(const MatchPrior& prior, const Pose2& motion,
                       const Eigen::Vector2d& laser, MatchResult* match);
  // Whether a match goes where the robot cannot have got to by itself.
  bool Leaps(const Pose2& matched, const Pose2& motion) const;
  // The pose by odometry, as uncertain as all odometry since the last match.
  MatchPrior PriorOf(const Pose2& pose, const UncertainPose2& step) const;
  // The best pose of `points` near the prior's.
  MatchResult MatchPoints(const std::vector<ScanPoint>& points,
                          const MatchPrior& prior, const Pose2& motion);
  // The best pose of `points` near a guess, whatever odometry says of the turn.
  MatchResult MatchOverruling(const std::vector<ScanPoint>& points,
                              const Pose2& guess,
                              const MatchPrior& prior) const;
  // Whether `points` speak for the pose of one match against that of another by
  // more than odometry speaks against it.
  bool IsClearlyBetter(const MatchResult& wide, const MatchResult& match,
                       const std::vector<ScanPoint>& points,
                       const MatchPrior& prior) const;
  // Returns of the last scan that do not lie on clutter; none when there is
  // little of it.
  std::vector<ScanPoint> WithoutClutter(const Scan& scan) const;
  // Takes the place from where odometry has the robot, held by matches, where
  // that is known.
  void GoByWheels(const Pose2& motion, bool leapt, MatchPrior* prior);
  // Takes the match of the returns that do not lie on clutter where it is
  // another one.
  void MatchWithoutClutter(const Scan& scan, const MatchPrior& prior,
                           const Pose2& motion, MatchResult* match);
  // Takes note of how odometry's last step goes on what was before, and whether
  // that has been so since the last key scan.
  void NoteWheels(bool leapt);
  bool HaveWheelsBeenSteady() const;
  // Whether wheels have turned on as before since the last key scan, and were
  // steady not long ago.
  bool HaveWheelsGoneOn() const;
  // Odometry since the last key scan, as a pose of the scan.
  Pose2 ByWheels(const Scan& scan) const;
  // Where the robot moves steadily and a match leads far from where odometry
  // since the last key scan does, by one thing alone or against much of what
  // the robot sees, takes the match without what leads there.
  void MatchAsWheelsSay(const Scan& scan, const MatchPrior& prior,
                        MatchResult* match);
  // Returns of the last scan without those of the one thing that says how far
  // the robot went in a direction (length 1, robot's frame); none when it is
  // more than one.
  std::vector<ScanPoint> WithoutOneThing(
      const Eigen::Vector2d& direction) const;
  // Of returns that say how far the robot went in a direction: those of the
  // last scan without the ones that speak for the pose `matched` against that
  // of wheels, where enough speak the other way round, or the ones are one
  // thing and `least` do; none otherwise.
  std::vector<ScanPoint> WithoutWhatGoes(const Eigen::Vector2d& direction,
                                         const Pose2& by_wheels,
                                         const Pose2& matched, int least) const;
  // Takes the match of the returns that are no intruders where it agrees with
  // the reference at least as well as the present one, `here`.
  void MatchWithoutIntruders(const std::vector<bool>& intruders,
                             const MatchPrior& prior,
                             const Eigen::Vector2d& laser, MatchResult* match,
                             ScanAgreement* here) const;
  // Whether a match that is not plainly good stands up to what the reference
  // knows of solid and free space. Otherwise the outcome says if the scan
  // contradicts the reference. `innovation`: chi-square against the prior;
  // `room`: RoomSinceMatch.
  bool StandsUpTo(const Scan& scan, const MatchPrior& prior, double innovation,
                  double room, MatchResult* match, Outcome* outcome) const;
  // By how much wider the prior is than odometry of one step, `motion`, leaves
  // it, as scans before were not matched: the logarithm of the ratio of the
  // determinants of their covariances, which adds to a chi-square where
  // densities are compared. At least 0.
  double RoomSinceMatch(const MatchPrior& prior, const Pose2& motion) const;
  // The match that odometry leads to, or where that is contradicted the best
  // one within what odometry leaves open. `laser`: in the robot's frame;
  // `seen_through`: see Contradicts.
  MatchResult MatchNearOdometry(const MatchPrior& prior,
                                const Eigen::Vector2d& laser,
                                double seen_through) const;
  // Whether the scan fits about as well elsewhere within what odometry leaves
  // open: places look alike. `laser`: in the robot's frame.
  bool LooksAlikeNear(const MatchPrior& prior, const MatchResult& match,
                      const Eigen::Vector2d& laser) const;
  // Takes a match over a gap that leaves odometry back to where that leads when
  // the scan fits there as well, or other places look like that of the match,
  // which then tells nothing of how far the robot went. False when it does not
  // fit there, and may be at any of these. `seen_through`: see Contradicts.
  bool StayWhereAlike(const MatchPrior& prior, const Eigen::Vector2d& laser,
                      double seen_through, MatchResult* match) const;
  // Whether more is intruding or seen through than may be; `seen_through`:
  // share that was before.
  bool Contradicts(const ScanAgreement& agreement, double seen_through) const;
  // Time since the scan before, s.
  void NoteGap(double seconds);
  // Way and turn without a match.
  void NoteMatch(const Outcome& outcome, const Pose2& motion);
  bool IsContradicted(const Outcome& outcome) const;
  bool IsLost(const Outcome& outcome) const;
  // Opens a tie, or starts the open one again, at this scan. Returns by what
  // the track so far was moved when the tie that was open was settled.
  Pose2 Lose(int scan, const Outcome& outcome);
  // Where odometry that did not move over a gap tells of the way at once, the
  // open track lies where it says.
  void CatchUp(const Scan& scan, const Pose2& by_wheels, const Pose2& matched,
               SettledScan* now);
  // The first scan of a track, and the ones after it.
  void BeginTrack(const Scan& scan, SettledScan* first);
  void ContinueTrack(const Scan& scan, const Eigen::Matrix3d& information,
                     SettledScan* next);
  // Looks for the tie; settles the track when it is found or `last`.
  void Tie(bool last);
  // Takes note of how odometry's motion since the last key scan agrees with the
  // match of this one, and begins anew.
  // `information`: of the returns alone, in that key scan's frame.
  void CompareOdometry(const Scan& scan, const SettledScan& settled,
                       const Eigen::Matrix3d& information);
  // Odometry's variances on this log, of those in the options.
  double OdometryVarianceScale() const;
  // From the last sure key scan to the first of the open track, by odometry:
  // its own covariance, by how much an uncertain heading adds to the side of
  // the way, and all of it, in every direction.
  Eigen::Matrix3d BlindCovariance() const;
  double BlindVarianceAside() const;
  UncertainPose2 BlindMotion() const;
  // Of a tie that is a guess.
  Eigen::Matrix3d LooseCovariance() const;
  // Chi-square (3 degrees of freedom) of a pose of the open track's key scan
  // `middle` against odometry and the tracks since the archive's key scan
  // `since`; infinite where it cannot have turned by so much, 0 where they say
  // nothing of it.
  double AgainstOdometry(const FoundTrack& found, std::size_t middle,
                         std::size_t since) const;
  // Whether it lies within what these leave open.
  bool AgreesWithOdometry(const FoundTrack& found, std::size_t middle,
                          std::size_t since) const;
  // Whether a robot can have got there in the time without a match, however
  // wrong odometry is; true where it cannot be told.
  bool IsInReach(const FoundTrack& found, std::size_t middle,
                 std::size_t since) const;
  // Where key scans [begin, end) of the open track lie in what was seen around
  // the place that odometry leads to, where it tells of the way: a place is no
  // rival where odometry makes it unlikely. `since`: the archive's key scan
  // next to it.
  bool FindWhereOdometryLeads(std::size_t begin, std::size_t end,
                              FoundTrack* found, std::size_t* since) const;
  // Where they lie in all that was ever seen.
  bool FindInAll(std::size_t begin, std::size_t end, FoundTrack* found,
                 std::size_t* since) const;
  // Looks once more for what hangs on ties that proved doubtful.
  void JoinDoubtfulParts();
  void Settle(const Pose2& shift, const RefinedScan& first);
  // Moves the track, all that lies in its frame, by a motion of that frame.
  void MoveTrack(const Pose2& shift);

  const OdometryRefinementOptions usual_options_;
  // For the laser's noise.
  OdometryRefinementOptions options_;
  RangeNoise noise_;
  double noise_scale_ = 1.0;
  std::function<void(const std::string&)> trace_;
  Track track_;
  std::unique_ptr<TrackReference> reference_;
  std::vector<ScanPoint> points_;
  bool started_ = false;
  int count_ = 0;
  Pose2 last_odometry_ = Pose2::Zero();
  // What it went between the last two scans, m.
  double last_step_ = 0.0;
  double last_time_ = 0.0;
  double usual_step_ = 0.0;
  // Order of settled scans: front to be taken first.
  std::deque<SettledScan> settled_;
  // Scans of the open track, and what was lost with it.
  std::vector<SettledScan> pending_;
  std::unique_ptr<OpenTie> open_;
  TrackSearch search_;
  int part_ = 0;
  int num_parts_ = 1;
  // By part but the first: its entry in loose_.
  std::vector<int> loose_of_;
  // Those that ended in a guess.
  std::vector<BlindWay> blind_ways_;
  // Ties by one match with all that was seen.
  std::vector<FoundTie> found_ties_;
  std::vector<LateTie> late_ties_;
  std::vector<GuessedTurn> guessed_turns_;
  std::vector<MetreUse> metre_uses_;
  // Odometry at the last key scan; sum of chi-squares of the motions that were
  // compared with matches.
  Pose2 key_odometry_ = Pose2::Zero();
  double squared_innovations_ = 0.0;
  int compared_motions_ = 0;
  OdometryCalibration odometry_calibration_;
  // How the robot moved of late, by its scans.
  SteadyMotion steady_;
  // For so many scans odometry did not move; its last motion before, and where
  // the robot was then. Dead: the robot is known to have gone on.
  int still_ = 0;
  Pose2 last_motion_ = Pose2::Zero();
  // Scans in a row in which odometry went on as the robot did before, and scans
  // since the last key scan.
  int steady_wheels_ = 0;
  // Odometry's own steps; scans in a row in which it went on like them, and
  // since the last one that was steady.
  SteadyMotion wheel_steps_;
  int even_wheels_ = 0;
  int since_steady_ = 0;
  int scans_since_key_ = 0;
  Pose2 still_pose_ = Pose2::Zero();
  bool is_dead_ = false;
  // Where the robot is if it goes on while odometry stands still: the pose, the
  // same since the key scan, the motion that goes on, and by how much better
  // than standing it explains the scans so far.
  struct Ahead {
    bool exists = false;
    Pose2 pose = Pose2::Zero();
    UncertainPose2 since_key;
    UncertainPose2 step;
    double evidence = 0.0;

    template <typename Archive>
    friend void Exchange(Archive& archive, Ahead& ahead) {
      auto& [exists, pose, since_key, step, evidence] = ahead;
      ExchangeAll(archive, exists, pose, since_key, step, evidence);
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
