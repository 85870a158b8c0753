#include <gtest/gtest.h>
#include <plumbline/core/parallel_for.h>
#include <plumbline/factors/angle.h>
#include <plumbline/frontend/peak_search.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

namespace plumbline {
namespace {

TEST(ScoreLevelsTest, EachLevelHasTheBestOfTwiceAsManyCellsEachWay) {
  // One row of scores with the pad before it, and rows of the pad above.
  const int columns = kPeakPad + 8;
  const int rows = kPeakPad + 1;
  std::vector<std::int16_t> scores(columns * rows, 0);
  scores[kPeakPad * columns + kPeakPad + 2] = 90;
  scores[kPeakPad * columns + kPeakPad + 5] = 40;
  scores[kPeakPad * columns + kPeakPad + 7] = -128;
  const auto levels = ScoreLevels(scores, columns, rows);
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0], scores);
  const auto at = [&](int level, int x, int y) {
    return levels[level][(kPeakPad + y) * columns + kPeakPad + x];
  };
  EXPECT_EQ(at(1, 1, 0), 90);
  EXPECT_EQ(at(1, 2, 0), 90);
  EXPECT_EQ(at(1, 3, 0), 0);
  EXPECT_EQ(at(1, 4, -1), 40);
  EXPECT_EQ(at(2, 3, 0), 40);
  EXPECT_EQ(at(2, 0, -3), 90);
  // Beyond the grid nothing is known, which is better than seen through.
  EXPECT_EQ(at(1, 7, 0), 0);
}

// A corner of walls at x = 30 and y = 20 cells, and the same corner once more
// 25 cells further up.
class FindPeaksTest : public ::testing::Test {
 protected:
  FindPeaksTest() {
    std::vector<std::int16_t> scores(kColumns * kRows, 0);
    for (int i = 0; i < 12; ++i) {
      for (const int y : {20, 45}) {
        At(30, y + i, &scores) = 255;
        At(30 - i, y, &scores) = 255;
      }
    }
    // The second one is not quite as good.
    At(30, 50, &scores) = 0;
    levels_ = ScoreLevels(scores, kColumns, kRows);
    for (int i = 0; i < 12; ++i) {
      points_.emplace_back(1.05, -0.95 + 0.1 * i);
      points_.emplace_back(1.05 - 0.1 * i, -0.95);
    }
    Viewpoint viewpoint;
    viewpoint.position = {2.0, 3.0};
    viewpoints_ = {viewpoint};
  }

  static std::int16_t& At(int x, int y, std::vector<std::int16_t>* scores) {
    return (*scores)[(y + kPeakPad) * kColumns + x + kPeakPad];
  }

  std::vector<ScoredPose> Find(const PeakOptions& options,
                               const std::function<bool()>& stop = nullptr) {
    const PeakGrid grid{levels_, kColumns, kRows, {0.0, 0.0}, 0.1, viewpoints_};
    return FindPeaks(grid, points_, Pose2(2.3, 3.4, 0.0), 3.0, DegToRad(20.0),
                     options, stop);
  }

  static constexpr int kColumns = 70 + kPeakPad;
  static constexpr int kRows = 80 + kPeakPad;
  std::vector<std::vector<std::int16_t>> levels_;
  std::vector<Eigen::Vector2d> points_;
  std::vector<Viewpoint> viewpoints_;
};

TEST_F(FindPeaksTest, BestFirst) {
  const std::vector<ScoredPose> peaks = Find({0.5, 0.8, 4, 10.0});
  ASSERT_GE(peaks.size(), 2u);
  EXPECT_DOUBLE_EQ(peaks[0].score, 1.0);
  EXPECT_NEAR(peaks[0].pose[0], 2.0, 0.051);
  EXPECT_NEAR(peaks[0].pose[1], 3.0, 0.051);
  EXPECT_NEAR(peaks[0].pose[2], 0.0, DegToRad(1.0));
  EXPECT_NEAR(peaks[1].pose[0], 2.0, 0.051);
  EXPECT_NEAR(peaks[1].pose[1], 5.5, 0.051);
  EXPECT_LT(peaks[1].score, 1.0);
}

TEST_F(FindPeaksTest, LimitsOfPeaks) {
  EXPECT_EQ(Find({0.5, 0.8, 1, 10.0}).size(), 1u);
  // Only the best one is as good as the best one.
  EXPECT_EQ(Find({0.5, 1.0, 4, 10.0}).size(), 1u);
  EXPECT_TRUE(Find({1.1, 0.8, 4, 10.0}).empty());
  // The second one is 2.5 m from where anything was seen.
  EXPECT_EQ(Find({0.5, 0.8, 4, 1.0}).size(), 1u);
  EXPECT_TRUE(Find({0.5, 0.8, 4, 10.0}, [] { return true; }).empty());
}

TEST_F(FindPeaksTest, NodesAreLimited) {
  PeakOptions options{0.5, 0.8, 4, 10.0};
  std::int64_t enough = 1000000;
  options.nodes = &enough;
  const std::vector<ScoredPose> peaks = Find(options);
  ASSERT_GE(peaks.size(), 2u);
  const std::int64_t used = 1000000 - enough;
  EXPECT_GT(used, 0);
  std::int64_t none = 0;
  options.nodes = &none;
  EXPECT_TRUE(Find(options).empty());
  EXPECT_EQ(none, 0);
  std::int64_t just = used;
  options.nodes = &just;
  EXPECT_EQ(Find(options).size(), peaks.size());
}

// Pieces of wall and some points on a grid; the window reaches beyond it.
struct ScatteredWorld {
  static constexpr int kColumns = 150 + kPeakPad;
  static constexpr int kRows = 131 + kPeakPad;
  static constexpr double kResolution = 0.1;

  explicit ScatteredWorld(unsigned seed) {
    std::mt19937 random(seed);
    const auto draw = [&](int below) {
      return static_cast<int>(random() % static_cast<unsigned>(below));
    };
    std::vector<std::int16_t> scores(kColumns * kRows, 0);
    for (int piece = 0; piece < 60; ++piece) {
      int x = kPeakPad + draw(kColumns - kPeakPad);
      int y = kPeakPad + draw(kRows - kPeakPad);
      const bool is_level = draw(2) == 0;
      for (int i = 0; i < 15 && x < kColumns && y < kRows; ++i) {
        scores[y * kColumns + x] = static_cast<std::int16_t>(55 + draw(201));
        ++(is_level ? x : y);
      }
    }
    levels = ScoreLevels(scores, kColumns, kRows);
    for (int i = 0; i < 60; ++i) {
      points.emplace_back(0.1 * draw(60) - 3.0, 0.1 * draw(60) - 3.0);
    }
    Viewpoint viewpoint;
    viewpoint.position = {7.0, 6.0};
    viewpoints = {viewpoint};
  }

  PeakGrid Grid() const {
    return {levels, kColumns, kRows, {0.0, 0.0}, kResolution, viewpoints};
  }

  // The score of the points moved by so many cells, of all that it can be.
  double ScoreAt(const Pose2& center, int dx, int dy) const {
    double sum = 0.0;
    for (const Eigen::Vector2d& point : points) {
      const auto cell = [](double at) {
        return static_cast<int>(std::floor(at / kResolution));
      };
      const int x = cell(center[0] + point.x()) + dx + kPeakPad;
      const int y = cell(center[1] + point.y()) + dy + kPeakPad;
      if (x < 0 || y < 0 || x >= kColumns || y >= kRows) continue;
      sum += levels[0][static_cast<std::size_t>(y) * kColumns + x];
    }
    return sum / (255.0 * static_cast<double>(points.size()));
  }

  std::vector<std::vector<std::int16_t>> levels;
  std::vector<Eigen::Vector2d> points;
  std::vector<Viewpoint> viewpoints;
};

TEST(FindPeaksInWideWindowTest, TheBestOfAllPoses) {
  const Pose2 center(6.03, 5.52, 0.0);
  const double window = 11.0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const ScatteredWorld world(seed);
    double best = 0.0;
    for (int dy = -110; dy <= 110; ++dy) {
      for (int dx = -110; dx <= 110; ++dx) {
        best = std::max(best, world.ScoreAt(center, dx, dy));
      }
    }
    // Whatever is known before of how good a peak has to be.
    for (const double least : {0.0, 0.5 * best, 0.999 * best}) {
      const std::vector<ScoredPose> peaks =
          FindPeaks(world.Grid(), world.points, center, window, 0.0,
                    {least, 0.6, 3, 100.0}, nullptr);
      ASSERT_FALSE(peaks.empty()) << seed;
      EXPECT_NEAR(peaks[0].score, best, 1e-12) << seed;
      const auto moved = [&](int axis) {
        return static_cast<int>(
            std::lround((peaks[0].pose[axis] - center[axis]) / 0.1));
      };
      EXPECT_NEAR(world.ScoreAt(center, moved(0), moved(1)), best, 1e-12);
    }
    EXPECT_TRUE(FindPeaks(world.Grid(), world.points, center, window, 0.0,
                          {1.001 * best, 0.6, 3, 100.0}, nullptr)
                    .empty());
  }
}

// A pose at which a few single cells are met is good, none beside it.
TEST(FindPeaksInWideWindowTest, ASinglePoseAnywhere) {
  constexpr int kSide = 120 + kPeakPad;
  const std::vector<Eigen::Vector2i> marks = {{2, 3},   {31, 8},  {57, 26},
                                              {14, 49}, {69, 61}, {44, 77}};
  std::vector<std::int16_t> scores(kSide * kSide, 0);
  std::vector<Eigen::Vector2d> points;
  for (const Eigen::Vector2i& mark : marks) {
    scores[(mark.y() + kPeakPad) * kSide + mark.x() + kPeakPad] = 255;
    points.push_back(0.1 * (mark.cast<double>().array() + 0.5).matrix());
  }
  const auto levels = ScoreLevels(scores, kSide, kSide);
  const std::vector<Viewpoint> viewpoints(1);
  const PeakGrid grid{levels, kSide, kSide, {0.0, 0.0}, 0.1, viewpoints};
  for (int dx = -21; dx <= 21; dx += 3) {
    for (int dy = -21; dy <= 21; dy += 2) {
      const std::vector<ScoredPose> peaks =
          FindPeaks(grid, points, Pose2(0.1 * dx, 0.1 * dy, 0.0), 2.4, 0.0,
                    {0.9, 0.9, 3, 100.0}, nullptr);
      ASSERT_EQ(peaks.size(), 1u) << dx << ' ' << dy;
      EXPECT_NEAR(peaks[0].pose.head<2>().norm(), 0.0, 1e-9);
    }
  }
}

TEST(FindPeaksInWideWindowTest, TheSameOnSeveralThreads) {
  const ScatteredWorld world(7);
  const auto find = [&](int num_threads) {
    const ThreadsScope scope(num_threads);
    return FindPeaks(world.Grid(), world.points, Pose2(6.0, 5.5, 0.3), 11.0,
                     DegToRad(180.0), {0.1, 0.5, 20, 100.0}, nullptr);
  };
  const std::vector<ScoredPose> alone = find(1);
  EXPECT_GT(alone.size(), 3u);
  for (const int num_threads : {2, 5}) {
    const std::vector<ScoredPose> together = find(num_threads);
    ASSERT_EQ(together.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i) {
      EXPECT_EQ(together[i].score, alone[i].score);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(together[i].pose[axis], alone[i].pose[axis]);
      }
    }
  }
}

TEST_F(FindPeaksTest, ClearestScoreIsThatOfSomePose) {
  const PeakGrid grid{levels_, kColumns, kRows, {0.0, 0.0}, 0.1, viewpoints_};
  const auto clearest = [&](const Pose2& center, double reach,
                            const std::function<bool()>& stop = nullptr) {
    return ClearestScore(grid, points_, center, 3.0, DegToRad(20.0), reach,
                         stop);
  };
  const double score = clearest(Pose2(2.3, 3.4, 0.0), 10.0);
  EXPECT_LE(score, 1.0);
  EXPECT_GT(score, 0.9);
  EXPECT_EQ(clearest(Pose2(200.0, 3.4, 0.0), 10.0), 0.0);
  EXPECT_EQ(clearest(Pose2(2.3, 3.4, 0.0), 10.0, [] { return true; }), 0.0);
}

}  // namespace
}  // namespace plumbline
