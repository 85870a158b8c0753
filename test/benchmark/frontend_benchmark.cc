// What the parts of the front-end cost a scan, and whether a scan's cost grows
// with the map.

#include <benchmark/benchmark.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/pipeline/log_solver.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark_util.h"

namespace plumbline {
namespace {

// Scans of a log that the parts are timed on: from its beginning.
constexpr std::size_t kScans = 600;

const Registry& Builtins() {
  static const Registry* const registry = [] {
    auto* made = new Registry;
    RegisterBuiltins(made);
    return made;
  }();
  return *registry;
}

// A scan to be matched as the front-end meets it: the last key scans for
// reference, and a guess that is off.
struct MatchCase {
  std::vector<ScanPoint> reference;
  std::vector<ScanPoint> scan;
  Pose2 guess = Pose2::Zero();
};

// A key scan as it goes to the map.
struct KeyCase {
  int scan = 0;
  UncertainPose2 motion;
  Pose2 start = Pose2::Zero();
  std::vector<SegmentObservation> observations;
};

std::vector<ScanPoint> Moved(const std::vector<ScanPoint>& points,
                             const Pose2& pose) {
  std::vector<ScanPoint> moved = points;
  for (ScanPoint& point : moved) {
    point.position = TransformPoint(pose, point.position);
    point.normal = TransformPoint(Pose2(0.0, 0.0, pose[2]), point.normal);
  }
  return moved;
}

// The beginning of a log and what the parts of the front-end get from each
// other on it, recorded by one run.
struct Recording {
  std::vector<Scan> scans;
  std::vector<std::vector<ScanPoint>> points;
  std::vector<MatchCase> matches;
  std::vector<KeyCase> keys;
  // Processor time of the front-end a scan: refinement, segments, map.
  double seconds_per_scan = 0.0;
};

Recording Record(const Log& log) {
  constexpr std::size_t kMatchEvery = 7;
  const LogSolverOptions options;
  Recording recording;
  recording.scans.assign(
      log.scans.begin(),
      log.scans.begin() + std::min(kScans, log.scans.size()));
  OdometryRefiner refiner(options.odometry);
  std::deque<std::vector<ScanPoint>> window;
  for (std::size_t i = 0; i < recording.scans.size(); ++i) {
    const Scan& scan = recording.scans[i];
    const RefinedScan refined = refiner.Process(scan);
    recording.points.push_back(refiner.points());
    if (i % kMatchEvery == kMatchEvery - 1 && !window.empty()) {
      MatchCase match;
      for (const auto& points : window) {
        match.reference.insert(match.reference.end(), points.begin(),
                               points.end());
      }
      match.scan = refiner.points();
      match.guess = Compose(refined.pose, Pose2(0.05, -0.05, DegToRad(1.0)));
      recording.matches.push_back(std::move(match));
    }
    if (!refined.is_key) continue;
    window.push_back(Moved(refiner.points(), refined.pose));
    if (window.size() > static_cast<std::size_t>(options.odometry.window)) {
      window.pop_front();
    }
    recording.keys.push_back(
        {static_cast<int>(i), refined.since_key, refined.pose,
         ExtractSegments(refiner.points(), scan.laser_offset.head<2>(),
                         scan.angle_step, options.builder.extraction)});
  }
  return recording;
}

// The front-end on a recording, part by part.
class Replay {
 public:
  explicit Replay(const Recording& recording) : recording_(recording) {}

  RefinedScan Process(std::size_t i) {
    if (i == 0) {
      refiner_ = std::make_unique<OdometryRefiner>(options_.odometry);
    }
    return refiner_->Process(recording_.scans[i]);
  }
  std::vector<SegmentObservation> Segments(std::size_t i) const {
    const Scan& scan = recording_.scans[i];
    return ExtractSegments(recording_.points[i], scan.laser_offset.head<2>(),
                           scan.angle_step, options_.builder.extraction);
  }
  // With a solver session that keeps in step, as in a solve.
  void AddKeyScan(std::size_t i) {
    if (i == 0) {
      builder_.reset();
      session_.reset();
      graph_ = std::make_unique<Graph>();
      session_ = std::make_unique<SolverSession>(graph_.get(), Builtins(),
                                                 options_.session);
      builder_ = std::make_unique<MapBuilder>(graph_.get(), Builtins(),
                                              options_.builder);
    }
    const KeyCase& key = recording_.keys[i];
    builder_->AddKeyScan(key.scan, key.motion, key.observations, key.start);
  }

 private:
  const Recording& recording_;
  const LogSolverOptions options_;
  std::unique_ptr<OdometryRefiner> refiner_;
  std::unique_ptr<Graph> graph_;
  std::unique_ptr<SolverSession> session_;
  std::unique_ptr<MapBuilder> builder_;
};

double FrontendSecondsPerScan(const Recording& recording) {
  Replay replay(recording);
  const double seconds = CpuSecondsOf([&] {
    std::size_t key = 0;
    for (std::size_t i = 0; i < recording.scans.size(); ++i) {
      if (!replay.Process(i).is_key) continue;
      benchmark::DoNotOptimize(replay.Segments(i));
      if (key < recording.keys.size()) replay.AddKeyScan(key++);
    }
  });
  return seconds / recording.scans.size();
}

// Runs a part on one case after the other, round and round. `rate` is how often
// the front-end runs the part, in calls a scan; 0: it depends.
template <typename Function>
void RunPart(benchmark::State& state, const Recording& recording,
             std::size_t num_cases, double rate, const Function& part) {
  if (num_cases == 0) {
    state.SkipWithError("nothing of the kind in the log");
    return;
  }
  double seconds = 0.0;
  std::size_t calls = 0;
  for (auto _ : state) {
    const double one = CpuSecondsOf([&] { part(calls % num_cases); });
    state.SetIterationTime(one);
    seconds += one;
    ++calls;
  }
  state.counters["call_over_scan"] =
      seconds / calls / recording.seconds_per_scan;
  if (rate > 0.0) {
    state.counters["share_of_scan"] =
        rate * seconds / calls / recording.seconds_per_scan;
  }
}

void RegisterParts(const std::string& name, const Log& log) {
  const auto recording = std::make_shared<Recording>(Record(log));
  recording->seconds_per_scan = FrontendSecondsPerScan(*recording);
  const auto add = [&](const std::string& part, auto function) {
    benchmark::RegisterBenchmark(
        (part + "/" + name).c_str(),
        [recording, function](benchmark::State& state) {
          function(state, *recording);
        })
        ->UseManualTime()
        ->MinTime(0.2)
        ->Unit(benchmark::kMicrosecond);
  };
  add("ExtractScanPoints", [](benchmark::State& state,
                              const Recording& recorded) {
    const LogSolverOptions options;
    std::vector<ScanPoint> points;
    RunPart(state, recorded, recorded.scans.size(), 1.0, [&](std::size_t i) {
      ExtractScanPoints(recorded.scans[i], options.odometry.points, &points);
    });
  });
  add("ScanMatcherSetReference", [](benchmark::State& state,
                                    const Recording& recorded) {
    ScanMatcher matcher{ScanMatcherOptions()};
    RunPart(state, recorded, recorded.matches.size(),
            static_cast<double>(recorded.keys.size()) / recorded.scans.size(),
            [&](std::size_t i) {
              matcher.SetReference(recorded.matches[i].reference);
            });
  });
  add("ScanMatcherRefine",
      [](benchmark::State& state, const Recording& recorded) {
        const LogSolverOptions options;
        std::vector<ScanMatcher> matchers;
        for (const MatchCase& match : recorded.matches) {
          matchers.emplace_back(options.odometry.matcher);
          matchers.back().SetReference(match.reference);
        }
        RunPart(state, recorded, matchers.size(), 0.0, [&](std::size_t i) {
          const MatchCase& match = recorded.matches[i];
          MatchPrior prior;
          prior.pose = match.guess;
          prior.information =
              OdometryCovariance(Pose2(0.1, 0.0, 0.0), options.odometry.noise)
                  .inverse();
          benchmark::DoNotOptimize(
              matchers[i].Refine(match.scan, match.guess, prior));
        });
      });
  // With the likelihood field, which a reference gets at its first search.
  add("ScanMatcherSearch", [](benchmark::State& state,
                              const Recording& recorded) {
    const LogSolverOptions options;
    ScanMatcher matcher(options.odometry.matcher);
    RunPart(state, recorded, recorded.matches.size(), 0.0, [&](std::size_t i) {
      const MatchCase& match = recorded.matches[i];
      matcher.SetReference(match.reference);
      benchmark::DoNotOptimize(matcher.Search(
          match.scan, match.guess, options.odometry.search_translation,
          options.odometry.search_rotation, nullptr));
    });
  });
  add("OdometryRefinerProcess",
      [](benchmark::State& state, const Recording& recorded) {
        Replay replay(recorded);
        RunPart(state, recorded, recorded.scans.size(), 1.0,
                [&](std::size_t i) { replay.Process(i); });
      });
  add("ExtractSegments", [](benchmark::State& state,
                            const Recording& recorded) {
    const Replay replay(recorded);
    RunPart(
        state, recorded, recorded.scans.size(),
        static_cast<double>(recorded.keys.size()) / recorded.scans.size(),
        [&](std::size_t i) { benchmark::DoNotOptimize(replay.Segments(i)); });
  });
  add("MapBuilderAddKeyScan", [](benchmark::State& state,
                                 const Recording& recorded) {
    Replay replay(recorded);
    RunPart(state, recorded, recorded.keys.size(),
            static_cast<double>(recorded.keys.size()) / recorded.scans.size(),
            [&](std::size_t i) { replay.AddKeyScan(i); });
  });
}

// The whole way of a scan, EM steps near the robot included, over tenths of the
// log; relative to the second tenth, in which every part is at work already.
void ScanCostAgainstMapSize(benchmark::State& state, const Log& log) {
  LogSolverOptions options;
  options.refine = Refinement::kNone;
  std::vector<double> seconds(10, 0.0);
  std::vector<double> scans(10, 0.0);
  std::size_t features = 0;
  for (auto _ : state) {
    LogSolver solver(Builtins(), options);
    double last = CpuSeconds();
    const double begin = last;
    // The EM at the end is no scan's cost.
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      solver.AddScan(log.scans[i]);
      const double now = CpuSeconds();
      const std::size_t tenth = i * 10 / log.scans.size();
      seconds[tenth] += now - last;
      scans[tenth] += 1.0;
      last = now;
    }
    state.SetIterationTime(last - begin);
    features = solver.graph().num_features();
  }
  const auto mean = [&](int tenth) { return seconds[tenth] / scans[tenth]; };
  state.counters["features"] = static_cast<double>(features);
  state.counters["last_over_second_tenth"] = mean(9) / mean(1);
  for (int tenth = 0; tenth < 10; ++tenth) {
    // Two digits, so that they are printed in order.
    const std::string number = std::to_string(tenth + 101).substr(1);
    state.counters["tenth_" + number] = mean(tenth) / mean(1);
  }
}

void RegisterLog(const std::string& name, const std::string& path) {
  const auto log =
      std::make_shared<const Log>(ReadCarmenLog(path, LaserOptions()));
  RegisterParts(name, *log);
  benchmark::RegisterBenchmark(
      ("ScanCostAgainstMapSize/" + name).c_str(),
      [log](benchmark::State& state) { ScanCostAgainstMapSize(state, *log); })
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kSecond);
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  try {
    plumbline::RegisterLog("office",
                           PLUMBLINE_SOURCE_DIR "/datasets/office.clf.gz");
    if (const char* folder = std::getenv("PLUMBLINE_DATASETS")) {
      plumbline::RegisterLog("mit-killian",
                             std::string(folder) + "/mit-killian.clf.bz2");
    } else {
      std::fprintf(stderr,
                   "PLUMBLINE_DATASETS is not set: without mit-killian\n");
    }
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "frontend_benchmark: %s\n", error.what());
    return 1;
  }
  benchmark::Shutdown();
  return 0;
}
