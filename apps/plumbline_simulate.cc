// Drives a robot with a laser and drifting odometry through a synthetic
// building and writes what it measures as a log, with the truth; or
// writes one of the paper's synthetic worlds as a graph.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/output_files.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/apps/simulation/bent_world.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/stress.h>
#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph_g2o.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

namespace {

const plumbline::LaserModel kLaser;
const plumbline::OdometryOptions kOdometry;
const plumbline::DriveOptions kDrive;
const plumbline::BentOptions kBent;

}  // namespace

DEFINE_string(world, "",
              "Building: office, killian_like, oblique, symmetric, parallel, "
              "bent, bent_niches, or a world file. Graph: S1 to S6.");
DEFINE_uint64(seed, 1,
              "Draws the dimensions of a built-in world, the sway of the robot "
              "and all noise.");
DEFINE_double(size, 1.0,
              "Multiplies the blocks of a built-in world both ways, or the "
              "length of bent corridors.");
PLUMBLINE_FLAG_RANGE(size, 0.01, 100);
DEFINE_double(rotation, 0.0, "Turns the whole world by so many degrees.");
PLUMBLINE_FLAG_RANGE(rotation, -360, 360);

DEFINE_double(bend_deg, kBent.bend_deg,
              "bent, bent_niches: degrees at which the two corridors meet.");
PLUMBLINE_FLAG_RANGE(bend_deg, -60, 60);

DEFINE_double(position_noise, -1.0,
              "S1 to S6: largest error of initial positions on x and y, m; -1: "
              "the world's own.");
PLUMBLINE_FLAG_RANGE(position_noise, -1, 10);
DEFINE_double(distance_noise, -1.0,
              "S1 to S5: largest error of distances, m; -1: the world's own.");
PLUMBLINE_FLAG_RANGE(distance_noise, -1, 0.4);
DEFINE_int32(outliers, -1,
             "S1 to S5: points beside the structure; -1: the world's own.");
PLUMBLINE_FLAG_RANGE(outliers, -1, 1000);

DEFINE_string(output, "",
              "Log (gzip when the name ends in .gz) or g2o file to write.");
DEFINE_string(format, "carmen",
              "Of the log: carmen, ros1 (a bag of ROS 1), ros2_db3 (a folder "
              "with metadata.yaml and .db3), mcap or csv. All say the same.");
PLUMBLINE_FLAG_CHOICES(format, "carmen", "ros1", "ros2_db3", "mcap", "csv");
DEFINE_string(bag_compression, "none",
              "Of chunks: none, bz2 or lz4 (ros1), none, lz4 or zstd (mcap).");
PLUMBLINE_FLAG_CHOICES(bag_compression, "none", "bz2", "lz4", "zstd");
DEFINE_string(truth, "",
              "Where to write walls and poses, or positions and structure, as "
              "JSON.");
DEFINE_string(relations, "",
              "Where to write exact displacements between scans.");
DEFINE_string(save_world, "",
              "Where to write the world itself as a world file.");

DEFINE_int32(beams, kLaser.beams,
             "Beams: 180 or 181 (1 degree), 360 or 361 (half).");
PLUMBLINE_FLAG_CHOICES(beams, "180", "181", "360", "361");
DEFINE_double(maximum_range, kLaser.maximum_range,
              "m; farther away there is no return.");
PLUMBLINE_FLAG_RANGE(maximum_range, 0.5, 80);
DEFINE_double(range_noise, kLaser.noise, "Standard deviation of a range, m.");
PLUMBLINE_FLAG_RANGE(range_noise, 0, 1);
DEFINE_double(range_noise_per_metre, kLaser.noise_per_metre,
              "What every metre of range adds to the deviation, m.");
PLUMBLINE_FLAG_RANGE(range_noise_per_metre, 0, 1);
DEFINE_double(missing, kLaser.missing,
              "Probability that a beam gets no return.");
PLUMBLINE_FLAG_RANGE(missing, 0, 1);
DEFINE_double(laser_offset, kLaser.offset,
              "Laser in front of the robot's centre, m.");
PLUMBLINE_FLAG_RANGE(laser_offset, -1, 1);

DEFINE_double(odometry_scale, kOdometry.scale, "Relative error of distances.");
PLUMBLINE_FLAG_RANGE(odometry_scale, -0.5, 0.5);
DEFINE_double(odometry_turn_scale, kOdometry.turn_scale,
              "Relative error of turns.");
PLUMBLINE_FLAG_RANGE(odometry_turn_scale, -0.5, 0.5);
DEFINE_double(odometry_heading_bias, kOdometry.heading_bias_deg,
              "Degrees that the heading turns away every metre.");
PLUMBLINE_FLAG_RANGE(odometry_heading_bias, -10, 10);
DEFINE_double(odometry_noise, kOdometry.noise,
              "Standard deviation of a distance of 1 m, m; grows with the root "
              "of the distance.");
PLUMBLINE_FLAG_RANGE(odometry_noise, 0, 1);
DEFINE_double(odometry_heading_noise, kOdometry.heading_noise_deg,
              "Standard deviation of the heading after 1 m, degrees; grows "
              "with the root of the distance.");
PLUMBLINE_FLAG_RANGE(odometry_heading_noise, 0, 20);
DEFINE_double(odometry_turn_noise, kOdometry.turn_noise_deg,
              "Standard deviation of a turn of 1 degree, degrees; grows with "
              "the root of the turn.");
PLUMBLINE_FLAG_RANGE(odometry_turn_noise, 0, 5);

DEFINE_double(speed, kDrive.speed, "m/s on straight ways.");
PLUMBLINE_FLAG_RANGE(speed, 0.05, 3);
DEFINE_double(turn_rate, kDrive.turn_rate, "rad/s at most.");
PLUMBLINE_FLAG_RANGE(turn_rate, 0.05, 3);
DEFINE_double(sway, kDrive.sway,
              "Standard deviation of disturbances of the turn rate, rad/s.");
PLUMBLINE_FLAG_RANGE(sway, 0, 0.5);
DEFINE_double(scan_rate, kDrive.scan_rate, "Scans a second.");
PLUMBLINE_FLAG_RANGE(scan_rate, 1, 50);

DEFINE_string(stress, "none",
              "What happens to the log: turns or stale (scans of turns are "
              "missing; odometry goes on, or catches up late), dead, scale or "
              "jump (odometry), blind or people (scans), carried (150 scans "
              "are missing and odometry does not know).");
PLUMBLINE_FLAG_CHOICES(stress, "none", "turns", "stale", "dead", "scale",
                       "jump", "blind", "people", "carried");
DEFINE_int32(stress_count, 5, "How often, where there is room.");
PLUMBLINE_FLAG_RANGE(stress_count, 1, 1000);

namespace plumbline {
namespace {

bool EndsWith(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

// Bytes.
constexpr std::size_t kLargestWorldFile = std::size_t{1} << 28;

bool IsBuiltIn(const std::string& world) {
  const std::vector<std::string>& names = BuiltInWorlds();
  return std::find(names.begin(), names.end(), world) != names.end();
}

bool IsBent(const std::string& world) {
  return world == "bent" || world == "bent_niches";
}

World LoadWorld() {
  if (IsBuiltIn(FLAGS_world)) {
    return MakeWorld(FLAGS_world, FLAGS_seed, FLAGS_size);
  }
  if (IsBent(FLAGS_world)) {
    BentOptions options =
        FLAGS_world == "bent" ? BentOptions() : NichesOptions();
    options.bend_deg = FLAGS_bend_deg;
    if (options.length.low * FLAGS_size < kLeastCorridorLength) {
      std::ostringstream least;
      least << kLeastCorridorLength / options.length.low;
      std::ostringstream size;
      size << FLAGS_size;
      throw Error("--size", 0,
                  size.str() + " is too small for --world=" + FLAGS_world,
                  "at least " + least.str());
    }
    options.length.low *= FLAGS_size;
    options.length.high *= FLAGS_size;
    return MakeBentWorld(options, FLAGS_seed);
  }
  try {
    std::istringstream text(ReadTextInput(FLAGS_world, kLargestWorldFile));
    return ReadWorld(text, FLAGS_world);
  } catch (const Error& error) {
    if (std::filesystem::is_regular_file(FLAGS_world)) throw;
    throw Error(
        "--world", 0,
        "'" + FLAGS_world + "' is no built-in world and no readable file",
        "office, killian_like, oblique, symmetric, parallel, bent, "
        "bent_niches, "
        "S1 to S6 or a world file");
  }
}

SimulatorOptions OptionsFromFlags() {
  SimulatorOptions options;
  options.laser.beams = FLAGS_beams;
  options.laser.maximum_range = FLAGS_maximum_range;
  options.laser.noise = FLAGS_range_noise;
  options.laser.noise_per_metre = FLAGS_range_noise_per_metre;
  options.laser.missing = FLAGS_missing;
  options.laser.offset = FLAGS_laser_offset;
  options.odometry.scale = FLAGS_odometry_scale;
  options.odometry.turn_scale = FLAGS_odometry_turn_scale;
  options.odometry.heading_bias_deg = FLAGS_odometry_heading_bias;
  options.odometry.noise = FLAGS_odometry_noise;
  options.odometry.heading_noise_deg = FLAGS_odometry_heading_noise;
  options.odometry.turn_noise_deg = FLAGS_odometry_turn_noise;
  options.drive.speed = FLAGS_speed;
  options.drive.turn_rate = FLAGS_turn_rate;
  options.drive.sway = FLAGS_sway;
  options.drive.scan_rate = FLAGS_scan_rate;
  return options;
}

// What the log says about itself: everything that made it, no file names.
std::string Provenance() {
  std::string text = "plumbline_simulate --world=" +
                     FLAGS_world.substr(FLAGS_world.rfind('/') + 1) +
                     " --seed=" + std::to_string(FLAGS_seed);
  for (const FlagValue& flag : ChangedFlags()) {
    if ((flag.type != "string" || flag.name == "stress") &&
        flag.name != "seed" && flag.name != "quiet" && flag.name != "verbose") {
      text += " --" + flag.name + "=" + flag.value;
    }
  }
  return text;
}

bool IsSynthetic(const std::string& world) {
  const std::vector<std::string>& names = SyntheticWorldNames();
  return std::find(names.begin(), names.end(), world) != names.end();
}

int RunSynthetic() {
  if (!FLAGS_relations.empty() || !FLAGS_save_world.empty()) {
    throw Error("plumbline_simulate", 0,
                FLAGS_world + " is a graph, not a building with a robot",
                "no --relations and no --save_world");
  }
  SyntheticOptions options = DefaultSyntheticOptions(FLAGS_world);
  if (FLAGS_position_noise >= 0.0)
    options.position_noise = FLAGS_position_noise;
  if (FLAGS_distance_noise >= 0.0)
    options.distance_noise = FLAGS_distance_noise;
  if (FLAGS_outliers >= 0) options.outliers = FLAGS_outliers;
  Registry registry;
  RegisterBuiltinRelations(&registry);
  const SyntheticWorld world =
      MakeSyntheticWorld(FLAGS_world, options, FLAGS_seed, registry);
  WriteFileAtomically(FLAGS_output, [&](std::ostream& output) {
    std::ostringstream text;
    text << "# " << Provenance() << '\n';
    WriteG2o(*world.graph, nullptr, text);
    output << (EndsWith(FLAGS_output, ".gz") ? GzipCompress(text.str())
                                             : text.str());
  });
  if (!FLAGS_truth.empty()) {
    WriteFileAtomically(FLAGS_truth, [&](std::ostream& output) {
      WriteSyntheticTruth(world.truth, output);
    });
  }
  std::cout << world.graph->num_features() << " features, "
            << world.graph->num_constraints() << " constraints; "
            << world.truth.num_virtual_features()
            << " virtual features to be found\n";
  return kExitSuccess;
}

// The log in the format that was asked for.
void WriteLog(const Simulation& simulation, const LaserModel& laser) {
  if (FLAGS_format == "ros2_db3") {
    WriteRosbag2(SimulatedMessages(simulation, laser, MessageEncoding::kCdr),
                 FLAGS_output);
    return;
  }
  WriteFileAtomically(FLAGS_output, [&](std::ostream& output) {
    std::ostringstream text;
    if (FLAGS_format == "carmen") {
      WriteCarmenLog(simulation, laser, {Provenance()}, text);
    } else if (FLAGS_format == "csv") {
      WriteCsvLog(simulation, laser, {Provenance()}, text);
    } else {
      BagWriterOptions options;
      options.compression = FLAGS_bag_compression;
      const bool is_ros1 = FLAGS_format == "ros1";
      const std::vector<BagRecord> messages = SimulatedMessages(
          simulation, laser,
          is_ros1 ? MessageEncoding::kRos1 : MessageEncoding::kCdr);
      text << (is_ros1 ? MakeRosbag1(messages, options)
                       : MakeMcap(messages, options));
    }
    output << (EndsWith(FLAGS_output, ".gz") ? GzipCompress(text.str())
                                             : text.str());
  });
}

// A compression that the format does not have is refused before the work.
void CheckCompression() {
  const std::string& kind = FLAGS_bag_compression;
  if (kind == "none" ||
      (FLAGS_format == "ros1" && (kind == "bz2" || kind == "lz4")) ||
      (FLAGS_format == "mcap" && (kind == "lz4" || kind == "zstd"))) {
    return;
  }
  throw Error("--bag_compression", 0,
              "'" + kind + "' does not go with --format=" + FLAGS_format,
              FLAGS_format == "ros1"   ? "none, bz2 or lz4"
              : FLAGS_format == "mcap" ? "none, lz4 or zstd"
                                       : "none");
}

int Run() {
  if (FLAGS_world.empty() || FLAGS_output.empty()) {
    throw FlagError(FLAGS_world.empty() ? "world" : "output", "it is missing",
                    FLAGS_world.empty() ? "a world (--help lists them)"
                                        : "a file to write");
  }
  const bool is_file = !IsSynthetic(FLAGS_world) && !IsBuiltIn(FLAGS_world) &&
                       !IsBent(FLAGS_world);
  CheckOutputFiles({{"world", is_file ? FLAGS_world : ""}},
                   {{"output", FLAGS_output},
                    {"truth", FLAGS_truth},
                    {"relations", FLAGS_relations},
                    {"save_world", FLAGS_save_world}});
  if (IsSynthetic(FLAGS_world)) return RunSynthetic();
  CheckCompression();
  World world = LoadWorld();
  RotateWorld(FLAGS_rotation, &world);
  SimulatorOptions options = OptionsFromFlags();
  Progress progress("simulating", "per mille", 1000);
  options.progress = [&progress](double share) {
    progress.Update(static_cast<std::int64_t>(1000 * share));
    return true;
  };
  Simulation simulation = Simulate(world, options, FLAGS_seed);
  progress.Finish();
  if (FLAGS_stress != "none") {
    Stress(FLAGS_stress, FLAGS_stress_count, FLAGS_seed,
           options.laser.maximum_range, &simulation);
  }
  Detail("%zu steps driven, writing %s", simulation.states.size(),
         FLAGS_output.c_str());

  WriteLog(simulation, options.laser);
  if (!FLAGS_save_world.empty()) {
    WriteFileAtomically(FLAGS_save_world, [&](std::ostream& output) {
      output << "# " << Provenance() << '\n';
      WriteWorld(world, output);
    });
  }
  if (!FLAGS_truth.empty()) {
    WriteFileAtomically(FLAGS_truth, [&](std::ostream& output) {
      WriteTruth(simulation, output);
    });
  }
  if (!FLAGS_relations.empty()) {
    WriteFileAtomically(FLAGS_relations, [&](std::ostream& output) {
      WriteRelations(simulation, FLAGS_seed, output);
    });
  }
  std::size_t scans = 0;
  double way = 0.0;
  for (std::size_t i = 0; i < simulation.states.size(); ++i) {
    const SimulatedState& state = simulation.states[i];
    if (!state.ranges.empty()) ++scans;
    if (i > 0) {
      way += (state.pose - simulation.states[i - 1].pose).head<2>().norm();
    }
  }
  const SimulatedState& last = simulation.states.back();
  std::cout << scans << " scans on " << static_cast<int>(way + 0.5)
            << " m; odometry ends "
            << (last.pose - last.odometry).head<2>().norm() << " m off\n";
  return kExitSuccess;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_simulate";
  info.summary =
      "Drives a robot with a laser and drifting odometry through a synthetic "
      "building and writes a log, with the true walls and poses; or "
      "writes a world of the synthetic experiments as a graph, with its "
      "structure. The same flags give the same files.";
  info.usage = {"--world=NAME_OR_FILE --output=LOG [flags]",
                "--world=S1|...|S6 --output=GRAPH [flags]"};
  info.example =
      "plumbline_simulate --world=office --seed=7 --output=office.clf "
      "--truth=office.truth.json";
  info.groups = {
      {"World", {"world", "seed", "size", "rotation", "bend_deg"}},
      {"Graphs", {"position_noise", "distance_noise", "outliers"}},
      {"Output",
       {"output", "format", "bag_compression", "truth", "relations",
        "save_world", "quiet", "verbose"}},
      {"Laser",
       {"beams", "maximum_range", "range_noise", "range_noise_per_metre",
        "missing", "laser_offset"}},
      {"Odometry",
       {"odometry_scale", "odometry_turn_scale", "odometry_heading_bias",
        "odometry_noise", "odometry_heading_noise", "odometry_turn_noise"}},
      {"Drive", {"speed", "turn_rate", "sway", "scan_rate"}},
      {"Stress", {"stress", "stress_count"}}};
  // A log that is cut short would not tell: what was there before stays.
  info.interrupts_end_it = true;
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
