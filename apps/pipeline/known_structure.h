#ifndef PLUMBLINE_PIPELINE_KNOWN_STRUCTURE_H_
#define PLUMBLINE_PIPELINE_KNOWN_STRUCTURE_H_

#include <plumbline/core/constraint.h>
#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/feature.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/marginals.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// A straight line of a plan, m, frame of the plan.
struct PlanLine {
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  std::string layer;
};

/// What somebody says of two walls.
struct WallStatement {
  /// What is said.
  enum class Kind {
    /// They lie on one line.
    kSame,
    /// They are parallel, at a distance.
    kDistance,
    /// They are parallel.
    kParallel,
    /// They are at right angles.
    kRightAngle,
  };
  Kind kind = Kind::kSame;
  /// Points by which the walls are named, m, map frame: each is the wall
  /// nearest to its point.
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Vector2d second = Eigen::Vector2d::Zero();
  /// Of kDistance, m.
  double distance = 0.0;
  /// Tolerances, m and rad.
  double sigma_offset = 0.02;
  double sigma_angle = DegToRad(0.3);
  /// True: counts as a measurement, and is never broken.
  bool is_hard = false;
  /// "walls.txt:3", for messages.
  std::string place;
};

/// What is known of a building beforehand.
struct KnownStructure {
  std::vector<PlanLine> plan;
  std::vector<WallStatement> statements;
  /// What was taken for granted in reading them, for people.
  std::vector<std::string> notes;
  /// Tolerances of a wall against its line of the plan, m and rad; of the
  /// direction of short lines, whose ends are no better, more.
  double plan_sigma_offset = 0.03;
  double plan_sigma_angle = DegToRad(0.3);
  /// p-value below which a wall is let go from its line, or a statement is
  /// broken.
  double break_below = 0.01;
  /// Largest distance and angle between a wall and the line it is tied to, m
  /// and rad: a line that is wrong by less is tied, and breaks.
  double max_offset = 0.6;
  double max_angle = DegToRad(4.0);
  /// What it takes to believe a place of the plan: length of walls that lie on
  /// lines, m, their share of the length of all walls, and the share of that
  /// which a second place may have at most. Of a plan of a part of the building
  /// it takes a greater length, and a greater share of the walls of that part.
  double min_agreeing_length = 8.0;
  double min_agreeing_share = 0.4;
  double min_agreeing_length_of_part = 20.0;
  double min_agreeing_share_of_part = 0.7;
  double rival_share = 0.85;
  /// Where the plan's frame lies in the map's, roughly: its middle is not
  /// looked for farther away than `max_pose_offset`, m, nor turned by more than
  /// `max_pose_turn`, rad. Of places that look alike this one is meant.
  std::optional<Pose2> plan_pose;
  double max_pose_offset = 3.0;
  double max_pose_turn = DegToRad(45.0);
  /// A line of the plan is called wrong when walls that were let go lie beside
  /// this share of it, or this length, m; less may be furniture in front of
  /// it.
  double min_contradicting_share = 0.5;
  double min_contradicting_length = 3.0;
};

/// What of it holds in a map of another frame: neither the statements, whose
/// points would be those of other walls there, nor the plan's pose. A note says
/// what is not used.
KnownStructure InAnotherFrame(KnownStructure known);

/// Reads statements: a line each, # begins a comment. Points are x,y in the map
/// frame, m.
///
///     same 1.5,2 30,2.1             the walls there lie on one line
///     distance 1.5,2 1.5,14.4 12.40 they are parallel, 12.40 m apart
///     parallel 1.5,2 8,14
///     right_angle 1.5,2 8,14
///
/// and behind it, in any order, `sigma=0.05` (m), `sigma_deg=1` and `hard`.
/// Throws Error with file and line.
std::vector<WallStatement> ReadWallStatements(const std::string& text,
                                              const std::string& name);

/// Puts what is known into the map of a log: hypotheses like those of the
/// detectors, weighed and broken by EM where measurements contradict them.
///
/// The plan is a rigid body with a pose of its own: each wall of the map that
/// lies near a line of it is bound to that pose (pose_segment_collinearity), so
/// that the plan bends the map and is not bent by it. Where the plan lies is
/// found by PlacePlan.
class KnownStructureBinder {
 public:
  /// `first_pose`: the feature that fixes the map frame. All must outlive this.
  KnownStructureBinder(const KnownStructure& known, const Registry& registry,
                       FeatureId first_pose, Graph* graph);

  /// Adds the statements.
  void AddStatements();

  /// Adds statements again that were broken while wrong ones pulled at their
  /// walls and that agree with the map by now, each once. Returns how many.
  int AddStatementsAgain();

  /// Binds walls that lie near lines of the plan, which it places first, to
  /// them. Pairs that were let go are bound again only when they agree by then.
  /// Returns how many.
  int TieToPlan(const std::function<bool()>& stop = nullptr);

  /// What became of it, for people: sentences without a full stop. Whether
  /// measurements contradict what is hard shows only in a graph that
  /// `is_solved` to its least cost.
  std::vector<std::string> Notes(bool is_solved = true) const;

 private:
  struct MapWall;
  struct SideBySide;
  struct LineBeside;
  struct LetGo;
  struct FacePair;
  std::vector<MapWall> Walls() const;
  const MapWall* WallAt(const std::vector<MapWall>& walls,
                        const Eigen::Vector2d& point) const;
  // Places the plan and adds its pose; false, with a note, where there is no
  // place for it.
  bool AddPlan(const std::function<bool()>& stop);
  // How a wall, which has this pose in the plan, lies beside a line of it.
  static SideBySide Compare(const Wall& line, const Wall& wall,
                            const Pose2& in_plan);
  // The line to tie a wall to, which has this pose in the plan.
  std::optional<LineBeside> NearestLine(const MapWall& wall,
                                        const Pose2& in_plan) const;
  // Tolerance of a wall's direction against a line beside this length of it, m
  // and rad: ends of a line that are off by the tolerance turn it, a short one
  // more.
  double SigmaAngle(double length) const;
  Constraint MakeTie(const MapWall& wall, const Pose2& in_plan,
                     const LineBeside& beside) const;
  // Lines of the plan that no wall is tied to, by what walls show of them that
  // were let go from them and have no other line, and walls that were seen
  // behind them. `kept` and `tied`: lines and walls with ties
  // that hold.
  std::map<std::size_t, LetGo> LinesLetGo(
      const std::set<std::size_t>& kept, const std::set<FeatureId>& tied) const;
  // Linearized where the map is, whitened by the tolerances.
  LinearizedConstraint LinearizeNow(const Constraint& statement) const;
  // Whether measurements, or other statements that are hard, contradict one
  // that is, and held all the same.
  bool IsContradicted(const Constraint& statement, Marginals* marginals) const;
  // Adds a word where walls lie beside their lines as if the plan were drawn
  // too large, or too small.
  void NoteScale(std::vector<std::string>* notes) const;
  // Adds what is to be said of them.
  void NoteLinesLetGo(const std::map<std::size_t, LetGo>& let_go,
                      std::vector<std::string>* notes) const;

  // Parts of a line of the plan, along it from its middle, that have another
  // face of a wall beside them, ascending.
  struct Faces {
    std::vector<Interval> left;
    std::vector<Interval> right;
  };
  // What the i-th line has of the k-th beside it, as a wall's two faces lie.
  static std::optional<FacePair> PairUp(const std::vector<Wall>& lines,
                                        std::size_t i, std::size_t k);
  static std::vector<FacePair> FacePairs(const std::vector<Wall>& lines);
  static std::vector<Faces> FacesBeside(const std::vector<Wall>& lines);
  // The side from which a part of a line is seen, as the wall's other face lies
  // on the other: 1 for the left, -1 for the right, 0 where the plan does not
  // tell.
  int SeenFrom(std::size_t line, const Interval& part) const;

  const KnownStructure& known_;
  const Registry& registry_;
  FeatureId first_pose_;
  Graph* graph_;
  // Lines of the plan, and what lies beside each.
  std::vector<Wall> lines_;
  std::vector<Faces> faces_;
  FeatureId plan_pose_ = kNoId;
  bool was_placed_ = false;
  // By wall and line.
  std::map<std::pair<FeatureId, std::size_t>, ConstraintId> ties_;
  // By statement; kNoId where there is no such wall.
  std::vector<ConstraintId> statements_;
  // Those that were added again.
  std::set<std::size_t> added_again_;
  std::vector<std::string> notes_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_KNOWN_STRUCTURE_H_
