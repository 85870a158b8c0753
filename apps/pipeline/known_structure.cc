#include <plumbline/core/constraint.h>
#include <plumbline/core/constraint_evaluation.h>
#include <plumbline/core/error.h>
#include <plumbline/core/information.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/wall.h>
#include <plumbline/factors/chi_square.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/plan_placement.h>
#include <plumbline/pipeline/plan_scale.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <sstream>

namespace plumbline {

// A wall of the map, map frame.
struct KnownStructureBinder::MapWall : Wall {
  FeatureId id = kNoId;
};

namespace {

constexpr char kSource[] = "plan";
constexpr char kStatementSource[] = "statement";

// Shorter walls and lines say little, m.
constexpr double kLeastLength = 0.5;
// The plan's pose is held by its ties; without them by next to nothing, m and
// rad.
constexpr double kLooseDistance = 100.0;
constexpr double kLooseTurn = 1.0;
// A statement names the wall nearest to a point within this, m.
constexpr double kNearestWall = 1.0;
// Two lines of the plan that run beside each other, so far apart, m, are the
// faces of one wall, and what lies between them is its body.
constexpr double kLeastThickness = 0.04;
constexpr double kMostThickness = 0.5;
constexpr double kSameThickness = 0.02;
constexpr double kParallel = DegToRad(1.0);
// A part of a face has its body on a side where so much of it has another face
// there, at least, and so little on the other side, at most.
constexpr double kBesideBody = 0.5;
constexpr double kBesideNone = 0.2;
// No two walls are farther apart than so many sizes of the map, however it is
// bent. A statement like that tears walls so far away that they do not find
// back.
constexpr double kMostDistance = 2.0;
// Chi-square with two degrees of freedom, exceeded by one in ten, up to which a
// wall that was let go from a line is tied to it again.
constexpr double kAgreeing = 4.6;
// Smaller turns, rad, are linear.
constexpr double kSmallTurn = 1e-4;
// A line that lies this far in front of a wall, m, more than the map may be
// off, was looked through by who saw the wall.
constexpr double kInFront = 0.1;
// A hard statement is told when what the map alone would say is so unlikely
// beside it. Rarer than what breaks: a map is off by more than its covariances
// say, and tolerances of what is hard are small.
constexpr double kContradicted = 1e-4;
// Share of a statement's variance that is left for others to be checked by:
// less is not known from numbers like these.
constexpr double kLeastRedundancy = 1e-6;
// A scale of the plan that is off by more of its standard errors is told where
// it puts a wall beside its line by more tolerances than that.
constexpr double kSureErrors = 5.0;
constexpr double kMostTolerances = 2.0;
// Lines of the plan that notes list, longest first.
constexpr std::size_t kShownLines = 8;

double AsNumber(const std::string& text, bool* is_good) {
  double value = 0.0;
  *is_good = *is_good && ParseNumber(text, &value) && std::isfinite(value);
  return value;
}

std::string Fixed(double value, int decimals) {
  std::string text;
  AppendFixed(value, decimals, &text);
  return text;
}

// Diagonal of a box around walls, m.
template <typename AnyWall>
double SizeOf(const std::vector<AnyWall>& walls) {
  Eigen::AlignedBox2d box;
  for (const Wall& wall : walls) {
    box.extend(wall.At(wall.begin));
    box.extend(wall.At(wall.end));
  }
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

std::vector<Wall> PlanWalls(const std::vector<PlanLine>& plan) {
  std::vector<Wall> walls;
  walls.reserve(plan.size());
  for (const PlanLine& line : plan) walls.push_back(MakePlanWall(line));
  return walls;
}

// "x,y"
bool ParsePoint(const std::string& text, Eigen::Vector2d* point) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return false;
  bool is_good = true;
  point->x() = AsNumber(text.substr(0, comma), &is_good);
  point->y() = AsNumber(text.substr(comma + 1), &is_good);
  return is_good && point->cwiseAbs().maxCoeff() < 1e7;
}

}  // namespace

KnownStructure InAnotherFrame(KnownStructure known) {
  if (!known.statements.empty()) {
    known.notes.push_back(
        "statements on walls are not used in this map: their points are in "
        "the frame of another one");
  }
  if (known.plan_pose) {
    known.notes.push_back(
        "the pose of the plan that was given is not used in this map: it is "
        "one in the frame of another");
  }
  known.statements.clear();
  known.plan_pose.reset();
  return known;
}

std::vector<WallStatement> ReadWallStatements(const std::string& text,
                                              const std::string& name) {
  std::vector<WallStatement> statements;
  std::istringstream lines(text);
  std::string line;
  int number = 0;
  while (std::getline(lines, line)) {
    ++number;
    line = line.substr(0, line.find('#'));
    std::istringstream stream(line);
    std::vector<std::string> words;
    std::string word;
    while (stream >> word) words.push_back(word);
    if (words.empty()) continue;
    const auto refuse = [&](const std::string& what) {
      throw Error(name, number, what,
                  "same|parallel|right_angle X,Y X,Y or distance X,Y X,Y "
                  "METRES, then sigma=METRES, sigma_deg=DEGREES or hard");
    };
    WallStatement statement;
    statement.place = name + ":" + std::to_string(number);
    if (words[0] == "same") {
      statement.kind = WallStatement::Kind::kSame;
    } else if (words[0] == "distance") {
      statement.kind = WallStatement::Kind::kDistance;
    } else if (words[0] == "parallel") {
      statement.kind = WallStatement::Kind::kParallel;
    } else if (words[0] == "right_angle") {
      statement.kind = WallStatement::Kind::kRightAngle;
    } else {
      refuse("'" + words[0] + "' is no statement");
    }
    if (words.size() < 3 || !ParsePoint(words[1], &statement.first) ||
        !ParsePoint(words[2], &statement.second)) {
      refuse("'" + words[0] + "' without two points");
    }
    std::size_t next = 3;
    bool is_good = true;
    if (statement.kind == WallStatement::Kind::kDistance) {
      if (words.size() < 4) refuse("a distance without metres");
      statement.distance = AsNumber(words[next++], &is_good);
      if (!is_good || !(statement.distance > 0.0) || statement.distance > 1e5) {
        refuse("'" + words[3] + "' is no distance");
      }
    }
    for (; next < words.size(); ++next) {
      const std::string& option = words[next];
      if (option == "hard") {
        statement.is_hard = true;
      } else if (option.substr(0, 6) == "sigma=") {
        statement.sigma_offset = AsNumber(option.substr(6), &is_good);
      } else if (option.substr(0, 10) == "sigma_deg=") {
        statement.sigma_angle = DegToRad(AsNumber(option.substr(10), &is_good));
      } else {
        is_good = false;
      }
      if (!is_good || !(statement.sigma_offset >= 1e-4) ||
          !(statement.sigma_angle >= DegToRad(1e-3)) ||
          statement.sigma_offset > 100.0 || statement.sigma_angle > kPi) {
        refuse("'" + option + "' is not understood");
      }
    }
    statements.push_back(std::move(statement));
  }
  return statements;
}

KnownStructureBinder::KnownStructureBinder(const KnownStructure& known,
                                           const Registry& registry,
                                           FeatureId first_pose, Graph* graph)
    : known_(known),
      registry_(registry),
      first_pose_(first_pose),
      graph_(graph),
      lines_(PlanWalls(known.plan)),
      faces_(FacesBeside(lines_)),
      notes_(known.notes) {}

// A part of a line that has another one beside it.
struct KnownStructureBinder::FacePair {
  std::size_t line;
  std::size_t other;
  Interval part;
  // To the left.
  double across;
  double thickness() const { return std::abs(across); }
  bool Has(std::size_t i) const { return line == i || other == i; }
};

std::optional<KnownStructureBinder::FacePair> KnownStructureBinder::PairUp(
    const std::vector<Wall>& lines, std::size_t i, std::size_t k) {
  const Wall& line = lines[i];
  const Wall& other = lines[k];
  if (std::abs(NormalizeAxial(line.angle - other.angle)) > kParallel) {
    return std::nullopt;
  }
  Interval part = line.IntervalOf(other);
  part = {std::max(part.first, line.begin), std::min(part.second, line.end)};
  if (part.second <= part.first) return std::nullopt;
  // Where they lie beside each other: far off a small turn is much.
  const Eigen::Vector2d middle = line.At(0.5 * (part.first + part.second));
  const FacePair pair = {i, k, part,
                         line.Across(other.At(other.Along(middle)))};
  if (pair.thickness() < kLeastThickness || pair.thickness() > kMostThickness) {
    return std::nullopt;
  }
  return pair;
}

std::vector<KnownStructureBinder::FacePair> KnownStructureBinder::FacePairs(
    const std::vector<Wall>& lines) {
  // From left to right, so that a line is compared with those that lie above
  // or below it and not with all: a drawing has up to twenty thousand.
  struct Box {
    std::size_t line;
    Eigen::Vector2d low;
    Eigen::Vector2d high;
  };
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Eigen::Vector2d begin = lines[i].At(lines[i].begin);
    const Eigen::Vector2d end = lines[i].At(lines[i].end);
    boxes.push_back({i, begin.cwiseMin(end), begin.cwiseMax(end)});
  }
  std::sort(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) {
    return a.low.x() != b.low.x() ? a.low.x() < b.low.x() : a.line < b.line;
  });
  std::vector<FacePair> pairs;
  for (auto box = boxes.begin(); box != boxes.end(); ++box) {
    for (auto next = std::next(box);
         next != boxes.end() && next->low.x() <= box->high.x() + kMostThickness;
         ++next) {
      if (next->low.y() > box->high.y() + kMostThickness ||
          box->low.y() > next->high.y() + kMostThickness) {
        continue;
      }
      for (const auto& [i, k] : {std::pair(box->line, next->line),
                                 std::pair(next->line, box->line)}) {
        if (const auto pair = PairUp(lines, i, k)) pairs.push_back(*pair);
      }
    }
  }
  return pairs;
}

std::vector<KnownStructureBinder::Faces> KnownStructureBinder::FacesBeside(
    const std::vector<Wall>& lines) {
  const std::vector<FacePair> pairs = FacePairs(lines);
  std::vector<const FacePair*> by_thickness;
  for (const FacePair& pair : pairs) by_thickness.push_back(&pair);
  std::sort(by_thickness.begin(), by_thickness.end(),
            [](const FacePair* a, const FacePair* b) {
              return a->thickness() < b->thickness();
            });
  // A line that is wrong makes a wall of a thickness that no other one has.
  const auto is_usual = [&by_thickness](const FacePair& pair) {
    auto same = std::lower_bound(
        by_thickness.begin(), by_thickness.end(),
        pair.thickness() - kSameThickness,
        [](const FacePair* a, double least) { return a->thickness() < least; });
    for (; same != by_thickness.end() &&
           (*same)->thickness() <= pair.thickness() + kSameThickness;
         ++same) {
      if (!(*same)->Has(pair.line) && !(*same)->Has(pair.other)) return true;
    }
    return false;
  };
  std::vector<Faces> all(lines.size());
  for (const FacePair& pair : pairs) {
    if (!is_usual(pair)) continue;
    Faces& faces = all[pair.line];
    (pair.across > 0.0 ? faces.left : faces.right).push_back(pair.part);
  }
  for (Faces& faces : all) {
    std::sort(faces.left.begin(), faces.left.end());
    std::sort(faces.right.begin(), faces.right.end());
  }
  return all;
}

int KnownStructureBinder::SeenFrom(std::size_t line,
                                   const Interval& part) const {
  // Of intervals in ascending order, which may overlap.
  const auto share = [&part](const std::vector<Interval>& intervals) {
    double covered = 0.0;
    double end = part.first;
    for (const Interval& interval : intervals) {
      const double begin = std::max(end, interval.first);
      end = std::max(end, std::min(part.second, interval.second));
      covered += std::max(0.0, end - begin);
    }
    return covered / (part.second - part.first);
  };
  const double left = share(faces_[line].left);
  const double right = share(faces_[line].right);
  if (right >= kBesideBody && left <= kBesideNone) return 1;
  if (left >= kBesideBody && right <= kBesideNone) return -1;
  return 0;
}

std::vector<KnownStructureBinder::MapWall> KnownStructureBinder::Walls() const {
  const FeatureType& segment = registry_.GetFeature("segment");
  std::vector<MapWall> walls;
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    if (feature->type != &segment || feature->level != 0) continue;
    const Wall wall = *WallOf(*feature);
    if (std::isfinite(wall.length()) && wall.length() >= kLeastLength) {
      walls.push_back({wall, feature->id});
    }
  }
  return walls;
}

const KnownStructureBinder::MapWall* KnownStructureBinder::WallAt(
    const std::vector<MapWall>& walls, const Eigen::Vector2d& point) const {
  const MapWall* nearest = nullptr;
  double least = kNearestWall;
  for (const MapWall& wall : walls) {
    const double along = wall.Along(point);
    const double beyond = std::max({0.0, wall.begin - along, along - wall.end});
    const double distance = std::hypot(beyond, wall.Across(point));
    if (distance >= least) continue;
    least = distance;
    nearest = &wall;
  }
  return nearest;
}

void KnownStructureBinder::AddStatements() {
  const std::vector<MapWall> walls = Walls();
  // Not the relation by which two walls are one: what is in line, parallel or
  // some distance apart stays two.
  const RelationType& relation =
      registry_.GetRelation("segment_segment_offset");
  const double size = SizeOf(walls);
  for (const WallStatement& statement : known_.statements) {
    const MapWall* const first = WallAt(walls, statement.first);
    const MapWall* const second = WallAt(walls, statement.second);
    statements_.push_back(kNoId);
    if (first == nullptr || second == nullptr || first == second) {
      const Eigen::Vector2d& point =
          first == nullptr ? statement.first : statement.second;
      notes_.push_back(statement.place +
                       (first != nullptr && first == second
                            ? std::string(": both points are at one wall")
                            : ": there is no wall within 1 m of " +
                                  Fixed(point.x(), 2) + "," +
                                  Fixed(point.y(), 2)));
      continue;
    }
    if (statement.kind == WallStatement::Kind::kDistance &&
        statement.distance > kMostDistance * size) {
      notes_.push_back(statement.place + ": the whole map is only " +
                       Fixed(size, 1) +
                       " m large, the distance is of another unit; it is not "
                       "used");
      continue;
    }
    // Walls have a direction: the one may run against the other.
    const Pose2 between = Between(first->pose(), second->pose());
    const bool is_right = statement.kind == WallStatement::Kind::kRightAngle;
    const double angle = is_right
                             ? std::copysign(0.5 * kPi, std::sin(between[2]))
                             : (std::cos(between[2]) < 0.0 ? kPi : 0.0);
    double offset = 0.0;
    if (statement.kind == WallStatement::Kind::kDistance) {
      offset = std::copysign(statement.distance, between[1]);
    }
    const bool has_offset = statement.kind == WallStatement::Kind::kSame ||
                            statement.kind == WallStatement::Kind::kDistance;
    // The offset is that of the second wall's middle, not of its position.
    const double lever = std::cos(angle) * 0.5 * (second->begin + second->end);
    Eigen::Matrix2d rows;
    rows << 1.0, lever, 0.0, 1.0;
    const Eigen::Vector2d weights(
        has_offset ? std::pow(statement.sigma_offset, -2) : 0.0,
        std::pow(statement.sigma_angle, -2));
    const Eigen::Matrix2d information =
        rows.transpose() * weights.asDiagonal() * rows;
    const Eigen::Vector2d expected(offset, angle);
    Constraint constraint =
        statement.is_hard
            ? MakeMeasurement(relation, {first->id, second->id}, expected,
                              information, kStatementSource)
            : MakeStructure(relation, {first->id, second->id}, expected,
                            information, kStatementSource);
    constraint.break_below = known_.break_below;
    Transaction transaction;
    transaction.AddConstraint(std::move(constraint));
    statements_.back() =
        graph_->Apply(std::move(transaction)).constraints.front();
  }
}

LinearizedConstraint KnownStructureBinder::LinearizeNow(
    const Constraint& statement) const {
  const Graph& graph = *graph_;
  const auto cost = MakeCost(statement, SqrtInformation(statement.information),
                             FeaturesOf(graph, statement));
  return Linearize(graph, statement, *cost);
}

int KnownStructureBinder::AddStatementsAgain() {
  Transaction transaction;
  std::vector<std::size_t> again;
  for (std::size_t i = 0; i < statements_.size(); ++i) {
    const Constraint* const broken =
        statements_[i] == kNoId
            ? nullptr
            : std::as_const(*graph_).FindConstraint(statements_[i]);
    if (broken == nullptr || broken->state == ConstraintState::kLive ||
        added_again_.count(i) > 0 ||
        LinearizeNow(*broken).residual.squaredNorm() > kAgreeing) {
      continue;
    }
    Constraint constraint =
        MakeStructure(*broken->type, broken->features, broken->expected,
                      broken->information, kStatementSource);
    constraint.break_below = known_.break_below;
    transaction.AddConstraint(std::move(constraint));
    again.push_back(i);
  }
  if (again.empty()) return 0;
  const std::vector<ConstraintId> added =
      graph_->Apply(std::move(transaction)).constraints;
  for (std::size_t k = 0; k < again.size(); ++k) {
    statements_[again[k]] = added[k];
    added_again_.insert(again[k]);
  }
  return static_cast<int>(again.size());
}

bool KnownStructureBinder::AddPlan(const std::function<bool()>& stop) {
  const std::vector<MapWall> walls = Walls();
  const PlanPlacement placement =
      PlacePlan(known_, std::vector<Wall>(walls.begin(), walls.end()), stop);
  if (!placement.note.empty()) notes_.push_back(placement.note);
  if (!placement.map_in_plan) return false;
  const Pose2 pose = Inverse(*placement.map_in_plan);
  Transaction transaction;
  Feature feature;
  feature.type = &registry_.GetFeature("pose");
  feature.parameters = {pose[0], pose[1], pose[2]};
  feature.source = kSource;
  const FeatureId provisional = transaction.AddFeature(feature);
  const Feature& first = graph_->GetFeature(first_pose_);
  const Pose2 from(first.parameters[0], first.parameters[1],
                   first.parameters[2]);
  transaction.AddConstraint(
      MakeMeasurement(registry_.GetRelation("pose_pose"),
                      {first_pose_, provisional}, Between(from, pose),
                      InformationFromSigmas(Eigen::Vector3d(
                          kLooseDistance, kLooseDistance, kLooseTurn)),
                      kSource));
  plan_pose_ = graph_->Apply(std::move(transaction)).features.front();
  return true;
}

// How a wall lies beside a line of the plan. m and rad.
struct KnownStructureBinder::SideBySide {
  // What both have, along the line from its middle; its length, m, is negative
  // for the gap between them.
  Interval part;
  double length = 0.0;
  // 1, or -1 where the wall's direction runs against the line's.
  int sense = 1;
  // The middle of that, along the wall from its position.
  double along_wall = 0.0;
  // How far off the wall lies there, to either side, and how far it is turned.
  double offset = 0.0;
  // How far in front of the wall the line lies there, as who saw it looks.
  double in_front = 0.0;
  double turn = 0.0;
};

KnownStructureBinder::SideBySide KnownStructureBinder::Compare(
    const Wall& line, const Wall& wall, const Pose2& in_plan) {
  const Pose2 in_line = Between(line.pose(), in_plan);
  // Walls have a direction: it may run against the line.
  const double sense = std::cos(in_line[2]) < 0.0 ? -1.0 : 1.0;
  double begin = in_line[0] + sense * wall.begin;
  double end = in_line[0] + sense * wall.end;
  if (begin > end) std::swap(begin, end);
  begin = std::max(begin, line.begin);
  end = std::min(end, line.end);
  SideBySide both;
  both.part = {begin, end};
  both.sense = sense < 0.0 ? -1 : 1;
  both.length = end - begin;
  both.along_wall = sense * (0.5 * (begin + end) - in_line[0]);
  const double across = in_line[1] + both.along_wall * std::sin(in_line[2]);
  both.offset = std::abs(across);
  both.in_front = -sense * across;
  both.turn = std::abs(NormalizeAxial(in_line[2]));
  return both;
}

// A line of the plan beside a wall.
struct KnownStructureBinder::LineBeside {
  std::size_t line;
  SideBySide both;
};

std::optional<KnownStructureBinder::LineBeside>
KnownStructureBinder::NearestLine(const MapWall& wall,
                                  const Pose2& in_plan) const {
  std::optional<LineBeside> nearest;
  double least = known_.max_offset;
  for (std::size_t i = 0; i < known_.plan.size(); ++i) {
    const Wall& line = lines_[i];
    const SideBySide both = Compare(line, wall, in_plan);
    if (both.turn > known_.max_angle || both.offset >= least ||
        both.length < 0.5 * std::min(wall.length(), line.length())) {
      continue;
    }
    // The other face of its wall: nobody sees it from there.
    if (SeenFrom(i, both.part) == -both.sense) continue;
    // Let go while a wrong tie pulled at the plan, or before its neighbours had
    // pulled it near, it may agree by now.
    const double chi_square =
        std::pow(both.offset / known_.plan_sigma_offset, 2) +
        std::pow(both.turn / SigmaAngle(both.length), 2);
    if (chi_square > kAgreeing && ties_.count({wall.id, i}) > 0) continue;
    least = both.offset;
    nearest = LineBeside{i, both};
  }
  return nearest;
}

double KnownStructureBinder::SigmaAngle(double length) const {
  return std::hypot(known_.plan_sigma_angle,
                    std::sqrt(2.0) * known_.plan_sigma_offset / length);
}

Constraint KnownStructureBinder::MakeTie(const MapWall& wall,
                                         const Pose2& in_plan,
                                         const LineBeside& beside) const {
  Pose2 line = lines_[beside.line].pose();
  if (std::cos(in_plan[2] - line[2]) < 0.0) {
    line[2] = NormalizeAngle(line[2] + kPi);
  }
  // The plan's origin as the line sees it.
  const Pose2 origin = Inverse(line);
  // The offset is tested where wall and line lie side by side, and so far from
  // the origin along the wall. Far from there what a turn does is not linear: a
  // wall of 1 m that is off by 3 degrees would be off by 0.1 m as well, as seen
  // from 80 m away. As the wall stands now the offset is right.
  const Pose2 seen = Between(in_plan, Pose2(Pose2::Zero()));
  const double turn = NormalizeAngle(seen[2] - origin[2]);
  const double lever =
      std::abs(turn) < kSmallTurn
          ? beside.both.along_wall - seen[0]
          : (beside.both.in_front - (seen[1] - origin[1])) / turn;
  Eigen::Matrix2d rows;
  rows << 1.0, lever, 0.0, 1.0;
  const Eigen::Vector2d weights(std::pow(known_.plan_sigma_offset, -2),
                                std::pow(SigmaAngle(beside.both.length), -2));
  Constraint tie = MakeStructure(
      registry_.GetRelation("pose_segment_collinearity"), {plan_pose_, wall.id},
      Eigen::Vector2d(origin[1], origin[2]),
      rows.transpose() * weights.asDiagonal() * rows, kSource);
  tie.break_below = known_.break_below;
  return tie;
}

int KnownStructureBinder::TieToPlan(const std::function<bool()>& stop) {
  if (known_.plan.empty()) return 0;
  if (!was_placed_) {
    was_placed_ = true;
    if (!AddPlan(stop)) return 0;
  }
  if (plan_pose_ == kNoId) return 0;
  const Feature& plan = graph_->GetFeature(plan_pose_);
  const Pose2 plan_pose(plan.parameters[0], plan.parameters[1],
                        plan.parameters[2]);
  std::set<FeatureId> tied;
  for (const auto& [pair, id] : ties_) {
    const Constraint* tie = std::as_const(*graph_).FindConstraint(id);
    if (tie != nullptr && tie->state == ConstraintState::kLive) {
      tied.insert(pair.first);
    }
  }
  Transaction transaction;
  std::vector<std::pair<FeatureId, std::size_t>> pairs;
  for (const MapWall& wall : Walls()) {
    if (tied.count(wall.id) > 0) continue;
    const Pose2 in_plan = Between(plan_pose, wall.pose());
    const std::optional<LineBeside> beside = NearestLine(wall, in_plan);
    if (!beside) continue;
    transaction.AddConstraint(MakeTie(wall, in_plan, *beside));
    pairs.emplace_back(wall.id, beside->line);
  }
  const std::vector<ConstraintId> added =
      graph_->Apply(std::move(transaction)).constraints;
  for (std::size_t i = 0; i < added.size(); ++i) {
    ties_[pairs[i]] = added[i];
  }
  return static_cast<int>(added.size());
}

// A line of the plan that no wall is tied to, and what was let go from it or
// seen behind it.
struct KnownStructureBinder::LetGo {
  // Its length that walls lie beside, m.
  double beside = 0.0;
  // The longest of these parts.
  SideBySide longest;
};

std::map<std::size_t, KnownStructureBinder::LetGo>
KnownStructureBinder::LinesLetGo(const std::set<std::size_t>& kept,
                                 const std::set<FeatureId>& tied) const {
  std::map<std::size_t, LetGo> let_go;
  if (plan_pose_ == kNoId) return let_go;
  const Feature& plan = std::as_const(*graph_).GetFeature(plan_pose_);
  const Pose2 plan_pose(plan.parameters[0], plan.parameters[1],
                        plan.parameters[2]);
  for (const MapWall& wall : Walls()) {
    const Pose2 in_plan = Between(plan_pose, wall.pose());
    for (std::size_t i = 0; i < known_.plan.size(); ++i) {
      if (kept.count(i) > 0) continue;
      SideBySide both = Compare(lines_[i], wall, in_plan);
      const bool was_let_go =
          tied.count(wall.id) == 0 && ties_.count({wall.id, i}) > 0;
      // Who saw the wall looked through the line.
      const bool is_through =
          both.length > 0.0 && both.turn < known_.max_angle &&
          both.in_front > kInFront && both.in_front < known_.max_offset;
      if (!was_let_go && !is_through) continue;
      both.length = std::max(0.0, both.length);
      LetGo& line = let_go[i];
      line.beside += both.length;
      if (both.length >= line.longest.length) line.longest = both;
    }
  }
  return let_go;
}

// Ties bend the map to a plan that is drawn too large, and each is off by
// little; but the farther from the middle, the more.
void KnownStructureBinder::NoteScale(std::vector<std::string>* notes) const {
  const Feature& plan = std::as_const(*graph_).GetFeature(plan_pose_);
  const Pose2 plan_pose(plan.parameters[0], plan.parameters[1],
                        plan.parameters[2]);
  std::map<FeatureId, MapWall> walls;
  for (const MapWall& wall : Walls()) walls.emplace(wall.id, wall);
  std::vector<WallBesideLine> beside;
  for (const auto& [pair, id] : ties_) {
    const Constraint* tie = std::as_const(*graph_).FindConstraint(id);
    const auto wall = walls.find(pair.first);
    if (tie == nullptr || tie->state != ConstraintState::kLive ||
        wall == walls.end()) {
      continue;
    }
    const Wall& line = lines_[pair.second];
    const Pose2 in_plan = Between(plan_pose, wall->second.pose());
    const SideBySide both = Compare(line, wall->second, in_plan);
    const Eigen::Vector2d point =
        PoseTransform(in_plan).Point(Eigen::Vector2d(both.along_wall, 0.0));
    beside.push_back({point, line.normal(), line.Across(point)});
  }
  const std::optional<PlanScale> scale = FindPlanScale(beside);
  if (!scale ||
      scale->most_offset <= kMostTolerances * known_.plan_sigma_offset ||
      std::abs(scale->excess) <= kSureErrors * scale->sigma) {
    return;
  }
  notes->push_back(
      "the walls that are tied to the plan lie beside its lines as if it were "
      "drawn too " +
      std::string(scale->excess > 0.0 ? "large" : "small") + ", by " +
      Fixed(100.0 * std::abs(scale->excess), 2) + " % at least (+-" +
      Fixed(100.0 * scale->sigma, 2) +
      "): its scale is off, and bends the map, or the map's is");
}

void KnownStructureBinder::NoteLinesLetGo(
    const std::map<std::size_t, LetGo>& let_go,
    std::vector<std::string>* notes) const {
  const auto length = [this](std::size_t i) {
    return (known_.plan[i].end - known_.plan[i].begin).norm();
  };
  // Those that walls cover enough of, and those that something else may hide.
  std::vector<std::size_t> wrong;
  std::vector<std::size_t> hidden;
  for (const auto& [i, line] : let_go) {
    const bool is_covered =
        line.beside >= std::min(known_.min_contradicting_length,
                                known_.min_contradicting_share * length(i));
    (is_covered ? wrong : hidden).push_back(i);
  }
  for (std::vector<std::size_t>* lines : {&wrong, &hidden}) {
    std::sort(lines->begin(), lines->end(), [&](std::size_t a, std::size_t b) {
      return length(a) != length(b) ? length(a) > length(b) : a < b;
    });
    const bool is_wrong = lines == &wrong;
    for (std::size_t k = 0; k < lines->size(); ++k) {
      if (k == kShownLines) {
        notes->push_back((is_wrong ? "measurements contradict "
                                   : "only walls off them were seen beside ") +
                         std::to_string(lines->size() - k) +
                         " more lines of the plan");
        break;
      }
      const PlanLine& line = known_.plan[(*lines)[k]];
      const LetGo& off = let_go.at((*lines)[k]);
      std::string name = "the plan's line from " + Fixed(line.begin.x(), 2) +
                         "," + Fixed(line.begin.y(), 2) + " to " +
                         Fixed(line.end.x(), 2) + "," + Fixed(line.end.y(), 2);
      if (!line.layer.empty()) name += " (" + line.layer + ")";
      const std::string offset = Fixed(off.longest.offset, 2);
      notes->push_back(
          is_wrong
              ? "measurements contradict " + name + ": the wall there lies " +
                    offset + " m beside it, turned by " +
                    Fixed(RadToDeg(off.longest.turn), 1) + " degrees"
              : "beside " + name + " only " + Fixed(off.beside, 1) +
                    " m of wall were seen, " + offset +
                    " m off it: furniture, another face, or the line is "
                    "wrong");
    }
  }
}

// A tight statement pulls the walls to where it says, and its residual is small
// whatever the measurements say. How far it had to pull shows beside how much
// of the map it tells by itself: with the whitened residual r and the
// covariance C of what the map says by now, whitened the same way, r' (I -
// C)^-1 r is the chi-square of the statement against the map without it.
bool KnownStructureBinder::IsContradicted(const Constraint& statement,
                                          Marginals* marginals) const {
  const LinearizedConstraint at = LinearizeNow(statement);
  // Of parallel walls nothing is said but the angle.
  const int rank = InformationRank(statement.information);
  if (ChiSquarePValue(at.residual.squaredNorm(), rank) < known_.break_below) {
    return true;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> by_map(
      marginals->PropagatedCovariance(statement.features, at.jacobians));
  const Eigen::Array2d parts =
      (by_map.eigenvectors().transpose() * at.residual).array().square();
  const Eigen::Array2d left =
      (1.0 - by_map.eigenvalues().array()).max(kLeastRedundancy);
  return ChiSquarePValue((parts / left).sum(), rank) < kContradicted;
}

std::vector<std::string> KnownStructureBinder::Notes(bool is_solved) const {
  std::vector<std::string> notes = notes_;
  std::set<std::size_t> kept;
  std::set<FeatureId> tied;
  for (const auto& [pair, id] : ties_) {
    const Constraint* tie = std::as_const(*graph_).FindConstraint(id);
    if (tie == nullptr || tie->state != ConstraintState::kLive) continue;
    kept.insert(pair.second);
    tied.insert(pair.first);
  }
  if (plan_pose_ != kNoId) {
    const Feature& plan = std::as_const(*graph_).GetFeature(plan_pose_);
    notes.push_back(std::to_string(tied.size()) + " walls are tied to " +
                    std::to_string(kept.size()) +
                    " lines of the plan, whose origin is at " +
                    Fixed(plan.parameters[0], 3) + "," +
                    Fixed(plan.parameters[1], 3) + ", turned by " +
                    Fixed(RadToDeg(plan.parameters[2]), 3) + " degrees");
    NoteScale(&notes);
  }
  NoteLinesLetGo(LinesLetGo(kept, tied), &notes);
  // Made for the first hard statement: most files have none.
  std::optional<Marginals> marginals;
  for (std::size_t i = 0; i < statements_.size(); ++i) {
    if (statements_[i] == kNoId) continue;
    const Constraint* constraint =
        std::as_const(*graph_).FindConstraint(statements_[i]);
    if (constraint != nullptr && constraint->state == ConstraintState::kLive) {
      if (!known_.statements[i].is_hard || !is_solved) continue;
      if (!marginals) marginals.emplace(std::as_const(*graph_));
      if (IsContradicted(*constraint, &*marginals)) {
        notes.push_back(known_.statements[i].place +
                        ": measurements contradict it, it is hard and holds");
      }
      continue;
    }
    notes.push_back(known_.statements[i].place +
                    ": measurements contradict it, it is broken");
  }
  return notes;
}

}  // namespace plumbline
