#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/core/error.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kStepsPerScan = 4;
// Of a drive, which is held in memory.
constexpr double kMostSteps = 5e7;
constexpr double kJoinHits = 0.25;
// Of coinciding faces the first one wins, whatever the rounding.
constexpr double kSameRange = 1e-9;

double Cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// One stream of random numbers a purpose, so that more of one kind of noise
// does not change the others.
enum Stream : std::uint64_t {
  kDriveStream = 1,
  kLaserStream,
  kOdometryStream,
  kRelationStream
};

SimulationRandom MakeStream(std::uint64_t seed, Stream stream) {
  return SimulationRandom(seed + stream * 0x9e3779b97f4a7c15u);
}

double SegmentDistance(const Vector2d& point, const WorldFace& face) {
  const Vector2d along = face.end - face.begin;
  const double t = std::clamp(
      (point - face.begin).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (point - face.begin - t * along).norm();
}

// Whether the direction `angle` (rad) from its centre is on the arc.
bool OnArc(const WorldCircle& circle, double angle) {
  if (circle.sweep_deg >= 360.0) return true;
  const double from_begin = angle - DegToRad(circle.begin_deg);
  const double turn = from_begin - 2 * kPi * std::floor(from_begin / (2 * kPi));
  return turn <= DegToRad(circle.sweep_deg);
}

double ArcDistance(const Vector2d& point, const WorldCircle& circle) {
  const Vector2d from_center = point - circle.center;
  if (OnArc(circle, std::atan2(from_center.y(), from_center.x()))) {
    return std::abs(from_center.norm() - circle.radius);
  }
  double distance = kInfinity;
  for (const double degrees :
       {circle.begin_deg, circle.begin_deg + circle.sweep_deg}) {
    const Vector2d end =
        circle.center + circle.radius * Vector2d(std::cos(DegToRad(degrees)),
                                                 std::sin(DegToRad(degrees)));
    distance = std::min(distance, (point - end).norm());
  }
  return distance;
}

// The surfaces that come within `reach` of `center`, for repeated queries near
// it. Indices are ascending.
struct Nearby {
  std::vector<int> faces;
  std::vector<int> circles;
};

Nearby FindNearby(const WorldSurfaces& surfaces, const Vector2d& center,
                  double reach) {
  Nearby nearby;
  for (std::size_t i = 0; i < surfaces.faces.size(); ++i) {
    if (SegmentDistance(center, surfaces.faces[i]) <= reach) {
      nearby.faces.push_back(static_cast<int>(i));
    }
  }
  for (std::size_t i = 0; i < surfaces.circles.size(); ++i) {
    const WorldCircle& circle = surfaces.circles[i];
    if (std::abs((center - circle.center).norm() - circle.radius) <= reach) {
      nearby.circles.push_back(static_cast<int>(i));
    }
  }
  return nearby;
}

double Clearance(const WorldSurfaces& surfaces, const Nearby& nearby,
                 const Vector2d& point) {
  double clearance = kInfinity;
  for (const int i : nearby.faces) {
    clearance = std::min(clearance, SegmentDistance(point, surfaces.faces[i]));
  }
  for (const int i : nearby.circles) {
    clearance = std::min(clearance, ArcDistance(point, surfaces.circles[i]));
  }
  return clearance;
}

// A point that runs along a polyline.
class Carrot {
 public:
  explicit Carrot(const std::vector<Vector2d>& path) : path_(path) {}

  // Runs on until it is `lookahead` away from `from` or at the end.
  void Advance(const Vector2d& from, double lookahead) {
    constexpr double kStep = 0.02;
    while (!AtEnd() && (Position() - from).norm() < lookahead) {
      along_ += kStep;
      const double length = (path_[leg_ + 1] - path_[leg_]).norm();
      if (along_ >= length) {
        along_ = 0.0;
        ++leg_;
      }
    }
  }

  bool AtEnd() const { return leg_ + 1 >= path_.size(); }

  Vector2d Position() const {
    if (AtEnd()) return path_.back();
    return path_[leg_] + along_ * (path_[leg_ + 1] - path_[leg_]).normalized();
  }

 private:
  const std::vector<Vector2d>& path_;
  std::size_t leg_ = 0;
  double along_ = 0.0;
};

// Value within `step` of `current` that is nearest to `target`.
double Slew(double current, double target, double step) {
  return std::clamp(target, current - step, current + step);
}

double StepTime(const DriveOptions& options) {
  return 1.0 / (kStepsPerScan * options.scan_rate);
}

void Check(bool holds, const char* what, const char* expected) {
  if (!holds) throw PLUMBLINE_ERROR(what, expected);
}

std::string Fixed(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  // The sign of what rounds to zero is chance.
  const std::string result = text;
  if (result[0] == '-' &&
      result.find_first_not_of("-0.") == std::string::npos) {
    return result.substr(1);
  }
  return result;
}

std::string PoseText(const Pose2& pose) {
  return Fixed(pose[0], 6) + ' ' + Fixed(pose[1], 6) + ' ' + Fixed(pose[2], 6);
}

std::string RingText(const Ring& ring) {
  std::string text = "[";
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (i > 0) text += ',';
    text += '[' + Fixed(ring[i].x(), 4) + ',' + Fixed(ring[i].y(), 4) + ']';
  }
  return text + ']';
}

std::string StampText(double time) {
  return Fixed(time, 6) + " plumbline " + Fixed(time, 6);
}

std::vector<std::pair<double, double>> JoinHits(std::vector<double> hits) {
  std::sort(hits.begin(), hits.end());
  std::vector<std::pair<double, double>> intervals;
  for (const double hit : hits) {
    if (intervals.empty() || hit - intervals.back().second >= kJoinHits) {
      intervals.emplace_back(hit, hit);
    }
    intervals.back().second = hit;
  }
  intervals.erase(std::remove_if(intervals.begin(), intervals.end(),
                                 [](const auto& interval) {
                                   return interval.first == interval.second;
                                 }),
                  intervals.end());
  return intervals;
}

// What wheel encoders make of the way from one pose to the next.
Pose2 MeasureStep(const Pose2& from, const Pose2& to,
                  const OdometryOptions& options, SimulationRandom* random) {
  const Pose2 step = Between(from, to);
  const double distance = std::hypot(step[0], step[1]);
  const double turn = step[2];
  // Drawn at every step, moving or not: the stream stays the same whatever the
  // options are.
  const double n0 = random->Gaussian();
  const double n1 = random->Gaussian();
  const double n2 = random->Gaussian();
  const double measured = distance * (1.0 + options.scale) +
                          n0 * options.noise * std::sqrt(distance);
  const double measured_turn =
      turn * (1.0 + options.turn_scale) +
      DegToRad(options.heading_bias_deg) * distance +
      n1 * DegToRad(options.heading_noise_deg) * std::sqrt(distance) +
      n2 * DegToRad(options.turn_noise_deg) *
          std::sqrt(RadToDeg(std::abs(turn)));
  return {measured * std::cos(turn / 2), measured * std::sin(turn / 2),
          measured_turn};
}

}  // namespace

std::vector<SimulatedState> Drive(const World& world,
                                  const DriveOptions& options,
                                  std::uint64_t seed) {
  if (world.path.size() < 2) {
    throw Error(world.name, 0, "there is no path", "at least two way points");
  }
  Check(options.speed > 0.0 && options.turn_rate > 0.0 &&
            options.scan_rate > 0.0 && options.sway >= 0.0 &&
            options.clearance >= 0.0,
        "bad options of the drive",
        "speed, turn rate and scan rate above 0, sway and clearance of at "
        "least 0");
  constexpr double kLookahead = 0.4;
  constexpr double kTurnOnTheSpot = DegToRad(50.0);
  constexpr double kAcceleration = 0.8;
  constexpr double kTurnAcceleration = 3.0;
  constexpr double kSwayTime = 1.0;
  constexpr double kNearbyMargin = 2.0;

  const WorldSurfaces surfaces = MakeSurfaces(world);
  const double dt = StepTime(options);
  SimulationRandom random = MakeStream(seed, kDriveStream);
  Carrot carrot(world.path);
  SimulatedState state;
  state.time = options.start_time;
  const Vector2d first_leg = world.path[1] - world.path[0];
  state.pose << world.path[0], std::atan2(first_leg.y(), first_leg.x());
  std::vector<SimulatedState> states;
  Nearby nearby;
  Vector2d nearby_center(kInfinity, kInfinity);
  double sway = 0.0;
  double way = 0.0;
  for (std::size_t i = 1; i < world.path.size(); ++i) {
    way += (world.path[i] - world.path[i - 1]).norm();
  }
  // Generous: half the speed, and a turn round at every way point.
  const double most_steps =
      (way / (0.5 * options.speed) +
       (world.path.size() * 2 * kPi) / options.turn_rate + 60.0) /
      dt;
  if (!(most_steps < kMostSteps)) {
    throw Error(world.name, 0,
                "a way of " + Fixed(way, 0) + " m may take " +
                    Fixed(most_steps, 0) + " steps",
                "at most " + Fixed(kMostSteps, 0) +
                    ": a shorter way, more speed, fewer scans a second");
  }
  while (true) {
    const Vector2d position = state.pose.head<2>();
    if (!((position - nearby_center).norm() < kNearbyMargin)) {
      nearby_center = position;
      nearby =
          FindNearby(surfaces, position, options.clearance + kNearbyMargin);
    }
    if (Clearance(surfaces, nearby, position) < options.clearance) {
      throw Error(
          world.name, 0,
          "the robot runs into something near x = " + Fixed(position.x(), 2) +
              ", y = " + Fixed(position.y(), 2),
          "a path that keeps clear of walls and furniture");
    }
    states.push_back(state);
    carrot.Advance(position, kLookahead);
    const Vector2d to_carrot = carrot.Position() - position;
    if (carrot.AtEnd() && to_carrot.norm() < 0.1) break;
    if (states.size() > most_steps) {
      throw Error(world.name, 0, "the robot does not reach the end of its path",
                  "way points that it can follow at this speed");
    }
    const double error = NormalizeAngle(
        std::atan2(to_carrot.y(), to_carrot.x()) - state.pose[2]);
    double speed = 0.0;
    if (std::abs(error) < kTurnOnTheSpot) {
      speed = options.speed * std::pow(std::cos(error), 4);
      if (carrot.AtEnd()) speed = std::min(speed, to_carrot.norm());
    }
    // A first-order process with the given deviation: disturbances last for a
    // second or so, as bumps and steering do.
    const double decay = dt / kSwayTime;
    sway += -decay * sway +
            options.sway * std::sqrt(2.0 * decay) * random.Gaussian();
    state.speed = speed < state.speed - kAcceleration * 2 * dt
                      ? state.speed - kAcceleration * 2 * dt
                      : Slew(state.speed, speed, kAcceleration * dt);
    const double turn_rate =
        std::clamp(2.5 * error, -options.turn_rate, options.turn_rate) +
        (state.speed > 0.05 ? sway : 0.0);
    state.turn_rate = Slew(state.turn_rate, turn_rate, kTurnAcceleration * dt);
    const double turn = state.turn_rate * dt;
    const double distance = state.speed * dt;
    state.pose =
        Compose(state.pose, Pose2(distance * std::cos(turn / 2),
                                  distance * std::sin(turn / 2), turn));
    state.time = options.start_time + dt * static_cast<double>(states.size());
  }
  return states;
}

std::vector<double> CastBeams(const WorldSurfaces& surfaces, const Pose2& laser,
                              double start_angle, double angle_step, int count,
                              double maximum_range,
                              std::vector<std::pair<int, double>>* hits) {
  const Vector2d origin = laser.head<2>();
  std::vector<Vector2d> directions(count);
  for (int i = 0; i < count; ++i) {
    const double angle = laser[2] + start_angle + i * angle_step;
    directions[i] = {std::cos(angle), std::sin(angle)};
  }
  const Vector2d ahead(std::cos(laser[2]), std::sin(laser[2]));
  std::vector<double> ranges(count, maximum_range);
  if (hits != nullptr) hits->assign(count, {-1, 0.0});
  std::vector<bool> returned(count, false);
  const auto bearing = [&](const Vector2d& point) {
    const Vector2d d = point - origin;
    return std::atan2(Cross(ahead, d), ahead.dot(d));
  };
  for (std::size_t f = 0; f < surfaces.faces.size(); ++f) {
    const WorldFace& face = surfaces.faces[f];
    if (SegmentDistance(origin, face) >= maximum_range) continue;
    const Vector2d along = face.end - face.begin;
    double low = bearing(face.begin);
    double sweep = NormalizeAngle(bearing(face.end) - low);
    if (sweep < 0.0) {
      low += sweep;
      sweep = -sweep;
    }
    // The face may stand on either side of the cut at +-pi.
    for (const double shift : {-2 * kPi, 0.0, 2 * kPi}) {
      const double first = (low + shift - start_angle) / angle_step;
      const int begin = static_cast<int>(
          std::ceil(std::clamp(first - 1e-6, 0.0, 1.0 * count)));
      const double last = first + sweep / angle_step;
      const int end = static_cast<int>(
          std::floor(std::clamp(last + 1e-6, -1.0, count - 1.0)));
      for (int i = begin; i <= end; ++i) {
        const double denominator = Cross(directions[i], along);
        if (std::abs(denominator) < 1e-12) continue;
        const Vector2d to_begin = face.begin - origin;
        const double range = Cross(to_begin, along) / denominator;
        const double position = Cross(to_begin, directions[i]) / denominator;
        if (range <= 0.0 || position < -1e-9 || position > 1.0 + 1e-9) continue;
        if (range < ranges[i] - kSameRange) {
          ranges[i] = range;
          returned[i] = true;
          if (hits != nullptr) {
            (*hits)[i] = {static_cast<int>(f),
                          std::clamp(position, 0.0, 1.0) * along.norm()};
          }
        }
      }
    }
  }
  for (const WorldCircle& circle : surfaces.circles) {
    const Vector2d to_center = circle.center - origin;
    if (std::abs(to_center.norm() - circle.radius) >= maximum_range) continue;
    for (int i = 0; i < count; ++i) {
      const double closest = directions[i].dot(to_center);
      const double away = Cross(directions[i], to_center);
      const double squared = circle.radius * circle.radius - away * away;
      if (squared < 0.0) continue;
      for (const double half : {-std::sqrt(squared), std::sqrt(squared)}) {
        const double range = closest + half;
        if (range <= 0.0 || range >= ranges[i] - kSameRange) continue;
        const Vector2d from_center = range * directions[i] - to_center;
        if (!OnArc(circle, std::atan2(from_center.y(), from_center.x()))) {
          continue;
        }
        ranges[i] = range;
        returned[i] = true;
        if (hits != nullptr) (*hits)[i] = {-1, 0.0};
        break;
      }
    }
  }
  for (int i = 0; i < count; ++i) {
    if (!returned[i]) ranges[i] = kInfinity;
  }
  return ranges;
}

Simulation Simulate(const World& world, const SimulatorOptions& options,
                    std::uint64_t seed) {
  const LaserModel& laser = options.laser;
  Check(laser.beams == 180 || laser.beams == 181 || laser.beams == 360 ||
            laser.beams == 361,
        "bad number of beams", "180, 181, 360 or 361");
  Check(laser.maximum_range > 0.0 && laser.no_return >= laser.maximum_range,
        "bad ranges of the laser",
        "a maximum above 0 and no less for no return");
  Check(laser.noise >= 0.0 && laser.noise_per_metre >= 0.0 &&
            laser.missing >= 0.0 && laser.missing <= 1.0,
        "bad noise of the laser",
        "deviations of at least 0 and a probability of missing returns");
  Check(options.odometry.noise >= 0.0 &&
            options.odometry.heading_noise_deg >= 0.0 &&
            options.odometry.turn_noise_deg >= 0.0,
        "bad noise of the odometry", "deviations of at least 0");
  const double angle_step = DegToRad(laser.beams < 360 ? 1.0 : 0.5);

  Simulation simulation;
  simulation.surfaces = MakeSurfaces(world);
  simulation.rooms = WorldRooms(world);
  simulation.doors = WorldDoors(world);
  const std::vector<SimulatedState> drive = Drive(world, options.drive, seed);
  SimulationRandom laser_random = MakeStream(seed, kLaserStream);
  SimulationRandom odometry_random = MakeStream(seed, kOdometryStream);
  std::vector<std::vector<double>> positions(simulation.surfaces.faces.size());
  std::vector<std::pair<int, double>> hits;
  Pose2 odometry = drive[0].pose;
  for (std::size_t k = 0; k < drive.size(); ++k) {
    SimulatedState state = drive[k];
    if (k > 0) {
      odometry =
          Compose(odometry, MeasureStep(drive[k - 1].pose, state.pose,
                                        options.odometry, &odometry_random));
    }
    state.odometry = odometry;
    if (k % kStepsPerScan == 0) {
      state.ranges = CastBeams(
          simulation.surfaces,
          Compose(state.pose, Pose2(laser.offset, 0.0, 0.0)), -kPi / 2,
          angle_step, laser.beams, laser.maximum_range, &hits);
      for (int i = 0; i < laser.beams; ++i) {
        double& range = state.ranges[i];
        const double deviation =
            laser.noise +
            laser.noise_per_metre * (std::isfinite(range) ? range : 0.0);
        const double noise = deviation * laser_random.Gaussian();
        const bool missing = laser_random.Chance(laser.missing);
        if (missing || !(range + noise < laser.maximum_range)) {
          range = laser.no_return;
          continue;
        }
        // A laser gives no reading of zero for something very near.
        range = std::max(range + noise, 0.01);
        if (hits[i].first >= 0) {
          positions[hits[i].first].push_back(hits[i].second);
        }
      }
      simulation.states.push_back(state);
      if (options.progress &&
          !options.progress(static_cast<double>(k + 1) / drive.size())) {
        break;
      }
    } else if (k % 2 == 1) {
      simulation.states.push_back(state);
    }
  }
  for (std::vector<double>& hits_of_face : positions) {
    simulation.seen.push_back(JoinHits(std::move(hits_of_face)));
  }
  return simulation;
}

void WriteCarmenLog(const Simulation& simulation, const LaserModel& laser,
                    const std::vector<std::string>& comments,
                    std::ostream& output) {
  output << "# CARMEN log, simulated\n"
            "# message_name [message contents] ipc_timestamp ipc_hostname "
            "logger_timestamp\n"
            "# PARAM param_name param_value\n"
            "# ODOM x y theta tv rv accel\n"
            "# FLASER num_readings [range_readings] x y theta odom_x odom_y "
            "odom_theta\n";
  for (const std::string& comment : comments) output << "# " << comment << '\n';
  if (simulation.states.empty()) return;
  const std::string start = StampText(simulation.states.front().time);
  output << "PARAM robot_front_laser_max " << Fixed(laser.maximum_range, 2)
         << ' ' << start << '\n'
         << "PARAM robot_frontlaser_offset " << Fixed(laser.offset, 3) << ' '
         << start << '\n';
  for (const SimulatedState& state : simulation.states) {
    const std::string stamp = StampText(state.time);
    if (state.ranges.empty()) {
      output << "ODOM " << PoseText(state.odometry) << ' '
             << Fixed(state.speed, 6) << ' ' << Fixed(state.turn_rate, 6)
             << " 0.000000 " << stamp << '\n';
      continue;
    }
    output << "FLASER " << state.ranges.size();
    for (const double range : state.ranges) output << ' ' << Fixed(range, 2);
    output << ' '
           << PoseText(Compose(state.odometry, Pose2(laser.offset, 0.0, 0.0)))
           << ' ' << PoseText(state.odometry) << ' ' << stamp << '\n';
  }
}

bool IsReturn(double range, const LaserModel& laser) {
  constexpr double kCarmenMargin = 0.05;  // m
  return static_cast<float>(std::strtod(Fixed(range, 2).c_str(), nullptr)) <
         laser.maximum_range - kCarmenMargin;
}

void WriteCsvLog(const Simulation& simulation, const LaserModel& laser,
                 const std::vector<std::string>& comments,
                 std::ostream& output) {
  for (const std::string& comment : comments) output << "# " << comment << '\n';
  output << "time,x,y,theta,laser_x,max_range,start_angle,angle_step";
  for (int i = 0; i < laser.beams; ++i) output << ",r" << i;
  output << '\n';
  const int intervals = laser.beams % 2 == 0 ? laser.beams : laser.beams - 1;
  char angles[80];
  std::snprintf(angles, sizeof(angles), "%.17g,%.17g", -0.5 * kPi,
                kPi / intervals);
  const std::string fixed = Fixed(laser.offset, 6) + ',' +
                            Fixed(laser.maximum_range, 2) + ',' + angles;
  for (const SimulatedState& state : simulation.states) {
    if (state.ranges.empty()) continue;
    output << Fixed(state.time, 6) << ',' << Fixed(state.odometry[0], 6) << ','
           << Fixed(state.odometry[1], 6) << ',' << Fixed(state.odometry[2], 6)
           << ',' << fixed;
    for (const double range : state.ranges) {
      output << ',';
      if (IsReturn(range, laser)) output << Fixed(range, 2);
    }
    output << '\n';
  }
}

void WriteTruth(const Simulation& simulation, std::ostream& output) {
  const char* separator = "";
  output << "{\"format\":\"plumbline-truth\",\"version\":1,\n"
            "\"orientations_deg\":[";
  for (const double degrees : simulation.surfaces.orientations_deg) {
    output << separator << Fixed(degrees, 4);
    separator = ",";
  }
  output << "],\n\"walls\":[";
  separator = "\n";
  for (std::size_t i = 0; i < simulation.surfaces.faces.size(); ++i) {
    const WorldFace& face = simulation.surfaces.faces[i];
    output << separator << "{\"id\":" << i
           << ",\"x1\":" << Fixed(face.begin.x(), 4)
           << ",\"y1\":" << Fixed(face.begin.y(), 4)
           << ",\"x2\":" << Fixed(face.end.x(), 4)
           << ",\"y2\":" << Fixed(face.end.y(), 4)
           << ",\"orientation\":" << face.orientation << ",\"seen\":[";
    const char* comma = "";
    for (const auto& [begin, end] : simulation.seen[i]) {
      output << comma << '[' << Fixed(begin, 3) << ',' << Fixed(end, 3) << ']';
      comma = ",";
    }
    output << "]}";
    separator = ",\n";
  }
  output << "],\n\"circles\":[";
  separator = "\n";
  for (std::size_t i = 0; i < simulation.surfaces.circles.size(); ++i) {
    const WorldCircle& circle = simulation.surfaces.circles[i];
    output << separator << "{\"id\":" << i
           << ",\"x\":" << Fixed(circle.center.x(), 4)
           << ",\"y\":" << Fixed(circle.center.y(), 4)
           << ",\"r\":" << Fixed(circle.radius, 4)
           << ",\"begin_deg\":" << Fixed(circle.begin_deg, 4)
           << ",\"sweep_deg\":" << Fixed(circle.sweep_deg, 4) << '}';
    separator = ",\n";
  }
  output << "],\n\"rooms\":[";
  separator = "\n";
  for (std::size_t i = 0; i < simulation.rooms.size(); ++i) {
    output << separator << "{\"id\":" << i << ",\"outline\":["
           << RingText(simulation.rooms[i].shell);
    for (const Ring& hole : simulation.rooms[i].holes) {
      output << ',' << RingText(hole);
    }
    output << "]}";
    separator = ",\n";
  }
  output << "],\n\"doors\":[";
  separator = "\n";
  for (const TrueDoor& door : simulation.doors) {
    output << separator << "{\"x1\":" << Fixed(door.begin.x(), 4)
           << ",\"y1\":" << Fixed(door.begin.y(), 4)
           << ",\"x2\":" << Fixed(door.end.x(), 4)
           << ",\"y2\":" << Fixed(door.end.y(), 4)
           << ",\"thickness\":" << Fixed(door.thickness, 4)
           << ",\"shut\":" << (door.is_shut ? "true" : "false") << '}';
    separator = ",\n";
  }
  output << "],\n\"poses\":[";
  separator = "\n";
  for (const SimulatedState& state : simulation.states) {
    if (state.ranges.empty()) continue;
    output << separator << '[' << Fixed(state.time, 6) << ','
           << Fixed(state.pose[0], 6) << ',' << Fixed(state.pose[1], 6) << ','
           << Fixed(state.pose[2], 6) << ']';
    separator = ",\n";
  }
  output << "]}\n";
}

void WriteRelations(const Simulation& simulation, std::uint64_t seed,
                    std::ostream& output) {
  std::vector<const SimulatedState*> keys;
  for (const SimulatedState& state : simulation.states) {
    if (state.ranges.empty()) continue;
    if (!keys.empty()) {
      const Pose2 step = Between(keys.back()->pose, state.pose);
      if (std::hypot(step[0], step[1]) < 1.0 &&
          std::abs(step[2]) < DegToRad(45.0)) {
        continue;
      }
    }
    keys.push_back(&state);
  }
  const auto write = [&output](const SimulatedState& a,
                               const SimulatedState& b) {
    const Pose2 step = Between(a.pose, b.pose);
    output << Fixed(a.time, 6) << ' ' << Fixed(b.time, 6) << ' '
           << Fixed(step[0], 6) << ' ' << Fixed(step[1], 6)
           << " 0.000000 0.000000 0.000000 " << Fixed(step[2], 6) << '\n';
  };
  for (std::size_t i = 1; i < keys.size(); ++i) write(*keys[i - 1], *keys[i]);
  SimulationRandom random = MakeStream(seed, kRelationStream);
  const double count = static_cast<double>(keys.size());
  for (std::size_t i = 1; i < keys.size(); ++i) {
    const auto a = static_cast<std::size_t>(random.Uniform(0.0, count));
    const auto b = static_cast<std::size_t>(random.Uniform(0.0, count));
    if (a != b) write(*keys[std::min(a, b)], *keys[std::max(a, b)]);
  }
}

std::string GzipCompress(const std::string& text) {
  Check(text.size() < std::numeric_limits<uInt>::max() / 2,
        "too much text to compress at once", "less than 2 GB");
  z_stream stream = {};
  // 15 bits of window, and 16 for a gzip header, which zlib leaves without a
  // time unless told otherwise.
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, 15 + 16, 8,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    throw PLUMBLINE_ERROR("zlib does not start", "");
  }
  std::string compressed(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(&compressed[0]);
  stream.avail_out = static_cast<uInt>(compressed.size());
  const int result = deflate(&stream, Z_FINISH);
  compressed.resize(stream.total_out);
  deflateEnd(&stream);
  if (result != Z_STREAM_END) throw PLUMBLINE_ERROR("zlib failed", "");
  return compressed;
}

}  // namespace plumbline
