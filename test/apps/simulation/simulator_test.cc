#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/error.h>
#include <zlib.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

World ReadSimulated(const std::string& text) {
  std::istringstream input(text);
  return ReadWorld(input, "test.world");
}

// A room of 10 m by 6 m with a way through its middle.
World Room() {
  return ReadSimulated(
      "wall 0 0 10 0\nwall 10 0 10 6\nwall 10 6 0 6\nwall 0 6 0 0\n"
      "path 2 3 8 3\n");
}

SimulatorOptions Exact() {
  SimulatorOptions options;
  options.laser.noise = 0.0;
  options.laser.missing = 0.0;
  options.drive.sway = 0.0;
  options.odometry = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  return options;
}

std::string LogText(const Simulation& simulation, const LaserModel& laser) {
  std::ostringstream output;
  WriteCarmenLog(simulation, laser, {}, output);
  return output.str();
}

std::string ReadGzip(const std::string& path) {
  gzFile file = gzopen(path.c_str(), "rb");
  EXPECT_NE(file, nullptr) << path;
  if (file == nullptr) return "";
  std::string text;
  char buffer[65536];
  for (int n = 0; (n = gzread(file, buffer, sizeof(buffer))) > 0;) {
    text.append(buffer, n);
  }
  gzclose(file);
  return text;
}

std::string Contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(CastBeamsTest, HitsTheNearestSurface) {
  const WorldSurfaces surfaces = MakeSurfaces(
      ReadSimulated("wall 5 -1 5 1\nwall 3 -1 3 0.5\nwall -2 -9 -2 9\n"));
  std::vector<std::pair<int, double>> hits;
  const std::vector<double> ranges = CastBeams(
      surfaces, Pose2(1.0, 0.0, 0.0), -kPi / 2, kPi / 2, 3, 50.0, &hits);
  EXPECT_EQ(ranges[0], kInfinity);
  EXPECT_NEAR(ranges[1], 2.0, 1e-12);
  EXPECT_EQ(ranges[2], kInfinity);
  EXPECT_EQ(hits[0].first, -1);
  EXPECT_EQ(hits[1].first, 1);
  EXPECT_NEAR(hits[1].second, 1.0, 1e-12);
}

TEST(CastBeamsTest, SeesWhatStandsAcrossTheCutBehind) {
  const WorldSurfaces surfaces =
      MakeSurfaces(ReadSimulated("wall -2 -9 -2 9\n"));
  // 0, 90, 180 and 270 degrees.
  const std::vector<double> ranges =
      CastBeams(surfaces, Pose2(0.0, 0.0, 0.0), 0.0, kPi / 2, 4, 50.0, nullptr);
  EXPECT_EQ(ranges[0], kInfinity);
  EXPECT_EQ(ranges[1], kInfinity);
  EXPECT_NEAR(ranges[2], 2.0, 1e-12);
  EXPECT_EQ(ranges[3], kInfinity);
}

TEST(CastBeamsTest, EveryBeamOfAClosedRoomReturnsItsDistance) {
  const WorldSurfaces surfaces = MakeSurfaces(Room());
  // 4 m from the right wall, 3 m from the lower and upper: beam at angle a
  // ends at min(4 / |cos a|, 3 / |sin a|) to the right and 6 / |cos a| to the
  // left.
  const Pose2 laser(6.0, 3.0, 0.3);
  const std::vector<double> ranges =
      CastBeams(surfaces, laser, -kPi, kPi / 180, 361, 50.0, nullptr);
  for (int i = 0; i < 361; ++i) {
    const double a = laser[2] - kPi + i * kPi / 180;
    const double x = (std::cos(a) > 0 ? 4.0 : 6.0) / std::abs(std::cos(a));
    EXPECT_NEAR(ranges[i], std::min(x, 3.0 / std::abs(std::sin(a))), 1e-9) << i;
  }
}

TEST(CastBeamsTest, ColumnsAndCurvedWalls) {
  const WorldSurfaces surfaces = MakeSurfaces(
      ReadSimulated("circle 5 0 1\narc 0 0 3 45 135\narc 0 -6 2 -45 45\n"));
  const std::vector<double> ranges = CastBeams(
      surfaces, Pose2(0.0, 0.0, 0.0), -kPi / 2, kPi / 2, 3, 50.0, nullptr);
  // Straight down the third arc has no part on the y axis.
  EXPECT_EQ(ranges[0], kInfinity);
  EXPECT_NEAR(ranges[1], 4.0, 1e-12);
  EXPECT_NEAR(ranges[2], 3.0, 1e-12);
  // From inside the circle its far side is hit.
  EXPECT_NEAR(
      CastBeams(surfaces, Pose2(5.5, 0.0, 0.0), 0.0, 1.0, 1, 50.0, nullptr)[0],
      0.5, 1e-12);
}

TEST(CastBeamsTest, NothingBeyondTheMaximumRange) {
  const WorldSurfaces surfaces = MakeSurfaces(ReadSimulated("wall 5 -9 5 9\n"));
  const Pose2 laser(0.0, 0.0, 0.0);
  EXPECT_EQ(CastBeams(surfaces, laser, 0.0, 1.0, 1, 4.9, nullptr)[0],
            kInfinity);
  EXPECT_NEAR(CastBeams(surfaces, laser, 0.0, 1.0, 1, 5.1, nullptr)[0], 5.0,
              1e-12);
  // Along the wall's own line there is nothing to hit.
  EXPECT_EQ(CastBeams(surfaces, Pose2(5.0, -20.0, kPi / 2), 0.0, 1.0, 1, 50.0,
                      nullptr)[0],
            kInfinity);
}

TEST(DriveTest, FollowsThePathToItsEnd) {
  const std::vector<SimulatedState> states =
      Drive(ReadSimulated("path 0 0 5 0 5 5 5 0\n"), DriveOptions(), 1);
  EXPECT_EQ(states.front().pose, Pose2(0.0, 0.0, 0.0));
  EXPECT_EQ(states.front().time, 1000.0);
  EXPECT_NEAR(states[4].time, 1000.2, 1e-9);
  EXPECT_NEAR((states.back().pose.head<2>() - Eigen::Vector2d(5, 0)).norm(), 0,
              0.15);
  double top = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    const Pose2 step = Between(states[i - 1].pose, states[i].pose);
    ASSERT_LT(step.head<2>().norm(), 0.75 * 0.05);
    ASSERT_LT(std::abs(step[2]), 1.0 * 0.05);
    top = std::max(top, states[i].pose[1]);
  }
  EXPECT_NEAR(top, 4.7, 0.3);
}

TEST(DriveTest, RefusesWaysThroughWalls) {
  try {
    Drive(ReadSimulated("wall 5 -5 5 5\npath 0 0 10 0\n"), DriveOptions(), 1);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("test.world: the robot runs into something near x = "
                          "4.8"));
  }
  EXPECT_THROW(Drive(ReadSimulated("circle 5 0 0.5\npath 0 0 10 0\n"),
                     DriveOptions(), 1),
               Error);
  EXPECT_THROW(Drive(ReadSimulated("box 5 0 1 1 20\npath 0 0 10 0\n"),
                     DriveOptions(), 1),
               Error);
  EXPECT_THROW(Drive(ReadSimulated("path 0 0\n"), DriveOptions(), 1), Error);
}

// All of a drive is held in memory.
TEST(DriveTest, RefusesWaysWithoutEnd) {
  std::string path = "path 0 0";
  for (int i = 0; i < 100; ++i) path += " 1e5 0 0 0";
  try {
    Drive(ReadSimulated(path + "\n"), DriveOptions(), 1);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("a way of 20000000 m may take"));
  }
}

TEST(DriveTest, EveryBuildingCanBeDrivenThrough) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const World world = MakeWorld("office", seed, 1.0);
    EXPECT_NO_THROW(Drive(world, DriveOptions(), seed)) << "seed " << seed;
  }
  EXPECT_NO_THROW(Drive(MakeWorld("office", 1, 2.0), DriveOptions(), 1));
  EXPECT_NO_THROW(Drive(MakeWorld("office", 2, 0.5), DriveOptions(), 1));
  EXPECT_NO_THROW(Drive(MakeWorld("killian_like", 1, 0.5), DriveOptions(), 1));
}

TEST(SimulateTest, WithoutNoiseScansAndOdometryAreTheTruth) {
  const Simulation simulation = Simulate(Room(), Exact(), 1);
  for (const SimulatedState& state : simulation.states) {
    ASSERT_NEAR((state.odometry - state.pose).norm(), 0.0, 1e-9);
    if (state.ranges.empty()) continue;
    ASSERT_EQ(state.ranges.size(), 180u);
    // The beams at -90 and 0 degrees.
    ASSERT_NEAR(state.ranges[0], 3.0, 1e-9);
    ASSERT_NEAR(state.ranges[90], 10.0 - state.pose[0], 1e-9);
  }
}

TEST(SimulateTest, TurnedAndFurtherForwardLaser) {
  World world = Room();
  RotateWorld(30.0, &world);
  SimulatorOptions options = Exact();
  options.laser.offset = 0.25;
  const Simulation simulation = Simulate(world, options, 1);
  EXPECT_NEAR(simulation.states[0].pose[2], DegToRad(30.0), 1e-12);
  EXPECT_NEAR(simulation.states[0].ranges[90], 7.75, 1e-9);
  const std::string log = LogText(simulation, options.laser);
  EXPECT_THAT(log, HasSubstr("PARAM robot_frontlaser_offset 0.250 "));
  std::istringstream line(log.substr(log.find("FLASER 180 ")));
  std::vector<std::string> words(2 + 180 + 9);
  for (std::string& word : words) line >> word;
  // The robot at (2, 3) and the laser at (2.25, 3), turned by 30 degrees.
  EXPECT_THAT(
      std::vector<std::string>(words.begin() + 182, words.end()),
      ElementsAre("0.448557", "3.723076", "0.523599", "0.232051", "3.598076",
                  "0.523599", "1000.000000", "plumbline", "1000.000000"));
}

TEST(SimulateTest, NoiseHasTheGivenSize) {
  SimulatorOptions options = Exact();
  options.laser.noise = 0.02;
  options.laser.noise_per_metre = 0.01;
  options.laser.missing = 0.1;
  const Simulation simulation = Simulate(Room(), options, 1);
  double squares = 0.0;
  int count = 0;
  int missing = 0;
  int all = 0;
  for (const SimulatedState& state : simulation.states) {
    if (state.ranges.empty()) continue;
    const std::vector<double> truth =
        CastBeams(simulation.surfaces, state.pose, -kPi / 2, DegToRad(1.0), 180,
                  50.0, nullptr);
    for (int i = 0; i < 180; ++i) {
      ++all;
      if (state.ranges[i] == 81.83) {
        ++missing;
        continue;
      }
      const double scaled =
          (state.ranges[i] - truth[i]) / (0.02 + 0.01 * truth[i]);
      squares += scaled * scaled;
      ++count;
    }
  }
  ASSERT_GT(all, 5000);
  EXPECT_NEAR(squares / count, 1.0, 0.06);
  EXPECT_NEAR(static_cast<double>(missing) / all, 0.1, 0.02);
}

TEST(SimulateTest, OdometryDriftsAsItsOptionsSay) {
  SimulatorOptions options = Exact();
  options.odometry.scale = 0.1;
  const World world = ReadSimulated("path 0 0 20 0\n");
  const SimulatedState scaled = Simulate(world, options, 1).states.back();
  EXPECT_NEAR(scaled.odometry[0], 1.1 * scaled.pose[0], 1e-9);
  options.odometry.scale = 0.0;
  options.odometry.heading_bias_deg = 0.5;
  const SimulatedState biased = Simulate(world, options, 1).states.back();
  EXPECT_NEAR(biased.odometry[2], DegToRad(0.5 * biased.pose[0]), 1e-9);
  options.odometry.heading_bias_deg = 0.0;
  options.odometry.turn_scale = 0.1;
  const SimulatedState turned =
      Simulate(ReadSimulated("path 0 0 5 0 5 5\n"), options, 1).states.back();
  EXPECT_NEAR(turned.odometry[2], 1.1 * turned.pose[2], 1e-9);
}

TEST(SimulateTest, MoreOdometryNoiseChangesNothingElse) {
  SimulatorOptions options;
  const Simulation a = Simulate(Room(), options, 3);
  options.odometry.noise = 0.5;
  const Simulation b = Simulate(Room(), options, 3);
  ASSERT_EQ(a.states.size(), b.states.size());
  EXPECT_EQ(a.states.back().pose, b.states.back().pose);
  EXPECT_EQ(a.states[6].ranges, b.states[6].ranges);
  EXPECT_NE(a.states.back().odometry, b.states.back().odometry);
  EXPECT_EQ(a.states.front().odometry, a.states.front().pose);
}

TEST(SimulateTest, SeenIsWhatBeamsHit) {
  // From x = 2 to 8 at y = 3, looking ahead: the right wall is seen whole, the
  // left wall never, the lower one from the robot's side on.
  const Simulation simulation = Simulate(Room(), Exact(), 1);
  ASSERT_EQ(simulation.seen.size(), 4u);
  ASSERT_EQ(simulation.seen[0].size(), 1u);
  EXPECT_NEAR(simulation.seen[0][0].first, 2.0, 0.1);
  EXPECT_NEAR(simulation.seen[0][0].second, 10.0, 0.1);
  ASSERT_EQ(simulation.seen[1].size(), 1u);
  EXPECT_NEAR(simulation.seen[1][0].first, 0.0, 0.1);
  EXPECT_NEAR(simulation.seen[1][0].second, 6.0, 0.1);
  EXPECT_TRUE(simulation.seen[3].empty());
}

TEST(SimulateTest, SeenHasGapsWhereSomethingStandsInFront) {
  World world = Room();
  // Right at the wall, so that it hides the same part from everywhere: from
  // (8, 3) y = 3.68 to 4.21, from (2, 3) y = 3.66 to 4.17.
  world.boxes.push_back({{9.9, 3.9}, 0.1, 0.5, 0.0});
  const Simulation simulation = Simulate(world, Exact(), 1);
  ASSERT_EQ(simulation.seen[1].size(), 2u);
  EXPECT_NEAR(simulation.seen[1][0].second, 3.67, 0.05);
  EXPECT_NEAR(simulation.seen[1][1].first, 4.19, 0.05);
}

TEST(SimulateTest, ProgressCanEndIt) {
  SimulatorOptions options = Exact();
  int scans = 0;
  options.progress = [&scans](double) { return ++scans < 5; };
  const Simulation simulation = Simulate(Room(), options, 1);
  int taken = 0;
  for (const SimulatedState& state : simulation.states) {
    if (!state.ranges.empty()) ++taken;
  }
  EXPECT_EQ(taken, 5);
}

TEST(SimulateTest, RefusesOptionsOutOfRange) {
  const auto refuses = [](const std::function<void(SimulatorOptions*)>& set) {
    SimulatorOptions options;
    set(&options);
    EXPECT_THROW(Simulate(Room(), options, 1), Error);
  };
  refuses([](SimulatorOptions* o) { o->laser.beams = 90; });
  refuses([](SimulatorOptions* o) { o->laser.maximum_range = 0.0; });
  refuses([](SimulatorOptions* o) { o->laser.maximum_range = 90.0; });
  refuses([](SimulatorOptions* o) { o->laser.noise = -1.0; });
  refuses([](SimulatorOptions* o) { o->laser.missing = 1.5; });
  refuses([](SimulatorOptions* o) { o->odometry.noise = -1.0; });
  refuses([](SimulatorOptions* o) { o->drive.speed = 0.0; });
  refuses([](SimulatorOptions* o) { o->drive.scan_rate = 0.0; });
}

TEST(WriteTruthTest, IsTheDocumentedJson) {
  const Simulation simulation = Simulate(Room(), Exact(), 1);
  std::ostringstream output;
  WriteTruth(simulation, output);
  const nlohmann::json truth = nlohmann::json::parse(output.str());
  EXPECT_EQ(truth["format"], "plumbline-truth");
  EXPECT_EQ(truth["version"], 1);
  EXPECT_EQ(truth["orientations_deg"], nlohmann::json({0.0, 90.0}));
  ASSERT_EQ(truth["walls"].size(), 4u);
  EXPECT_EQ(truth["walls"][1]["id"], 1);
  EXPECT_EQ(truth["walls"][1]["x1"], 10.0);
  EXPECT_EQ(truth["walls"][1]["y2"], 6.0);
  EXPECT_EQ(truth["walls"][1]["orientation"], 1);
  ASSERT_EQ(truth["walls"][1]["seen"].size(), 1u);
  EXPECT_EQ(truth["walls"][3]["seen"].size(), 0u);
  EXPECT_EQ(truth["poses"][0], nlohmann::json({1000.0, 2.0, 3.0, 0.0}));
  std::size_t scans = 0;
  for (const SimulatedState& state : simulation.states) {
    if (!state.ranges.empty()) ++scans;
  }
  EXPECT_EQ(truth["poses"].size(), scans);
}

TEST(WriteRelationsTest, AreExactDisplacementsOfTheTruth) {
  const Simulation simulation =
      Simulate(ReadSimulated("path 0 0 6 0 6 6\n"), Exact(), 1);
  std::ostringstream output;
  WriteRelations(simulation, 1, output);
  std::istringstream lines(output.str());
  int count = 0;
  bool long_one = false;
  for (std::string line; std::getline(lines, line); ++count) {
    std::istringstream words(line);
    double t1, t2, x, y, z, roll, pitch, yaw;
    ASSERT_TRUE(words >> t1 >> t2 >> x >> y >> z >> roll >> pitch >> yaw);
    EXPECT_LT(t1, t2);
    const Pose2* a = nullptr;
    const Pose2* b = nullptr;
    for (const SimulatedState& state : simulation.states) {
      if (state.ranges.empty()) continue;
      if (std::abs(state.time - t1) < 1e-6) a = &state.pose;
      if (std::abs(state.time - t2) < 1e-6) b = &state.pose;
    }
    ASSERT_TRUE(a != nullptr && b != nullptr);
    const Pose2 end = Compose(*a, Pose2(x, y, yaw));
    EXPECT_NEAR((end - *b).norm(), 0.0, 1e-5);
    EXPECT_EQ(z, 0.0);
    long_one = long_one || std::hypot(x, y) > 3.0;
  }
  EXPECT_GT(count, 12);
  EXPECT_TRUE(long_one);
}

TEST(WriteCarmenLogTest, HasOneMessageALine) {
  SimulatorOptions options = Exact();
  options.laser.maximum_range = 5.0;
  const Simulation simulation = Simulate(Room(), options, 1);
  std::ostringstream output;
  WriteCarmenLog(simulation, options.laser, {"hello"}, output);
  const std::string log = output.str();
  EXPECT_THAT(log, StartsWith("# CARMEN log, simulated\n"));
  EXPECT_THAT(log, HasSubstr("\n# hello\n"));
  EXPECT_THAT(log, HasSubstr("\nPARAM robot_front_laser_max 5.00 1000.000000 "
                             "plumbline 1000.000000\n"));
  // 8 m ahead is too far.
  EXPECT_THAT(log, HasSubstr(" 81.83 "));
  EXPECT_THAT(log, HasSubstr("\nODOM 2.0"));
  EXPECT_EQ(log.back(), '\n');
  EXPECT_EQ(log.find("-0.000000 "), std::string::npos);
}

TEST(GzipCompressTest, ComesBackWhole) {
  std::string text;
  for (int i = 0; i < 20000; ++i) text += std::to_string(i * 7919 % 1000) + ' ';
  const std::string path = ::testing::TempDir() + "plumbline_gzip_test.gz";
  std::ofstream(path, std::ios::binary) << GzipCompress(text);
  EXPECT_EQ(ReadGzip(path), text);
  EXPECT_LT(GzipCompress(text).size(), text.size() / 2);
}

TEST(BundledLogTest, IsWhatTheStatedCommandMakes) {
  const std::string folder = std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/";
  const SimulatorOptions options;
  const Simulation simulation =
      Simulate(MakeWorld("office", 20, 1.0), options, 20);
  std::ostringstream log;
  WriteCarmenLog(simulation, options.laser,
                 {"plumbline_simulate --world=office --seed=20"}, log);
  // No EXPECT_EQ: it would print megabytes.
  EXPECT_TRUE(log.str() == ReadGzip(folder + "office.clf.gz"));
  std::ostringstream truth;
  WriteTruth(simulation, truth);
  EXPECT_TRUE(truth.str() == Contents(folder + "office.truth.json"));
  std::ostringstream relations;
  WriteRelations(simulation, 20, relations);
  EXPECT_TRUE(relations.str() == Contents(folder + "office.relations"));
}

TEST(BundledLogTest, ExampleWorldCanBeDriven) {
  const std::string path =
      std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/rotunda.world";
  std::ifstream file(path);
  ASSERT_TRUE(file.good());
  const World world = ReadWorld(file, path);
  const Simulation simulation = Simulate(world, SimulatorOptions(), 1);
  EXPECT_GT(simulation.states.size(), 300u);
  // Walls at -45, 0, 45 and 90 degrees.
  EXPECT_EQ(simulation.surfaces.orientations_deg.size(), 4u);
}

}  // namespace
}  // namespace plumbline
