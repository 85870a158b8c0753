#include <plumbline/apps/simulation/stress.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>
#include <utility>

namespace plumbline {
namespace {

// Scans of one stretch.
constexpr int kDeadScans = 40;
constexpr int kJumpScans = 20;
constexpr int kBlindScans = 60;
constexpr int kPeopleScans = 150;
constexpr int kCarriedScans = 150;
// A turn takes fewer scans than this, and lies so far from others.
constexpr int kTurnScans = 40;
constexpr int kTurnSpacing = 150;
// Scans left alone at the begin and the end of a log.
constexpr int kMargin = 30;
constexpr int kAttempts = 20000;

// Reproducible on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  int Below(int end) {
    return static_cast<int>(Uniform(0.0, static_cast<double>(end)));
  }
  double Normal(double sigma) {
    const double u = Uniform(0.0, 1.0);
    const double v = Uniform(0.0, 1.0);
    return sigma * std::sqrt(-2.0 * std::log(1.0 - u)) *
           std::cos(2.0 * kPi * v);
  }

 private:
  std::mt19937_64 engine_;
};

// Begins of stretches of `size` scans that lie apart from each other.
std::vector<int> Stretches(int scans, int size, int count, Random* random) {
  std::vector<int> begins;
  const int room = scans - size - 2 * kMargin;
  if (room < 1) return begins;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (static_cast<int>(begins.size()) == count) break;
    const int begin = kMargin + random->Below(room);
    const bool is_free = std::all_of(
        begins.begin(), begins.end(),
        [&](int other) { return std::abs(begin - other) > 2 * size; });
    if (is_free) begins.push_back(begin);
  }
  std::sort(begins.begin(), begins.end());
  return begins;
}

// Scans [first, second) of a turn by 45 to 80 degrees.
std::vector<std::pair<int, int>> Turns(const std::vector<SimulatedState>& scans,
                                       int count, Random* random) {
  std::vector<double> heading(scans.size(), 0.0);
  for (std::size_t i = 1; i < scans.size(); ++i) {
    heading[i] = heading[i - 1] + NormalizeAngle(scans[i].odometry[2] -
                                                 scans[i - 1].odometry[2]);
  }
  std::vector<std::pair<int, int>> turns;
  const int room = static_cast<int>(scans.size()) - kTurnScans - kMargin;
  if (room < 1) return turns;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (static_cast<int>(turns.size()) == count) break;
    const int before = kMargin - 10 + random->Below(room);
    const bool is_free =
        std::all_of(turns.begin(), turns.end(), [&](const auto& turn) {
          return std::abs(before - turn.first) >= kTurnSpacing;
        });
    if (!is_free) continue;
    for (int after = before + 2; after < before + kTurnScans; ++after) {
      const double turned = std::abs(heading[after] - heading[before]);
      if (turned > DegToRad(45.0) && turned < DegToRad(80.0)) {
        turns.emplace_back(before + 1, after);
        break;
      }
    }
  }
  std::sort(turns.begin(), turns.end());
  return turns;
}

void Blind(double maximum_range, Random* random, SimulatedState* scan) {
  const int beams = static_cast<int>(scan->ranges.size());
  const int begin = random->Below(beams);
  for (int k = 0; k < 2 * beams / 3; ++k) {
    scan->ranges[(begin + k) % beams] = maximum_range;
  }
}

// A leg's width in front of the robot: where in the field of view (0 to 1), how
// far (m), and how the first changes from scan to scan.
struct Person {
  double bearing;
  double distance;
  double drift;
};

void Walk(Person* person, Random* random, SimulatedState* scan) {
  constexpr double kWidth = 0.25;  // m
  person->bearing += person->drift;
  person->bearing -= std::floor(person->bearing);
  const int beams = static_cast<int>(scan->ranges.size());
  const double middle = person->bearing * beams;
  const double half = 0.5 * kWidth / person->distance / kPi * beams;
  for (int k = std::max(0, static_cast<int>(middle - half));
       k <= std::min(beams - 1, static_cast<int>(middle + half)); ++k) {
    if (scan->ranges[k] > person->distance) {
      scan->ranges[k] = person->distance + random->Normal(0.02);
    }
  }
}

}  // namespace

std::vector<std::string> StressKinds() {
  return {"turns", "stale", "dead",   "scale",
          "jump",  "blind", "people", "carried"};
}

std::vector<int> Stress(const std::string& kind, int count, std::uint64_t seed,
                        double maximum_range, Simulation* simulation) {
  const std::vector<std::string> kinds = StressKinds();
  if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) {
    throw PLUMBLINE_ERROR("'" + kind + "' is no kind of stress",
                          "turns, stale, dead, scale, jump, blind, people or "
                          "carried");
  }
  if (count < 1) {
    throw PLUMBLINE_ERROR("stress " + std::to_string(count) + " times",
                          "1 or more");
  }
  std::vector<SimulatedState> scans;
  for (SimulatedState& state : simulation->states) {
    if (!state.ranges.empty()) scans.push_back(std::move(state));
  }
  const int size = static_cast<int>(scans.size());
  Random random(seed);
  std::vector<bool> missing(scans.size(), false);
  // Odometry from each scan to the next.
  std::vector<Pose2> steps;
  for (int i = 0; i + 1 < size; ++i) {
    steps.push_back(Between(scans[i].odometry, scans[i + 1].odometry));
  }
  bool is_rebuilt = true;
  std::vector<int> begins;
  if (kind == "turns" || kind == "stale") {
    is_rebuilt = false;
    for (const auto& turn : Turns(scans, count, &random)) {
      begins.push_back(turn.first);
      for (int k = turn.first; k < turn.second; ++k) missing[k] = true;
      const int stale = kind == "stale" ? 1 + random.Below(2) : 0;
      for (int k = turn.second; k < turn.second + stale; ++k) {
        scans[k].odometry = scans[turn.first - 1].odometry;
      }
    }
  } else if (kind == "dead") {
    begins = Stretches(size, kDeadScans, count, &random);
    for (const int begin : begins) {
      std::fill_n(steps.begin() + begin, kDeadScans, Pose2::Zero());
    }
  } else if (kind == "scale") {
    begins = {0};
    for (Pose2& step : steps) step = step.cwiseProduct(Pose2(1.15, 1.15, 0.8));
  } else if (kind == "jump") {
    begins = Stretches(size, kJumpScans, count, &random);
    for (const int begin : begins) {
      const double way = random.Uniform(-kPi, kPi);
      const double turn = DegToRad(random.Below(2) == 0 ? -40.0 : 40.0);
      steps[begin] =
          Compose(steps[begin], Pose2(std::cos(way), std::sin(way), turn));
    }
  } else if (kind == "blind") {
    is_rebuilt = false;
    begins = Stretches(size, kBlindScans, count, &random);
    for (const int begin : begins) {
      for (int k = begin; k < begin + kBlindScans; ++k) {
        Blind(maximum_range, &random, &scans[k]);
      }
    }
  } else if (kind == "people") {
    is_rebuilt = false;
    begins = Stretches(size, kPeopleScans, count, &random);
    for (const int begin : begins) {
      std::array<Person, 3> people;
      for (Person& person : people) {
        person.bearing = random.Uniform(0.0, 1.0);
        person.distance = random.Uniform(0.5, 2.0);
        person.drift = random.Uniform(-0.004, 0.004);
      }
      for (int k = begin; k < begin + kPeopleScans; ++k) {
        for (Person& person : people) Walk(&person, &random, &scans[k]);
      }
    }
  } else {
    begins = Stretches(size, kCarriedScans, count, &random);
    for (const int begin : begins) {
      for (int k = begin; k < begin + kCarriedScans; ++k) missing[k] = true;
      std::fill_n(steps.begin() + begin - 1, kCarriedScans, Pose2::Zero());
    }
  }
  if (is_rebuilt) {
    for (int i = 0; i + 1 < size; ++i) {
      scans[i + 1].odometry = Compose(scans[i].odometry, steps[i]);
    }
  }
  simulation->states.clear();
  for (int i = 0; i < size; ++i) {
    if (!missing[i]) simulation->states.push_back(std::move(scans[i]));
  }
  return begins;
}

}  // namespace plumbline
