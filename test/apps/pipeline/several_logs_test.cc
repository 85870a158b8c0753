#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/trajectory_alignment.h>
#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/key_scan_archive.h>
#include <plumbline/frontend/key_views.h>
#include <plumbline/frontend/track_placement.h>
#include <plumbline/pipeline/known_structure.h>
#include <plumbline/pipeline/several_logs.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class SeveralLogsTest : public ::testing::Test {
 protected:
  SeveralLogsTest() {
    RegisterBuiltins(&registry_);
    std::ifstream file(std::string(PLUMBLINE_SOURCE_DIR) +
                       "/datasets/office.truth.json");
    const auto json = nlohmann::json::parse(file);
    for (const auto& pose : json["poses"]) {
      truth_[std::lround(1e3 * pose[0].get<double>())] =
          Pose2(pose[1], pose[2], pose[3]);
    }
  }

  static Log Office() {
    return ReadCarmenLog(
        std::string(PLUMBLINE_SOURCE_DIR) + "/datasets/office.clf.gz", {});
  }

  // Scans [begin, end), with odometry that starts at zero.
  static Log Piece(const Log& log, std::size_t begin, std::size_t end) {
    Log piece;
    piece.has_odometry = true;
    piece.scans.assign(log.scans.begin() + static_cast<std::ptrdiff_t>(begin),
                       log.scans.begin() + static_cast<std::ptrdiff_t>(end));
    const Pose2 first = Inverse(piece.scans.front().odometry);
    for (Scan& scan : piece.scans)
      scan.odometry = Compose(first, scan.odometry);
    return piece;
  }

  // Of the office.
  SeveralLogsResult SolveHalves(const SeveralLogsOptions& options) const {
    const Log office = Office();
    const std::size_t n = office.scans.size();
    return SolveSeveralLogs(
        registry_, {Piece(office, 0, n / 2), Piece(office, n / 2, n)}, options);
  }

  // The same drive through a building of the same kind, a little larger.
  static Log Enlarged(Log log) {
    for (Scan& scan : log.scans) {
      for (float& range : scan.ranges) range *= 1.1f;
      scan.odometry.head<2>() *= 1.1;
      scan.laser_offset.head<2>() *= 1.1;
    }
    return log;
  }

  // The same drive through the mirror image of the building.
  static Log Mirrored(Log log) {
    const auto mirror = [](Pose2* pose) { pose->tail<2>() *= -1.0; };
    for (Scan& scan : log.scans) {
      std::reverse(scan.ranges.begin(), scan.ranges.end());
      scan.start_angle = -scan.Bearing(scan.ranges.size() - 1);
      mirror(&scan.odometry);
      mirror(&scan.laser_offset);
    }
    return log;
  }

  // Largest error of the relative poses of scans that lie `stride` apart in a
  // map, with those of other logs, m.
  double LargestError(const MapOfLogs& map) const {
    return LargestError(map.scans, map.result.trajectory);
  }
  double LargestError(const std::vector<Scan>& scans,
                      const std::vector<Pose2>& trajectory) const {
    double largest = 0.0;
    const std::size_t n = scans.size();
    for (std::size_t i = 0; i < n; i += 7) {
      const std::size_t j = (i + n / 2) % n;
      const Pose2 error = Between(Between(TruthOf(scans[i]), TruthOf(scans[j])),
                                  Between(trajectory[i], trajectory[j]));
      largest = std::max(largest, error.head<2>().norm());
    }
    return largest;
  }

  const Pose2& TruthOf(const Scan& scan) const {
    return truth_.at(std::lround(1e3 * scan.timestamp));
  }

  Registry registry_;
  // By time stamp, ms.
  std::map<long, Pose2> truth_;
};

TEST_F(SeveralLogsTest, PiecesOfADriveBecomeOneMapInAnyOrder) {
  const Log office = Office();
  const std::size_t n = office.scans.size();
  std::vector<std::size_t> begun;
  SeveralLogsControl control;
  control.begin_log = [&](std::size_t log) { begun.push_back(log); };
  const SeveralLogsResult result =
      SolveSeveralLogs(registry_,
                       {Piece(office, n / 3, 2 * n / 3),
                        Piece(office, 2 * n / 3, n), Piece(office, 0, n / 3)},
                       {}, control);
  EXPECT_EQ(begun, (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_FALSE(result.interrupted);
  ASSERT_EQ(result.maps.size(), 1u);
  const MapOfLogs& map = result.maps.front();
  ASSERT_EQ(map.scans.size(), n);
  ASSERT_EQ(map.result.trajectory.size(), n);
  EXPECT_LT(LargestError(map), 0.25);
  EXPECT_TRUE(map.result.loose.empty());
  EXPECT_GT(LengthOfWalls(map.solver->graph()), 100.0);
  ASSERT_EQ(result.logs.size(), 3u);
  EXPECT_FALSE(result.logs[0].placement.found);
  for (std::size_t i = 0; i < 3; ++i) {
    const LogInMap& log = result.logs[i];
    EXPECT_EQ(log.map, 0u);
    EXPECT_EQ(log.placement.found, i > 0);
    ASSERT_LT(log.begin, log.end);
    // Its scans are where it says.
    const std::size_t first = i == 0 ? n / 3 : i == 1 ? 2 * n / 3 : 0;
    EXPECT_EQ(map.scans[log.begin].timestamp, office.scans[first].timestamp);
  }
}

// Poses bend until lasers that do not agree on the metre see one building.
TEST_F(SeveralLogsTest, LasersThatDisagreeOnTheMetreAreTold) {
  const Log office = Office();
  const std::size_t n = office.scans.size();
  using ::testing::Contains;
  using ::testing::HasSubstr;
  for (const float factor : {1.0f, 1.02f}) {
    Log other = Piece(office, n / 4, 3 * n / 4);
    for (Scan& scan : other.scans) {
      for (float& range : scan.ranges) range *= factor;
    }
    const SeveralLogsResult result = SolveSeveralLogs(
        registry_, {Piece(office, 0, n / 2), std::move(other)}, {});
    ASSERT_EQ(result.maps.size(), 1u);
    const std::vector<std::string>& notes = result.maps[0].result.notes;
    if (factor == 1.0f) {
      EXPECT_THAT(notes, Not(Contains(HasSubstr("the ranges of log"))));
    } else {
      EXPECT_THAT(notes, Contains(HasSubstr("the ranges of log 2 are 2.0 % "
                                            "longer")));
    }
  }
}

// First maps are bent. Where that alone speaks against a place, their poses are
// adjusted before it is looked for again.
TEST_F(SeveralLogsTest, BentFirstMapsAreStraightened) {
  SeveralLogsOptions options;
  const SeveralLogsResult bent = SolveHalves(options);
  ASSERT_EQ(bent.maps.size(), 1u);
  const double misfit = bent.logs[1].placement.misfit;
  ASSERT_GT(misfit, 0.0);
  options.placement.max_misfit = 0.9 * misfit;
  options.placement.max_misfit_per_metre = 0.0;
  const SeveralLogsResult straight = SolveHalves(options);
  ASSERT_EQ(straight.maps.size(), 1u);
  EXPECT_LT(straight.logs[1].placement.misfit, 0.9 * misfit);
  EXPECT_LT(LargestError(straight.maps.front()), 0.25);
}

// Where each of two maps is bent in itself so that adjusting them one by one
// does not help, they are adjusted together, and what is asked of a place is
// asked again.
TEST_F(SeveralLogsTest, BentFirstMapsAreStraightenedTogether) {
  SeveralLogsOptions options;
  options.placement.max_misfit_per_metre = 0.0;
  const double bent = SolveHalves(options).logs[1].placement.misfit;
  options.placement.max_misfit = 0.9 * bent;
  const double alone = SolveHalves(options).logs[1].placement.misfit;
  ASSERT_LT(alone, 0.9 * bent);
  options.placement.max_misfit = 0.9 * alone;
  const SeveralLogsResult apart = SolveHalves(options);
  ASSERT_EQ(apart.maps.size(), 2u);
  EXPECT_THAT(apart.logs[1].placement.why_not,
              ::testing::HasSubstr("not together"));
  // Of so many parts that is no chance.
  options.placement.min_plain_agreeing = apart.logs[1].placement.agreeing;
  const SeveralLogsResult together = SolveHalves(options);
  ASSERT_EQ(together.maps.size(), 1u) << together.logs[1].placement.why_not;
  EXPECT_LT(together.logs[1].placement.misfit, 0.9 * alone);
  EXPECT_LT(LargestError(together.maps.front()), 0.25);
}

TEST_F(SeveralLogsTest, DifferentBuildingsAreKeptApart) {
  const Log office = Office();
  Log other = Enlarged(Piece(office, 0, 500));
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {Piece(office, 0, 500), std::move(other)}, {});
  ASSERT_EQ(result.maps.size(), 2u);
  EXPECT_EQ(result.logs[0].map, 0u);
  EXPECT_EQ(result.logs[1].map, 1u);
  EXPECT_FALSE(result.logs[1].placement.found);
  EXPECT_FALSE(result.logs[1].placement.why_not.empty());
  for (const MapOfLogs& map : result.maps) {
    EXPECT_EQ(map.scans.size(), 500u);
    EXPECT_EQ(map.result.trajectory.size(), 500u);
    EXPECT_GT(LengthOfWalls(map.solver->graph()), 30.0);
  }
  // What is kept apart is solved as if it were alone.
  LogSolver alone(registry_, {});
  EXPECT_EQ(result.maps[0].result.trajectory,
            alone.Run(Piece(office, 0, 500)).trajectory);
}

// Points of statements are in the frame of the first log's map: in that of a
// log that is kept apart other walls lie there.
TEST_F(SeveralLogsTest, StatementsHoldInTheFirstLogsMapAlone) {
  const Log office = Office();
  Log other = Enlarged(Piece(office, 0, 500));
  SeveralLogsOptions options;
  WallStatement statement;
  statement.kind = WallStatement::Kind::kRightAngle;
  statement.first = Eigen::Vector2d(100.0, 100.0);
  statement.second = Eigen::Vector2d(200.0, 100.0);
  statement.place = "walls.txt:1";
  options.solver.known.statements.push_back(statement);
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {Piece(office, 0, 500), std::move(other)}, options);
  ASSERT_EQ(result.maps.size(), 2u);
  using ::testing::Contains;
  using ::testing::HasSubstr;
  EXPECT_THAT(result.maps[0].result.notes,
              Contains(HasSubstr("walls.txt:1: there is no wall")));
  EXPECT_THAT(result.maps[1].result.notes,
              Not(Contains(HasSubstr("walls.txt:1"))));
  EXPECT_THAT(result.maps[1].result.notes,
              Contains(HasSubstr("statements on walls are not used")));
}

// Its corridors agree with the building's, but not the mouth of a wing.
TEST_F(SeveralLogsTest, AMirrorImageIsKeptApart) {
  const Log office = Office();
  Log other = Mirrored(Piece(office, 0, 500));
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {Piece(office, 0, 500), std::move(other)}, {});
  EXPECT_EQ(result.maps.size(), 2u);
  EXPECT_FALSE(result.logs[1].placement.found);
  EXPECT_FALSE(result.logs[1].placement.why_not.empty());
}

// Rooms along both sides of a corridor. Those of one side are the mirror images
// of those of the other, but for some doors, which stand 1.5 m farther on in
// the rooms below.
struct Rows {
  std::vector<double> ends = {0.0, 5.0, 12.0, 18.0, 23.5, 30.0, 36.0};
  std::vector<double> doors = {1.6, 6.9, 14.2, 20.5, 26.3, 33.1};
  // Distance from the corridor's middle, and length.
  std::vector<std::pair<double, double>> shelves = {
      {5.5, 1.0}, {5.4, 1.2}, {5.3, 1.4}, {5.2, 1.6}, {5.1, 1.8}, {5.0, 2.0}};
  std::set<std::size_t> moved;
};

Log DriveThrough(const std::string& world, std::uint64_t seed) {
  std::istringstream text(world);
  const SimulatorOptions options;
  std::ostringstream log;
  WriteCarmenLog(Simulate(ReadWorld(text, "world"), options, seed),
                 options.laser, {}, log);
  InputStream input("world", log.str());
  return ReadCarmenLog(&input, {});
}

Log Drive(const Rows& rows, std::uint64_t seed) {
  const std::vector<double>& ends = rows.ends;
  std::ostringstream walls;
  const auto wall = [&walls](double x1, double y1, double x2, double y2) {
    walls << "wall " << x1 << ' ' << y1 << ' ' << x2 << ' ' << y2 << " 0.12\n";
  };
  wall(0.0, -6.1, 0.0, 6.1);
  wall(ends.back(), -6.1, ends.back(), 6.1);
  std::ostringstream path;
  path << "path 1 0";
  double from[] = {0.0, 0.0};
  for (std::size_t room = 0; room + 1 < ends.size(); ++room) {
    for (const int row : {0, 1}) {
      const double side = row == 0 ? 1.0 : -1.0;
      const double moved = row == 1 && rows.moved.count(room) > 0 ? 1.5 : 0.0;
      const double door = rows.doors[room] + moved;
      wall(from[row], 1.1 * side, door - 0.45, 1.1 * side);
      from[row] = door + 0.45;
      if (room > 0) wall(ends[room], 1.1 * side, ends[room], 6.1 * side);
      const double shelf = rows.shelves[room].first * side;
      wall(ends[room] + 0.5, shelf,
           ends[room] + 0.5 + rows.shelves[room].second, shelf);
      if (room % 2 != 0) continue;
      // Into the room and back.
      const double middle = 0.5 * (ends[room] + ends[room + 1]);
      const double way[][2] = {
          {door, 0.0}, {door, 2.6}, {middle, 3.6}, {door, 2.6}, {door, 0.0}};
      for (const auto& point : way) {
        path << ' ' << point[0] << ' ' << point[1] * side;
      }
    }
  }
  for (const int row : {0, 1}) {
    const double side = row == 0 ? 1.0 : -1.0;
    wall(from[row], 1.1 * side, ends.back(), 1.1 * side);
    wall(0.0, 6.1 * side, ends.back(), 6.1 * side);
  }
  path << ' ' << ends.back() - 1.0 << " 0\n";
  return DriveThrough(walls.str() + path.str(), seed);
}

// A straight corridor of 40 m, with shut doors in niches to its left and right,
// driven there or back.
Log NichedCorridor(double depth, const std::vector<double>& left,
                   const std::vector<double>& right, bool is_back,
                   std::uint64_t seed) {
  std::ostringstream world;
  const auto wall = [&world](double x1, double y1, double x2, double y2) {
    world << "wall " << x1 << ' ' << y1 << ' ' << x2 << ' ' << y2 << " 0.12\n";
  };
  wall(0.0, -1.0, 0.0, 1.0);
  wall(40.0, -1.0, 40.0, 1.0);
  for (const double side : {1.0, -1.0}) {
    double from = 0.0;
    for (const double door : side > 0.0 ? left : right) {
      const double back = side * (1.0 + depth);
      wall(from, side, door - 0.45, side);
      wall(door - 0.45, side, door - 0.45, back);
      wall(door - 0.45, back, door + 0.45, back);
      wall(door + 0.45, back, door + 0.45, side);
      from = door + 0.45;
    }
    wall(from, side, 40.0, side);
  }
  world << (is_back ? "path 39 0 1 0\n" : "path 1 0 39 0\n");
  return DriveThrough(world.str(), seed);
}

// The doors of the last rooms are those that moved.
Log RowsOfRooms(int moved_doors, std::uint64_t seed) {
  Rows rows;
  for (int i = 0; i < moved_doors; ++i) {
    rows.moved.insert(static_cast<std::size_t>(5 - i));
  }
  return Drive(rows, seed);
}

// What differs is nowhere wider than a door.
TEST_F(SeveralLogsTest, AMirrorImageWithOtherDoorsIsKeptApart) {
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {RowsOfRooms(3, 1), Mirrored(RowsOfRooms(3, 2))}, {});
  EXPECT_EQ(result.maps.size(), 2u);
  EXPECT_THAT(result.logs[1].placement.why_not,
              ::testing::HasSubstr("mirror image"));
}

// The same in two more buildings, of whose doors some are seen in passing only:
// one way fewer of them speak than the other way.
TEST_F(SeveralLogsTest, MirrorImagesOfOtherRowsAreKeptApart) {
  Rows six;
  six.ends = {0.0, 4.53, 9.95, 16.66, 23.69, 30.88, 38.3};
  six.doors = {1.42, 6.04, 11.78, 18.64, 25.12, 32.97};
  six.shelves = {{4.87, 1.95}, {5.24, 1.43}, {5.02, 1.96},
                 {5.15, 1.42}, {5.54, 1.48}, {4.92, 1.14}};
  six.moved = {1, 3, 5};
  Rows eight;
  eight.ends = {0.0, 5.34, 12.18, 16.85, 23.74, 29.0, 35.2};
  eight.doors = {2.19, 6.85, 14.2, 19.21, 25.7, 30.61};
  eight.shelves = {{4.78, 2.4},  {4.9, 2.2},   {5.15, 1.21},
                   {4.99, 1.53}, {5.21, 1.32}, {5.14, 1.77}};
  eight.moved = {0, 1, 3};
  std::uint64_t seed = 6;
  for (const Rows& rows : {six, eight}) {
    SCOPED_TRACE(seed);
    const Log log = Drive(rows, seed);
    EXPECT_EQ(
        SolveSeveralLogs(registry_, {log, Mirrored(Drive(rows, seed + 1))}, {})
            .maps.size(),
        2u);
    EXPECT_EQ(SolveSeveralLogs(registry_, {log, Drive(rows, seed + 1)}, {})
                  .maps.size(),
              1u);
    seed += 2;
  }
}

// A door that is shut and one that is opened beside it may be people's doing
// once, but not twice.
TEST_F(SeveralLogsTest, AMirrorImageWithTwoOtherDoorsIsKeptApart) {
  const Log log = RowsOfRooms(2, 1);
  const SeveralLogsResult mirrored =
      SolveSeveralLogs(registry_, {log, Mirrored(RowsOfRooms(2, 2))}, {});
  EXPECT_EQ(mirrored.maps.size(), 2u);
  EXPECT_THAT(mirrored.logs[1].placement.why_not,
              ::testing::HasSubstr("doors stand elsewhere"));
  EXPECT_TRUE(mirrored.logs[1].placement.doubt.empty());
  EXPECT_EQ(
      SolveSeveralLogs(registry_, {log, RowsOfRooms(2, 2)}, {}).maps.size(),
      1u);
}

// One door elsewhere makes another building where the mirror image is one.
TEST_F(SeveralLogsTest, AMirrorImageWithOneOtherDoorIsKeptApart) {
  const SeveralLogsResult same =
      SolveSeveralLogs(registry_, {RowsOfRooms(1, 1), RowsOfRooms(1, 2)}, {});
  ASSERT_EQ(same.maps.size(), 1u);
  EXPECT_EQ(same.logs[1].placement.walls_through_map, 0);
  EXPECT_EQ(same.logs[1].placement.walls_through_track, 0);
  EXPECT_EQ(same.logs[1].placement.doubt, "");
  const SeveralLogsResult other = SolveSeveralLogs(
      registry_, {RowsOfRooms(1, 1), Mirrored(RowsOfRooms(1, 2))}, {});
  EXPECT_EQ(other.maps.size(), 2u);
  EXPECT_THAT(other.logs[1].placement.why_not,
              ::testing::HasSubstr("elsewhere in the same wall"));
}

// A door that both drives went through or along, which is not where it was.
// Whoever knows that it is the building may say so, and is told of it.
TEST_F(SeveralLogsTest, ADoorThatMovedIsAnotherBuildingUnlessSomebodyKnows) {
  Rows moved;
  moved.moved = {4};
  SeveralLogsOptions options;
  const SeveralLogsResult apart =
      SolveSeveralLogs(registry_, {Drive({}, 1), Drive(moved, 2)}, options);
  EXPECT_EQ(apart.maps.size(), 2u);
  EXPECT_THAT(apart.logs[1].placement.why_not,
              ::testing::HasSubstr("door stands elsewhere"));
  options.starts = {std::nullopt, Pose2::Zero()};
  const SeveralLogsResult known =
      SolveSeveralLogs(registry_, {Drive({}, 1), Drive(moved, 2)}, options);
  ASSERT_EQ(known.maps.size(), 1u);
  EXPECT_THAT(known.logs[1].placement.doubt,
              ::testing::HasSubstr("another building"));
}

// All parts of one corridor may agree with another one, and their ends: that is
// what corridors have. Where it may lie is told, and who knows better is heard.
TEST_F(SeveralLogsTest, CorridorsThatLookAlikeAreKeptApart) {
  const Log one = NichedCorridor(
      0.25, {5.35, 7.01, 9.6, 14.69, 18.05, 20.33, 24.3, 28.96, 33.5, 36.68},
      {4.99, 9.99, 13.84, 17.1, 20.81, 22.44, 24.14, 28.8, 34.73}, false, 3);
  const Log other = NichedCorridor(0.4,
                                   {3.19, 7.5, 10.55, 12.37, 14.59, 18.46,
                                    20.72, 23.44, 28.15, 31.69, 34.64, 38.27},
                                   {4.44, 7.83, 10.18, 12.17, 17.72, 21.51,
                                    23.95, 28.18, 33.36, 34.95, 36.53, 38.69},
                                   true, 2);
  SeveralLogsOptions options;
  const SeveralLogsResult apart =
      SolveSeveralLogs(registry_, {one, other}, options);
  EXPECT_EQ(apart.maps.size(), 2u);
  const TrackPlacement& placement = apart.logs[1].placement;
  EXPECT_FALSE(placement.found);
  ASSERT_TRUE(placement.is_candidate) << placement.why_not;
  ASSERT_TRUE(apart.logs[1].candidate.has_value());
  options.starts = {std::nullopt, apart.logs[1].candidate};
  const SeveralLogsResult known =
      SolveSeveralLogs(registry_, {one, other}, options);
  ASSERT_EQ(known.maps.size(), 1u) << known.logs[1].placement.why_not;
  EXPECT_TRUE(known.logs[1].placement.found);
  EXPECT_FALSE(known.logs[1].placement.doubt.empty());
  EXPECT_FALSE(known.logs[1].candidate.has_value());
}

// An L of two corridors of 23 m, with shut doors in niches; by wall, from the
// left or from below.
Log NichedBend(double depth, const std::vector<std::vector<double>>& niches,
               std::uint64_t seed) {
  std::ostringstream world;
  const auto wall = [&world](const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b) {
    world << "wall " << a.x() << ' ' << a.y() << ' ' << b.x() << ' ' << b.y()
          << " 0.12\n";
  };
  wall({0.0, -1.0}, {0.0, 1.0});
  wall({23.0, 22.0}, {25.0, 22.0});
  const Eigen::Vector2d ends[][2] = {{{0.0, -1.0}, {25.0, -1.0}},
                                     {{0.0, 1.0}, {23.0, 1.0}},
                                     {{23.0, 1.0}, {23.0, 22.0}},
                                     {{25.0, -1.0}, {25.0, 22.0}}};
  const Eigen::Vector2d back[] = {
      {0.0, -depth}, {0.0, depth}, {-depth, 0.0}, {depth, 0.0}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d along = (ends[i][1] - ends[i][0]).normalized();
    Eigen::Vector2d from = ends[i][0];
    for (const double door : niches[i]) {
      Eigen::Vector2d middle = ends[i][0];
      middle[i < 2 ? 0 : 1] = door;
      const Eigen::Vector2d first = middle - 0.45 * along;
      const Eigen::Vector2d last = middle + 0.45 * along;
      wall(from, first);
      wall(first, first + back[i]);
      wall(first + back[i], last + back[i]);
      wall(last + back[i], last);
      from = last;
    }
    wall(from, ends[i][1]);
  }
  world << "path 1 0 24 0 24 21\n";
  return DriveThrough(world.str(), seed);
}

// All parts of two corridors and a corner may agree with others, and so does
// their mirror image: that is said.
TEST_F(SeveralLogsTest, BendsThatLookAlikeAreNotTakenForOneSilently) {
  const Log one = NichedBend(0.25,
                             {{7.13, 10.3, 11.89, 16.47, 18.43, 21.3},
                              {5.73, 7.3, 10.83, 14.18, 17.86, 20.3},
                              {4.03, 6.81, 9.99, 15.7, 17.54},
                              {2.57, 6.64, 9.9, 13.49, 18.38}},
                             204);
  const Log other = NichedBend(0.4,
                               {{3.25, 5.3, 7.16, 12.48, 16.87, 22.69},
                                {2.81, 7.28, 12.27, 17.03, 20.77},
                                {5.76, 10.85, 13.56, 17.43},
                                {6.0, 11.12, 16.81}},
                               206);
  for (const auto& logs : {std::vector<Log>{one, other}, {other, one}}) {
    const SeveralLogsResult result = SolveSeveralLogs(registry_, logs, {});
    const TrackPlacement& placement = result.logs[1].placement;
    EXPECT_THAT(placement.doubt + placement.why_not,
                ::testing::HasSubstr("mirror image fits"));
  }
}

// Rooms along both sides of a corridor that is not its own mirror image, as
// they are on a day.
struct Floor {
  std::vector<double> ends[2] = {{0.0, 5.0, 12.0, 18.0, 23.5, 30.0, 36.0},
                                 {0.0, 7.5, 11.5, 20.5, 27.0, 36.0}};
  std::vector<double> doors[2] = {{1.6, 7.9, 16.2, 19.5, 26.3, 34.5},
                                  {3.1, 9.5, 13.2, 22.5, 29.3}};
  // Rooms whose doors are shut; the robot drives into the second and the fifth
  // above and into the third below.
  std::set<std::size_t> shut[2];
  // Rooms above that have no wall to the one before.
  std::set<std::size_t> missing;
  // Rooms above whose doors are double doors.
  std::set<std::size_t> wide;
  bool is_back = false;
  // The rooms below are those above turned by 180 degrees.
  bool is_turned = false;
  // How far along the corridor the robot drives.
  double until = 36.0;
};

Log DriveAlong(const Floor& floor, std::uint64_t seed) {
  std::ostringstream world;
  const auto wall = [&world](double x1, double y1, double x2, double y2) {
    world << "wall " << x1 << ' ' << y1 << ' ' << x2 << ' ' << y2 << " 0.12\n";
  };
  wall(0.0, -6.1, 0.0, 6.1);
  wall(36.0, -6.1, 36.0, 6.1);
  std::vector<std::pair<double, double>> visits;
  for (const std::size_t row : {0, 1}) {
    const double side = row == 0 ? 1.0 : -1.0;
    double from = 0.0;
    for (std::size_t room = 0; room < floor.doors[row].size(); ++room) {
      const double door = floor.doors[row][room];
      const double begin = floor.ends[row][room];
      const double end = floor.ends[row][room + 1];
      const double half = row == 0 && floor.wide.count(room) > 0 ? 1.1 : 0.45;
      if (floor.shut[row].count(room) == 0) {
        wall(from, 1.1 * side, door - half, 1.1 * side);
        from = door + half;
      }
      if (room > 0 && (row == 1 || floor.missing.count(room) == 0)) {
        wall(begin, 1.1 * side, begin, 6.1 * side);
      }
      // A desk and a shelf.
      const bool is_mirrored = floor.is_turned && row == 1;
      wall(is_mirrored ? end - 0.7 : begin + 0.7, 5.2 * side,
           0.5 * (begin + end), 5.2 * side);
      const double shelf = is_mirrored ? begin + 0.4 : end - 0.4;
      wall(shelf, 3.5 * side, shelf, 5.0 * side);
      if (door < floor.until &&
          (row == 0 || floor.is_turned ? room == 1 || room == 4 : room == 2)) {
        visits.emplace_back(door, side);
      }
    }
    wall(from, 1.1 * side, 36.0, 1.1 * side);
    wall(0.0, 6.1 * side, 36.0, 6.1 * side);
  }
  std::vector<std::pair<double, double>> way = {{1.0, 0.0}};
  std::sort(visits.begin(), visits.end());
  for (const auto& [x, side] : visits) {
    for (const double y : {0.0, 2.6, 3.6, 2.6, 0.0}) {
      way.emplace_back(x, y * side);
    }
  }
  way.emplace_back(floor.until - 1.0, 0.0);
  if (floor.is_back) std::reverse(way.begin(), way.end());
  world << "path";
  for (const auto& [x, y] : way) world << ' ' << x << ' ' << y;
  world << "\n";
  return DriveThrough(world.str(), seed);
}

// So many doors that were opened or shut meanwhile would be another building's
// if fewer parts agreed.
TEST_F(SeveralLogsTest, DoorsOpenedAndShutMakeNoOtherBuilding) {
  Floor monday;
  monday.shut[0] = {0, 3};
  monday.shut[1] = {0, 3};
  Floor tuesday;
  tuesday.shut[0] = {2, 5};
  tuesday.shut[1] = {1, 4};
  tuesday.is_back = true;
  const Log one = DriveAlong(monday, 1);
  const Log other = DriveAlong(tuesday, 2);
  for (const bool is_turned : {false, true}) {
    SCOPED_TRACE(is_turned);
    const SeveralLogsResult result =
        is_turned ? SolveSeveralLogs(registry_, {other, one}, {})
                  : SolveSeveralLogs(registry_, {one, other}, {});
    const TrackPlacement& placement = result.logs[1].placement;
    ASSERT_EQ(result.maps.size(), 1u) << placement.why_not;
    EXPECT_GE(placement.walls_through_map + placement.walls_through_track, 5);
    EXPECT_FALSE(placement.doubt.empty());
    // Odometry begins where the way does.
    const Pose2 first = result.maps[0].result.trajectory[result.logs[1].begin];
    EXPECT_LT(std::hypot(first[0] - (is_turned ? 1.0 : 35.0), first[1]), 0.3);
  }
}

// So much wall that is there on one day alone is another building's, unless so
// many parts agree that it is a double door.
TEST_F(SeveralLogsTest, ADoubleDoorThatWasShutMakesNoOtherBuilding) {
  Floor monday;
  monday.wide = {3};
  Floor tuesday = monday;
  tuesday.shut[0] = {3};
  tuesday.is_back = true;
  const Log one = DriveAlong(monday, 1);
  const Log other = DriveAlong(tuesday, 2);
  SeveralLogsOptions options;
  const SeveralLogsResult apart =
      SolveSeveralLogs(registry_, {one, other}, options);
  EXPECT_EQ(apart.maps.size(), 2u);
  EXPECT_THAT(apart.logs[1].placement.why_not,
              ::testing::HasSubstr("m of wall where the other has none"));
  options.placement.min_sure_agreeing = apart.logs[1].placement.agreeing;
  const SeveralLogsResult sure =
      SolveSeveralLogs(registry_, {one, other}, options);
  ASSERT_EQ(sure.maps.size(), 1u) << sure.logs[1].placement.why_not;
  EXPECT_GT(sure.logs[1].placement.contradicting_length,
            options.placement.max_contradicting_stretch);
  EXPECT_FALSE(sure.logs[1].placement.doubt.empty());
}

// A wall that was taken down makes another building of it, unless somebody says
// that it is this one; the run says how.
TEST_F(SeveralLogsTest, AWallThatWasTakenDownNeedsAStart) {
  Floor tuesday;
  tuesday.missing = {1, 4};
  tuesday.is_back = true;
  const std::vector<Log> logs = {DriveAlong({}, 1), DriveAlong(tuesday, 2)};
  SeveralLogsOptions options;
  const SeveralLogsResult apart = SolveSeveralLogs(registry_, logs, options);
  EXPECT_EQ(apart.maps.size(), 2u);
  EXPECT_THAT(apart.logs[1].placement.why_not,
              ::testing::HasSubstr("m of wall where the other has none"));
  ASSERT_TRUE(apart.logs[1].candidate.has_value());
  // Odometry begins where the way does.
  EXPECT_LT((*apart.logs[1].candidate - Pose2(35.0, 0.0, 0.0)).head<2>().norm(),
            0.3);
  options.starts = {std::nullopt, apart.logs[1].candidate};
  const SeveralLogsResult known = SolveSeveralLogs(registry_, logs, options);
  ASSERT_EQ(known.maps.size(), 1u) << known.logs[1].placement.why_not;
  EXPECT_THAT(known.logs[1].placement.doubt,
              ::testing::HasSubstr("another building"));
  EXPECT_FALSE(known.logs[1].candidate.has_value());
}

// A building that looks the same from its other end: a log of one half may be
// of either, and which one comes first does not tell.
TEST_F(SeveralLogsTest, AHalfThatFitsAtBothEndsIsKeptApart) {
  Floor whole;
  whole.is_turned = true;
  whole.ends[1].clear();
  whole.doors[1].clear();
  for (std::size_t i = whole.ends[0].size(); i-- > 0;) {
    whole.ends[1].push_back(36.0 - whole.ends[0][i]);
  }
  for (std::size_t i = whole.doors[0].size(); i-- > 0;) {
    whole.doors[1].push_back(36.0 - whole.doors[0][i]);
  }
  Floor half = whole;
  half.until = 17.0;
  const Log one = DriveAlong(whole, 1);
  const Log other = DriveAlong(half, 2);
  for (const auto& logs : {std::vector<Log>{one, other}, {other, one}}) {
    const SeveralLogsResult result = SolveSeveralLogs(registry_, logs, {});
    EXPECT_EQ(result.maps.size(), 2u);
    EXPECT_TRUE(result.logs[1].candidate.has_value());
    EXPECT_TRUE(result.logs[1].placement.has_twin);
    EXPECT_THAT(result.logs[1].placement.why_not,
                ::testing::HasSubstr("place"));
  }
}

// The same corridor and doors, but walls between other rooms.
TEST_F(SeveralLogsTest, AnotherFloorIsKeptApart) {
  Floor upstairs;
  upstairs.ends[0] = {0.0, 4.0, 10.0, 17.5, 25.0, 32.5, 36.0};
  upstairs.ends[1] = {0.0, 5.0, 12.0, 17.0, 24.0, 36.0};
  upstairs.is_back = true;
  const Log one = DriveAlong({}, 1);
  const Log other = DriveAlong(upstairs, 2);
  EXPECT_EQ(SolveSeveralLogs(registry_, {one, other}, {}).maps.size(), 2u);
  EXPECT_EQ(SolveSeveralLogs(registry_, {other, one}, {}).maps.size(), 2u);
}

// What was seen far off makes the building large, but no place in it harder to
// find: a search of all of it would be given up.
TEST_F(SeveralLogsTest, ATrackIsFoundInALargeBuilding) {
  const Log office = Office();
  const std::size_t half = office.scans.size() / 2;
  const SeveralLogsOptions options;
  const auto views = [&](std::size_t begin, std::size_t end) {
    std::vector<int> keys;
    std::vector<Pose2> poses;
    for (std::size_t i = begin; i < end; i += 3) {
      keys.push_back(static_cast<int>(i));
      poses.push_back(TruthOf(office.scans[i]));
    }
    return MakeKeyViews(office.scans, keys, poses,
                        options.solver.odometry.points);
  };
  std::vector<KeyView> map = views(0, half);
  const std::vector<KeyView> track = views(half, office.scans.size());
  for (const bool is_large : {false, true}) {
    if (is_large) {
      KeyView far = map.front();
      far.pose.head<2>() += Eigen::Vector2d(600.0, 500.0);
      map.push_back(far);
    }
    const TrackPlacement placement =
        PlaceTrack(map, track, std::nullopt, options.placement);
    ASSERT_TRUE(placement.found) << placement.why_not;
    EXPECT_LT(placement.pose.norm(), 0.1);
  }
}

TEST_F(SeveralLogsTest, AWrongStartKeepsALogApart) {
  const Log office = Office();
  SeveralLogsOptions options;
  const Log first = Piece(office, 0, 500);
  const Log second = Piece(office, 200, 500);
  const auto solve = [&](const std::optional<Pose2>& start) {
    options.starts = {std::nullopt, start};
    return SolveSeveralLogs(registry_, {first, second}, options);
  };
  const Pose2 truth =
      Between(TruthOf(first.scans.front()), TruthOf(second.scans.front()));
  EXPECT_EQ(solve(Compose(truth, Pose2(0.5, -0.5, 0.2))).maps.size(), 1u);
  EXPECT_EQ(solve(Compose(truth, Pose2(20.0, 5.0, 3.0))).maps.size(), 2u);
}

// A corridor that agrees with the first log's is told as its candidate, though
// another map was compared with it later, and as closely.
TEST_F(SeveralLogsTest, ACandidateStaysOneWhenOtherMapsAreAsked) {
  const std::vector<double> left = {5.35,  7.01, 9.6,   14.69, 18.05,
                                    20.33, 24.3, 28.96, 33.5,  36.68};
  const std::vector<double> right = {4.99,  9.99,  13.84, 17.1, 20.81,
                                     22.44, 24.14, 28.8,  34.73};
  const SeveralLogsResult result =
      SolveSeveralLogs(registry_,
                       {NichedCorridor(0.25, left, right, false, 3),
                        NichedCorridor(0.25, left, right, true, 4),
                        NichedCorridor(0.25, left, right, false, 5)},
                       {});
  ASSERT_EQ(result.maps.size(), 3u);
  EXPECT_TRUE(result.logs[1].candidate.has_value());
  EXPECT_TRUE(result.logs[2].candidate.has_value());
}

// Of a log by itself, as map.json keeps it.
KeyScanArchive Archived(const Registry& registry, const Log& log) {
  LogSolver solver(registry, {});
  const LogSolverResult result = solver.Run(log);
  std::string text = "{";
  AppendKeyScans(MakeKeyScanArchive(log.scans, result.refined, result.records,
                                    result.trajectory),
                 &text);
  return ReadKeyScans(text + "}", "map.json");
}

// The second half of the drive is found in the map of the first.
TEST_F(SeveralLogsTest, ALogIsFoundInAnEarlierMap) {
  const Log office = Office();
  const std::size_t n = office.scans.size();
  const KeyScanArchive earlier = Archived(registry_, Piece(office, 0, n / 2));
  LogSolver alone(registry_, {});
  const LogSolverResult whole = alone.Run(office);
  SeveralLogsOptions options;
  options.earlier = &earlier;
  options.localize_only = true;
  const SeveralLogsResult result =
      SolveSeveralLogs(registry_, {Piece(office, n / 2, n)}, options);
  EXPECT_FALSE(result.is_elsewhere);
  ASSERT_EQ(result.maps.size(), 1u);
  const MapOfLogs& map = result.maps.front();
  EXPECT_EQ(map.solver, nullptr);
  ASSERT_EQ(result.logs[0].begin, earlier.scans.size());
  ASSERT_EQ(result.logs[0].end, map.result.trajectory.size());
  ASSERT_EQ(result.logs[0].end - result.logs[0].begin, n - n / 2);
  // The map stays as it was.
  for (std::size_t k = 0; k < earlier.trajectory.size(); ++k) {
    EXPECT_LT((map.result.trajectory[k] - earlier.trajectory[k]).norm(), 1e-9);
  }
  double sum = 0.0;
  for (std::size_t i = n / 2; i < n; ++i) {
    const Pose2& found =
        map.result.trajectory[result.logs[0].begin + i - n / 2];
    const Pose2 error = Between(whole.trajectory[i], found);
    EXPECT_LT(error.head<2>().norm(), 0.1);
    EXPECT_LT(std::abs(error[2]), DegToRad(0.5));
    sum += error.head<2>().norm();
  }
  EXPECT_LT(sum / static_cast<double>(n - n / 2), 0.03);
}

TEST_F(SeveralLogsTest, ALogContinuesAnEarlierMap) {
  const Log office = Office();
  const std::size_t n = office.scans.size();
  const KeyScanArchive earlier = Archived(registry_, Piece(office, 0, n / 2));
  SeveralLogsOptions options;
  options.earlier = &earlier;
  const SeveralLogsResult result =
      SolveSeveralLogs(registry_, {Piece(office, n / 2, n)}, options);
  ASSERT_EQ(result.maps.size(), 1u);
  const MapOfLogs& map = result.maps.front();
  ASSERT_EQ(map.scans.size(), earlier.scans.size() + n - n / 2);
  ASSERT_EQ(map.result.trajectory.size(), map.scans.size());
  EXPECT_EQ(map.scans[result.logs[0].begin].timestamp,
            office.scans[n / 2].timestamp);
  EXPECT_LT(LargestError(map), 0.25);
  EXPECT_GT(LengthOfWalls(map.solver->graph()), 100.0);
  // In the frame of the earlier map.
  EXPECT_LT((map.result.trajectory[0] - earlier.trajectory[0]).norm(), 1e-9);
}

TEST_F(SeveralLogsTest, AnotherBuildingIsNotPutIntoAnEarlierMap) {
  const Log office = Office();
  const KeyScanArchive earlier = Archived(registry_, Piece(office, 0, 500));
  SeveralLogsOptions options;
  options.earlier = &earlier;
  for (const bool localize_only : {false, true}) {
    options.localize_only = localize_only;
    // One that would fit does not help.
    const SeveralLogsResult result = SolveSeveralLogs(
        registry_, {Piece(office, 100, 400), Enlarged(Piece(office, 0, 300))},
        options);
    EXPECT_TRUE(result.is_elsewhere);
    EXPECT_TRUE(result.maps.empty());
    EXPECT_TRUE(result.logs[0].placement.found);
    EXPECT_FALSE(result.logs[1].placement.found);
    EXPECT_FALSE(result.logs[1].placement.why_not.empty());
  }
  options.earlier = nullptr;
  EXPECT_THROW(SolveSeveralLogs(registry_, {Piece(office, 0, 50)}, options),
               Error);
}

// Ranges as those of a laser with 4 cm of noise.
Log Noisy(Log log) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0.0f, 0.04f);
  for (Scan& scan : log.scans) {
    for (float& range : scan.ranges) {
      if (range > 0.0f) range = std::max(0.05f, range + noise(random));
    }
  }
  return log;
}

TEST_F(SeveralLogsTest, NoisyLogsAreAllowedForTogether) {
  const Log noisy = Noisy(Office());
  const std::size_t n = noisy.scans.size();
  LogSolver alone(registry_, {});
  const LogSolverResult whole = alone.Run(noisy);
  ASSERT_GT(whole.noise_scale, 2.0);
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {Piece(noisy, 0, n / 2), Piece(noisy, n / 2, n)}, {});
  ASSERT_EQ(result.maps.size(), 1u);
  const MapOfLogs& map = result.maps.front();
  EXPECT_NEAR(map.result.noise_scale, whole.noise_scale,
              0.2 * whole.noise_scale);
  EXPECT_LT(LargestError(map),
            1.2 * LargestError(noisy.scans, whole.trajectory) + 0.05);
  // What is not allowed for draws walls twice.
  const double length = LengthOfWalls(alone.graph());
  EXPECT_NEAR(LengthOfWalls(map.solver->graph()), length, 0.07 * length);
}

// The archive does not say how noisy its scans are: they show it.
TEST_F(SeveralLogsTest, ANoisyLogIsFoundInANoisyMap) {
  const Log noisy = Noisy(Office());
  const std::size_t n = noisy.scans.size();
  const KeyScanArchive earlier = Archived(registry_, Piece(noisy, 0, n / 2));
  SeveralLogsOptions options;
  options.earlier = &earlier;
  options.localize_only = true;
  const SeveralLogsResult result =
      SolveSeveralLogs(registry_, {Piece(noisy, n / 2, n)}, options);
  ASSERT_FALSE(result.is_elsewhere) << result.logs[0].placement.why_not;
  const MapOfLogs& map = result.maps.front();
  EXPECT_GT(map.result.noise_scale, 2.0);
  // In the frame of the map as a whole: its first pose is one noisy scan's.
  std::vector<Pose2> in_map, in_truth;
  for (std::size_t i = 0; i < n / 2; ++i) {
    in_map.push_back(map.result.trajectory[i]);
    in_truth.push_back(TruthOf(map.scans[i]));
  }
  const Pose2 frame = FitRigidTransform(in_map, in_truth);
  double sum = 0.0;
  for (std::size_t i = n / 2; i < n; ++i) {
    const Pose2 found =
        Compose(frame, map.result.trajectory[result.logs[0].begin + i - n / 2]);
    const double error = (found - TruthOf(noisy.scans[i])).head<2>().norm();
    EXPECT_LT(error, 0.25);
    sum += error;
  }
  EXPECT_LT(sum / static_cast<double>(n - n / 2), 0.06);
}

TEST_F(SeveralLogsTest, AnInterruptLeavesNoHalfMap) {
  const Log office = Office();
  SeveralLogsControl control;
  int questions = 0;
  control.run.stop = [&] { return ++questions > 150; };
  const SeveralLogsResult result = SolveSeveralLogs(
      registry_, {Piece(office, 0, 100), Piece(office, 100, 200)}, {}, control);
  EXPECT_TRUE(result.interrupted);
  EXPECT_TRUE(result.maps.empty());
}

TEST_F(SeveralLogsTest, RefusesWhatHasNoSecondMap) {
  const Log piece = Piece(Office(), 0, 50);
  SeveralLogsOptions options;
  EXPECT_THROW(SolveSeveralLogs(registry_, {}, options), Error);
  EXPECT_THROW(SolveSeveralLogs(registry_, {piece, Log()}, options), Error);
  options.solver.refine = Refinement::kMap;
  EXPECT_THROW(SolveSeveralLogs(registry_, {piece, piece}, options), Error);
  options.solver.refine = Refinement::kFull;
  options.solver.features = RawFeatures::kPoints;
  EXPECT_THROW(SolveSeveralLogs(registry_, {piece, piece}, options), Error);
}

}  // namespace
}  // namespace plumbline
