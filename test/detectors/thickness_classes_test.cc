#include <gtest/gtest.h>
#include <plumbline/detectors/thickness_classes.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

namespace plumbline {
namespace {

class ThicknessDraws {
 public:
  explicit ThicknessDraws(std::uint64_t seed) : engine_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) /
                     9007199254740992.0;
  }
  double Normal() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += Uniform(0.0, 1.0);
    return sum;
  }
  // Walls of one thickness, each measured with an error of its own.
  void Add(int count, double thickness, double stddev,
           std::vector<ThicknessSample>* samples) {
    for (int i = 0; i < count; ++i) {
      const double sigma = Uniform(0.004, 0.012);
      samples->push_back(
          {thickness + stddev * Normal() + sigma * Normal(), sigma * sigma});
    }
  }
  // Walls that have nothing in common.
  void AddEven(int count, std::vector<ThicknessSample>* samples) {
    for (int i = 0; i < count; ++i) {
      samples->push_back({Uniform(0.04, 0.6), 1e-4});
    }
  }

 private:
  std::mt19937_64 engine_;
};

TEST(ThicknessClassesTest, OneThickness) {
  std::vector<ThicknessSample> samples;
  for (const double error : {-0.004, -0.002, 0.0, 0.001, 0.002, 0.003}) {
    samples.push_back({0.15 + error, 1e-6});
  }
  const std::vector<ThicknessClass> found =
      FindThicknessClasses(samples, {}, {});
  ASSERT_EQ(found.size(), 1u);
  // The mean, and what the errors scatter beyond their own variance: their mean
  // square is 34 / 6 mm^2.
  EXPECT_NEAR(found[0].thickness, 0.15, 1e-6);
  EXPECT_NEAR(found[0].stddev, 0.00216, 2e-5);
}

TEST(ThicknessClassesTest, EverySampleCountsByItsOwnVariance) {
  // One that is known to 1 mm outweighs four that are known to 10 mm.
  std::vector<ThicknessSample> samples = {{0.20, 1e-6}};
  for (int i = 0; i < 5; ++i) samples.push_back({0.21, 1e-4});
  const std::vector<ThicknessClass> found =
      FindThicknessClasses(samples, {}, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT(found[0].thickness, 0.204);
}

TEST(ThicknessClassesTest, FewWallsAreNoEvidence) {
  std::vector<ThicknessSample> samples = {
      {0.15, 1e-6}, {0.151, 1e-6}, {0.149, 1e-6}};
  EXPECT_TRUE(FindThicknessClasses(samples, {}, {}).empty());
  EXPECT_TRUE(FindThicknessClasses({}, {}, {}).empty());
}

TEST(ThicknessClassesTest, SeveralClassesAmongOthers) {
  int found_all = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    ThicknessDraws draws(seed);
    std::vector<ThicknessSample> samples;
    draws.Add(15, 0.10, 0.003, &samples);
    draws.Add(12, 0.16, 0.003, &samples);
    draws.Add(10, 0.30, 0.003, &samples);
    draws.AddEven(8, &samples);
    const std::vector<ThicknessClass> found =
        FindThicknessClasses(samples, {}, {});
    if (found.size() != 3) continue;
    EXPECT_NEAR(found[0].thickness, 0.10, 0.008) << seed;
    EXPECT_NEAR(found[1].thickness, 0.16, 0.008) << seed;
    EXPECT_NEAR(found[2].thickness, 0.30, 0.008) << seed;
    ++found_all;
  }
  EXPECT_GE(found_all, 45);
}

TEST(ThicknessClassesTest, EvenThicknessesMakeNone) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    ThicknessDraws draws(seed);
    std::vector<ThicknessSample> samples;
    draws.AddEven(6 + static_cast<int>(seed % 40), &samples);
    found += static_cast<int>(FindThicknessClasses(samples, {}, {}).size());
  }
  // 0.03 expected of each; measured: none.
  EXPECT_LE(found, 6);
}

TEST(ThicknessClassesTest, KnownOnesAreNotFoundAgain) {
  ThicknessDraws draws(3);
  std::vector<ThicknessSample> samples;
  draws.Add(12, 0.10, 0.002, &samples);
  draws.Add(12, 0.25, 0.002, &samples);
  const std::vector<ThicknessClass> found =
      FindThicknessClasses(samples, {{0.10, 0.01}}, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].thickness, 0.25, 0.006);
}

TEST(ThicknessClassesTest, TheOrderOfSamplesDoesNotMatter) {
  ThicknessDraws draws(4);
  std::vector<ThicknessSample> samples;
  draws.Add(10, 0.12, 0.002, &samples);
  draws.Add(10, 0.30, 0.002, &samples);
  draws.AddEven(5, &samples);
  const std::vector<ThicknessClass> found =
      FindThicknessClasses(samples, {}, {});
  std::reverse(samples.begin(), samples.end());
  const std::vector<ThicknessClass> again =
      FindThicknessClasses(samples, {}, {});
  ASSERT_EQ(found.size(), 2u);
  ASSERT_EQ(again.size(), 2u);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].thickness, again[i].thickness);
    EXPECT_EQ(found[i].stddev, again[i].stddev);
  }
}

}  // namespace
}  // namespace plumbline
