#include <plumbline/core/constraint.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/wall.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/plan_placement.h>

#include <algorithm>
#include <cmath>
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
      notes_(known.notes) {}

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
  const RelationType& relation =
      registry_.GetRelation("segment_segment_collinearity");
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

// A line of the plan beside a wall.
struct KnownStructureBinder::LineBeside {
  std::size_t line;
  // Middle of what both have, along the wall, m.
  double at;
};

std::optional<KnownStructureBinder::LineBeside>
KnownStructureBinder::NearestLine(const MapWall& wall,
                                  const Pose2& in_plan) const {
  std::optional<LineBeside> nearest;
  double least = known_.max_offset;
  for (std::size_t i = 0; i < known_.plan.size(); ++i) {
    if (ties_.count({wall.id, i}) > 0) continue;
    const Wall line = MakePlanWall(known_.plan[i]);
    const Pose2 in_line = Between(line.pose(), in_plan);
    if (std::abs(NormalizeAxial(in_line[2])) > known_.max_angle) continue;
    // The part that both have.
    const double sense = std::cos(in_line[2]) < 0.0 ? -1.0 : 1.0;
    double begin = in_line[0] + sense * wall.begin;
    double end = in_line[0] + sense * wall.end;
    if (begin > end) std::swap(begin, end);
    begin = std::max(begin, line.begin);
    end = std::min(end, line.end);
    if (end - begin < 0.5 * std::min(wall.length(), line.length())) continue;
    const double along = sense * (0.5 * (begin + end) - in_line[0]);
    const double offset = std::abs(in_line[1] + along * std::sin(in_line[2]));
    if (offset >= least) continue;
    least = offset;
    nearest = LineBeside{i, along};
  }
  return nearest;
}

Constraint KnownStructureBinder::MakeTie(const MapWall& wall,
                                         const Pose2& in_plan,
                                         const LineBeside& beside) const {
  Pose2 line = MakePlanWall(known_.plan[beside.line]).pose();
  if (std::cos(in_plan[2] - line[2]) < 0.0) {
    line[2] = NormalizeAngle(line[2] + kPi);
  }
  // The plan's origin as the line sees it.
  const Pose2 origin = Inverse(line);
  // The offset is tested where wall and line lie side by side, which is `at`
  // along the wall and so far from the origin along it.
  const double lever = beside.at - Between(in_plan, Pose2(Pose2::Zero()))[0];
  Eigen::Matrix2d rows;
  rows << 1.0, lever, 0.0, 1.0;
  const Eigen::Vector2d weights(std::pow(known_.plan_sigma_offset, -2),
                                std::pow(known_.plan_sigma_angle, -2));
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
    ties_.emplace(pairs[i], added[i]);
  }
  return static_cast<int>(added.size());
}

std::vector<std::string> KnownStructureBinder::Notes() const {
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
  }
  // Lines that no wall has, but one that has no other line lies near.
  std::vector<std::size_t> wrong;
  for (const auto& [pair, id] : ties_) {
    if (kept.count(pair.second) == 0 && tied.count(pair.first) == 0 &&
        std::count(wrong.begin(), wrong.end(), pair.second) == 0) {
      wrong.push_back(pair.second);
    }
  }
  const auto length = [this](std::size_t i) {
    return (known_.plan[i].end - known_.plan[i].begin).norm();
  };
  std::sort(wrong.begin(), wrong.end(), [&](std::size_t a, std::size_t b) {
    return length(a) != length(b) ? length(a) > length(b) : a < b;
  });
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    if (k == kShownLines) {
      notes.push_back("measurements contradict " +
                      std::to_string(wrong.size() - k) +
                      " more lines of the plan");
      break;
    }
    const PlanLine& line = known_.plan[wrong[k]];
    std::string note = "measurements contradict the plan's line from " +
                       Fixed(line.begin.x(), 2) + "," +
                       Fixed(line.begin.y(), 2) + " to " +
                       Fixed(line.end.x(), 2) + "," + Fixed(line.end.y(), 2);
    if (!line.layer.empty()) note += " (" + line.layer + ")";
    notes.push_back(note);
  }
  for (std::size_t i = 0; i < statements_.size(); ++i) {
    if (statements_[i] == kNoId) continue;
    const Constraint* constraint =
        std::as_const(*graph_).FindConstraint(statements_[i]);
    if (constraint != nullptr && constraint->state == ConstraintState::kLive) {
      continue;
    }
    notes.push_back(known_.statements[i].place +
                    ": measurements contradict it, it is broken");
  }
  return notes;
}

}  // namespace plumbline
