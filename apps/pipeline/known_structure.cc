#include <plumbline/core/constraint.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/frontend/scan_matcher.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/pipeline/known_structure.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>
#include <sstream>

namespace plumbline {

// A wall of the map.
struct KnownStructureBinder::Wall {
  FeatureId id = kNoId;
  // Its position and direction, and its visible part along it, map frame.
  Pose2 pose = Pose2::Zero();
  double begin = 0.0;
  double end = 0.0;
  double length() const { return end - begin; }
  Eigen::Vector2d At(double along) const {
    return PoseTransform(pose).Point(Eigen::Vector2d(along, 0.0));
  }
};

namespace {

constexpr char kSource[] = "plan";
constexpr char kStatementSource[] = "statement";

// Shorter walls and lines say little, m.
constexpr double kLeastLength = 0.5;
// Points along lines of the plan, along walls in the search, and along walls
// when a place is judged, lie so far apart, m.
constexpr double kLineSpacing = 0.1;
constexpr double kSearchSpacing = 0.4;
constexpr double kJudgeSpacing = 0.5;
// Walls within this of a middle, m, are looked for together; middles lie so far
// apart, m, and there are so many at most.
constexpr double kPartRadius = 12.0;
constexpr double kPartSpacing = 8.0;
constexpr std::size_t kMostParts = 8;
constexpr double kLeastScore = 0.5;
// They are looked for at turns that give the walls of the map directions of the
// plan: those with this share of what the best turn has, and this much, rad, to
// either side.
constexpr double kSameDirection = DegToRad(15.0);
constexpr double kTurnShare = 0.25;
constexpr double kTurnWindow = DegToRad(3.0);
constexpr double kScoreShare = 0.8;
constexpr int kMostPeaks = 8;
// A wall lies on a line within this, m and rad; and while a place is refined,
// from far to near.
constexpr double kAgreeDistance = 0.15;
constexpr double kAgreeAngle = DegToRad(5.0);
constexpr double kRefineDistances[] = {0.8, 0.5, 0.3, 0.3, 0.2, 0.2};
// Two places of the plan are one when they are so near, m and rad.
constexpr double kSamePlace = 1.5;
constexpr double kSameTurn = DegToRad(8.0);
// A place that is found again, from another part: m and rad.
constexpr double kKnownDistance = 0.4;
constexpr double kKnownTurn = DegToRad(2.0);
// Directions of agreeing walls have to differ by this, rad.
constexpr double kLeastSpread = DegToRad(25.0);
// Lines reach so far beyond their ends, m.
constexpr double kOverhang = 0.2;
// The plan's pose is held by its ties; without them by next to nothing, m and
// rad.
constexpr double kLooseDistance = 100.0;
constexpr double kLooseTurn = 1.0;
// A statement names the wall nearest to a point within this, m.
constexpr double kNearestWall = 1.0;
// Lines of the plan that notes list, longest first.
constexpr std::size_t kShownLines = 8;

// A line as a pose at its middle, and half its length.
struct LineFrame {
  Pose2 pose = Pose2::Zero();
  double half = 0.0;
  // Unit vector.
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();
};

LineFrame FrameOf(const PlanLine& line) {
  const Eigen::Vector2d along = line.end - line.begin;
  const Eigen::Vector2d middle = 0.5 * (line.begin + line.end);
  const double length = along.norm();
  return {Pose2(middle.x(), middle.y(), std::atan2(along.y(), along.x())),
          0.5 * length, along / length};
}

// Difference of two directions without sense, in [0, pi/2].
double AngleBetween(double a, double b) {
  return std::abs(std::remainder(a - b, kPi));
}

double AsNumber(const std::string& text, bool* is_good) {
  double value = 0.0;
  *is_good = *is_good && ParseNumber(text, &value) && std::isfinite(value);
  return value;
}

std::string Text(const char* format, double a, double b, double c, double d) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b, c, d);
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

std::vector<KnownStructureBinder::Wall> KnownStructureBinder::Walls() const {
  const FeatureType& segment = registry_.GetFeature("segment");
  std::vector<Wall> walls;
  for (const Feature* feature : std::as_const(*graph_).Features()) {
    if (feature->type != &segment || feature->level != 0) continue;
    Wall wall;
    wall.id = feature->id;
    wall.pose = Pose2(feature->parameters[0], feature->parameters[1],
                      feature->parameters[2]);
    wall.begin = feature->extent_begin;
    wall.end = feature->extent_end;
    if (std::isfinite(wall.length()) && wall.length() >= kLeastLength) {
      walls.push_back(wall);
    }
  }
  return walls;
}

const KnownStructureBinder::Wall* KnownStructureBinder::WallAt(
    const std::vector<Wall>& walls, const Eigen::Vector2d& point) const {
  const Wall* nearest = nullptr;
  double least = kNearestWall;
  for (const Wall& wall : walls) {
    const Eigen::Vector2d local =
        PoseTransform(Inverse(wall.pose)).Point(point);
    const double beyond =
        std::max({0.0, wall.begin - local.x(), local.x() - wall.end});
    const double distance = std::hypot(beyond, local.y());
    if (distance >= least) continue;
    least = distance;
    nearest = &wall;
  }
  return nearest;
}

void KnownStructureBinder::AddStatements() {
  const std::vector<Wall> walls = Walls();
  const RelationType& relation =
      registry_.GetRelation("segment_segment_collinearity");
  for (const WallStatement& statement : known_.statements) {
    const Wall* const first = WallAt(walls, statement.first);
    const Wall* const second = WallAt(walls, statement.second);
    statements_.push_back(kNoId);
    if (first == nullptr || second == nullptr || first == second) {
      const Eigen::Vector2d& point =
          first == nullptr ? statement.first : statement.second;
      notes_.push_back(statement.place +
                       (first != nullptr && first == second
                            ? std::string(": both points are at one wall")
                            : Text(": there is no wall within 1 m of %.2f,%.2f",
                                   point.x(), point.y(), 0.0, 0.0)));
      continue;
    }
    // Walls have a direction: the one may run against the other.
    const Pose2 between = Between(first->pose, second->pose);
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

namespace {

// The line nearest to a point of a wall, plan frame, that has its direction
// within `max_angle`; -1 for none within `max_distance`.
int NearestLine(const std::vector<LineFrame>& lines,
                const Eigen::Vector2d& point, double direction,
                double max_distance, double max_angle, double* distance) {
  int nearest = -1;
  double least = max_distance;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const LineFrame& line = lines[i];
    const Eigen::Vector2d from = point - line.pose.head<2>();
    const double across = line.along.x() * from.y() - line.along.y() * from.x();
    if (std::abs(across) >= least ||
        std::abs(line.along.dot(from)) > line.half + kOverhang ||
        AngleBetween(direction, line.pose[2]) > max_angle) {
      continue;
    }
    least = std::abs(across);
    nearest = static_cast<int>(i);
    *distance = across;
  }
  return nearest;
}

// A point of a wall, map frame, and the wall's direction.
struct WallPoint {
  Eigen::Vector2d position;
  double direction;
  // Every direction that walls have counts the same: along a corridor walls
  // agree wherever the plan lies.
  double weight;
};

void WeighByDirection(std::vector<WallPoint>* points) {
  const auto count_near = [points](double direction) {
    return std::count_if(
        points->begin(), points->end(), [direction](const WallPoint& other) {
          return AngleBetween(direction, other.direction) < kSameDirection;
        });
  };
  // A direction of next to nothing does not decide.
  const double least = 0.05 * static_cast<double>(points->size());
  for (WallPoint& point : *points) {
    point.weight =
        1.0 / std::max(least, static_cast<double>(count_near(point.direction)));
  }
}

// Turns of the map, rad, that give most of its walls a direction of the plan,
// both ways round.
std::vector<double> TurnsOf(const std::vector<WallPoint>& points,
                            const std::vector<LineFrame>& lines) {
  constexpr int kBins = 180;
  const auto bin_of = [](double angle) {
    const double share = angle / kPi - std::floor(angle / kPi);
    return static_cast<int>(share * kBins) % kBins;
  };
  // The plan's a little blurred.
  std::vector<double> of_plan(kBins, 0.0);
  std::vector<double> of_map(kBins, 0.0);
  for (const LineFrame& line : lines) {
    for (int k = -2; k <= 2; ++k) {
      of_plan[static_cast<std::size_t>((bin_of(line.pose[2]) + k + kBins) %
                                       kBins)] += line.half / (1 + std::abs(k));
    }
  }
  for (const WallPoint& point : points) {
    of_map[static_cast<std::size_t>(bin_of(point.direction))] += 1.0;
  }
  std::vector<double> sums(kBins, 0.0);
  for (int shift = 0; shift < kBins; ++shift) {
    for (int k = 0; k < kBins; ++k) {
      sums[static_cast<std::size_t>(shift)] +=
          of_map[static_cast<std::size_t>(k)] *
          of_plan[static_cast<std::size_t>((k + shift) % kBins)];
    }
  }
  const double most = *std::max_element(sums.begin(), sums.end());
  std::vector<double> turns;
  for (int shift = 0; shift < kBins; ++shift) {
    bool is_peak = sums[static_cast<std::size_t>(shift)] >= kTurnShare * most;
    for (int k = 1; k <= 3; ++k) {
      const double left =
          sums[static_cast<std::size_t>((shift - k + kBins) % kBins)];
      const double right = sums[static_cast<std::size_t>((shift + k) % kBins)];
      is_peak = is_peak && sums[static_cast<std::size_t>(shift)] > left &&
                sums[static_cast<std::size_t>(shift)] >= right;
    }
    if (!is_peak) continue;
    turns.push_back(NormalizeAngle(shift * kPi / kBins));
    turns.push_back(NormalizeAngle(shift * kPi / kBins + kPi));
  }
  return turns;
}

// Moves the pose of the map in the plan to where points lie on lines.
Pose2 Refined(const std::vector<WallPoint>& points,
              const std::vector<LineFrame>& lines, Pose2 pose) {
  for (const double reach : kRefineDistances) {
    Eigen::Matrix3d information = 1e-6 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    const PoseTransform transform(pose);
    for (const WallPoint& point : points) {
      const Eigen::Vector2d position = transform.Point(point.position);
      double offset = 0.0;
      const int line = NearestLine(lines, position, point.direction + pose[2],
                                   reach, kAgreeAngle, &offset);
      if (line < 0) continue;
      const double theta = lines[static_cast<std::size_t>(line)].pose[2];
      const Eigen::Vector2d normal(-std::sin(theta), std::cos(theta));
      const Eigen::Vector2d arm = position - pose.head<2>();
      const Eigen::Vector3d row(normal.x(), normal.y(),
                                normal.dot(Eigen::Vector2d(-arm.y(), arm.x())));
      const double weight = 1.0 / (1.0 + std::pow(offset / 0.1, 2));
      information += weight * row * row.transpose();
      gradient += weight * offset * row;
    }
    pose -= information.ldlt().solve(gradient);
    pose[2] = NormalizeAngle(pose[2]);
  }
  return pose;
}

}  // namespace

std::optional<Pose2> KnownStructureBinder::PlacePlan(
    const std::function<bool()>& stop) {
  std::vector<LineFrame> lines;
  std::vector<ScanPoint> reference;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high = -low;
  for (const PlanLine& line : known_.plan) {
    lines.push_back(FrameOf(line));
    const LineFrame& frame = lines.back();
    const PoseTransform transform(frame.pose);
    const int steps = static_cast<int>(2.0 * frame.half / kLineSpacing);
    for (int k = 0; k <= steps; ++k) {
      ScanPoint point;
      point.position =
          transform.Point(Eigen::Vector2d(-frame.half + k * kLineSpacing, 0.0));
      point.normal = transform.Direction(Eigen::Vector2d(0.0, 1.0));
      point.range = 1.0;
      point.beam = 0;
      low = low.cwiseMin(point.position);
      high = high.cwiseMax(point.position);
      reference.push_back(point);
    }
  }
  const std::vector<Wall> walls = Walls();
  std::vector<WallPoint> points;
  double length = 0.0;
  for (std::size_t w = 0; w < walls.size(); ++w) {
    const Wall& wall = walls[w];
    length += wall.length();
    const int steps =
        std::max(1, static_cast<int>(wall.length() / kJudgeSpacing));
    for (int k = 0; k < steps; ++k) {
      points.push_back({wall.At(wall.begin + (k + 0.5) * wall.length() / steps),
                        wall.pose[2], 0.0});
    }
  }
  WeighByDirection(&points);
  if (points.empty() || reference.empty()) {
    notes_.push_back("the plan is not used: there are no walls to compare");
    return std::nullopt;
  }
  // Parts of the map around long walls.
  std::vector<const Wall*> by_length;
  for (const Wall& wall : walls) by_length.push_back(&wall);
  std::stable_sort(
      by_length.begin(), by_length.end(),
      [](const Wall* a, const Wall* b) { return a->length() > b->length(); });
  std::vector<Eigen::Vector2d> middles;
  for (const Wall* wall : by_length) {
    const Eigen::Vector2d middle = wall->At(0.5 * (wall->begin + wall->end));
    const bool is_apart = std::all_of(
        middles.begin(), middles.end(), [&](const Eigen::Vector2d& other) {
          return (other - middle).norm() >= kPartSpacing;
        });
    if (is_apart && middles.size() < kMostParts) middles.push_back(middle);
  }
  const std::vector<double> turns = TurnsOf(points, lines);
  ScanMatcher matcher((ScanMatcherOptions()));
  matcher.SetReference(std::move(reference));
  const Eigen::Vector2d center = 0.5 * (low + high);
  const double window = 0.5 * (high - low).maxCoeff() + 2.0;
  struct Place {
    Pose2 pose;  // of the map in the plan
    double agreeing;
    double spread;
    double score;
  };
  std::vector<Place> places;
  for (const Eigen::Vector2d& middle : middles) {
    if (stop && stop()) return std::nullopt;
    std::vector<Eigen::Vector2d> part;
    for (const Wall& wall : walls) {
      for (double s = wall.begin; s <= wall.end; s += kSearchSpacing) {
        const Eigen::Vector2d point = wall.At(s) - middle;
        if (point.norm() <= kPartRadius) part.push_back(point);
      }
    }
    if (part.size() < 10) continue;
    std::vector<ScoredPose> peaks;
    for (const double turn : turns) {
      for (const ScoredPose& peak :
           matcher.Peaks(part, Pose2(center.x(), center.y(), turn), window,
                         kTurnWindow, kLeastScore, kScoreShare, kMostPeaks,
                         std::numeric_limits<double>::infinity(), stop)) {
        peaks.push_back(peak);
      }
    }
    for (const ScoredPose& peak : peaks) {
      if (stop && stop()) return std::nullopt;
      const bool is_known =
          std::any_of(places.begin(), places.end(), [&](const Place& other) {
            const Eigen::Vector2d there =
                PoseTransform(other.pose).Point(middle);
            return (there - peak.pose.head<2>()).norm() < kKnownDistance &&
                   std::abs(NormalizeAngle(other.pose[2] - peak.pose[2])) <
                       kKnownTurn;
          });
      if (is_known) continue;
      Place place;
      place.pose =
          Refined(points, lines,
                  Compose(peak.pose, Pose2(-middle.x(), -middle.y(), 0.0)));
      place.agreeing = place.spread = place.score = 0.0;
      const PoseTransform transform(place.pose);
      double first = 0.0;
      for (const WallPoint& point : points) {
        double offset = 0.0;
        if (NearestLine(lines, transform.Point(point.position),
                        point.direction + place.pose[2], kAgreeDistance,
                        kAgreeAngle, &offset) < 0) {
          continue;
        }
        if (place.agreeing == 0.0) first = point.direction;
        place.spread =
            std::max(place.spread, AngleBetween(first, point.direction));
        place.agreeing += kJudgeSpacing;
        place.score += point.weight;
      }
      places.push_back(place);
    }
  }
  std::stable_sort(
      places.begin(), places.end(),
      [](const Place& a, const Place& b) { return a.score > b.score; });
  if (places.empty() || places.front().agreeing < known_.min_agreeing_length ||
      places.front().agreeing < known_.min_agreeing_share * length ||
      places.front().spread < kLeastSpread) {
    notes_.push_back(
        Text("the plan is not used: %.1f m of %.1f m of walls agree with it at "
             "the best place, too little or all of one direction",
             places.empty() ? 0.0 : places.front().agreeing, length, 0.0, 0.0));
    return std::nullopt;
  }
  const Place& best = places.front();
  for (const Place& rival : places) {
    // Where the middle of the map lies tells them apart.
    const Eigen::Vector2d moved =
        PoseTransform(rival.pose).Point(middles.front()) -
        PoseTransform(best.pose).Point(middles.front());
    const double turn = std::abs(NormalizeAngle(rival.pose[2] - best.pose[2]));
    if (moved.norm() < kSamePlace && turn < kSameTurn) continue;
    if (rival.score < known_.rival_share * best.score) continue;
    notes_.push_back(
        Text("the plan is not used: it fits in two places, %.2f m and %.1f "
             "degrees apart, with %.1f m and %.1f m of walls",
             moved.norm(), RadToDeg(turn), best.agreeing, rival.agreeing));
    return std::nullopt;
  }
  notes_.push_back(
      Text("the plan agrees with %.1f m of %.1f m of walls where it is placed",
           best.agreeing, length, 0.0, 0.0));
  return Inverse(best.pose);
}

int KnownStructureBinder::TieToPlan(const std::function<bool()>& stop) {
  if (known_.plan.empty()) return 0;
  if (!was_placed_) {
    was_placed_ = true;
    const std::optional<Pose2> pose = PlacePlan(stop);
    if (!pose) return 0;
    Transaction transaction;
    Feature feature;
    feature.type = &registry_.GetFeature("pose");
    feature.parameters = {(*pose)[0], (*pose)[1], (*pose)[2]};
    feature.source = kSource;
    const FeatureId provisional = transaction.AddFeature(feature);
    const Feature& first = graph_->GetFeature(first_pose_);
    const Pose2 from(first.parameters[0], first.parameters[1],
                     first.parameters[2]);
    transaction.AddConstraint(
        MakeMeasurement(registry_.GetRelation("pose_pose"),
                        {first_pose_, provisional}, Between(from, *pose),
                        InformationFromSigmas(Eigen::Vector3d(
                            kLooseDistance, kLooseDistance, kLooseTurn)),
                        kSource));
    plan_pose_ = graph_->Apply(std::move(transaction)).features.front();
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
  const RelationType& relation =
      registry_.GetRelation("pose_segment_collinearity");
  Transaction transaction;
  std::vector<std::pair<FeatureId, std::size_t>> pairs;
  for (const Wall& wall : Walls()) {
    if (tied.count(wall.id) > 0) continue;
    // In the plan's frame.
    const Pose2 pose = Between(plan_pose, wall.pose);
    double least = known_.max_offset;
    double at = 0.0;
    int nearest = -1;
    for (std::size_t i = 0; i < known_.plan.size(); ++i) {
      if (ties_.count({wall.id, i}) > 0) continue;
      const LineFrame line = FrameOf(known_.plan[i]);
      const Pose2 in_line = Between(line.pose, pose);
      if (AngleBetween(in_line[2], 0.0) > known_.max_angle) continue;
      // The part that both have.
      const double sense = std::cos(in_line[2]) < 0.0 ? -1.0 : 1.0;
      double begin = in_line[0] + sense * wall.begin;
      double end = in_line[0] + sense * wall.end;
      if (begin > end) std::swap(begin, end);
      begin = std::max(begin, -line.half);
      end = std::min(end, line.half);
      if (end - begin < 0.5 * std::min(wall.length(), 2.0 * line.half)) {
        continue;
      }
      const double along = sense * (0.5 * (begin + end) - in_line[0]);
      const double offset = std::abs(in_line[1] + along * std::sin(in_line[2]));
      if (offset >= least) continue;
      least = offset;
      at = along;
      nearest = static_cast<int>(i);
    }
    if (nearest < 0) continue;
    LineFrame line = FrameOf(known_.plan[static_cast<std::size_t>(nearest)]);
    if (std::cos(pose[2] - line.pose[2]) < 0.0) {
      line.pose[2] = NormalizeAngle(line.pose[2] + kPi);
    }
    // The plan's origin as the line sees it.
    const Pose2 origin = Inverse(line.pose);
    // The offset is tested where wall and line lie side by side, which is `at`
    // along the wall and so far from the origin along it.
    const double lever = at - Between(pose, Pose2(Pose2::Zero()))[0];
    Eigen::Matrix2d rows;
    rows << 1.0, lever, 0.0, 1.0;
    const Eigen::Vector2d weights(std::pow(known_.plan_sigma_offset, -2),
                                  std::pow(known_.plan_sigma_angle, -2));
    Constraint tie = MakeStructure(
        relation, {plan_pose_, wall.id}, Eigen::Vector2d(origin[1], origin[2]),
        rows.transpose() * weights.asDiagonal() * rows, kSource);
    tie.break_below = known_.break_below;
    transaction.AddConstraint(std::move(tie));
    pairs.emplace_back(wall.id, static_cast<std::size_t>(nearest));
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
    notes.push_back(
        std::to_string(tied.size()) + " walls are tied to " +
        std::to_string(kept.size()) + " lines of the plan" +
        Text(", whose origin is at %.3f,%.3f, turned by %.3f degrees",
             plan.parameters[0], plan.parameters[1],
             RadToDeg(plan.parameters[2]), 0.0));
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
    std::string note = "measurements contradict the plan's line" +
                       Text(" from %.2f,%.2f to %.2f,%.2f", line.begin.x(),
                            line.begin.y(), line.end.x(), line.end.y());
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
