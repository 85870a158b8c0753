#include <gtest/gtest.h>
#include <plumbline/factors/chi_square.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace plumbline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void ExpectRelative(double actual, double expected, double tolerance) {
  EXPECT_NEAR(actual, expected, tolerance * std::abs(expected));
}

struct GammaCase {
  double a, x, p, q;
};

// To 20 digits by arbitrary precision arithmetic.
const GammaCase kGammaCases[] = {
    {0.5, 0.1, 0.34527915398142297956, 0.65472084601857702044},
    {0.5, 3.0, 0.98569412156457036047, 0.014305878435429639526},
    {2.5, 2.0, 0.45058404864721976739, 0.54941595135278023261},
    {2.5, 0.001, 9.5085345986079498136e-9, 0.99999999049146540139},
    {2.5, 10.0, 0.99875026943696862459, 0.0012497305630313754119},
    {3.0, 2.5, 0.456186884116670482, 0.543813115883329518},
    {5.0, 20.0, 0.99998305525606993262, 0.000016944743930067383904},
    {10.0, 3.0, 0.0011024881301154797421, 0.99889751186988452026},
    {20.0, 20.0, 0.52974273316076001269, 0.47025726683923998731},
    {100.0, 90.0, 0.1582209891864301681, 0.8417790108135698319},
    {100.0, 130.0, 0.99724959163269347372, 0.002750408367306526277},
    {1e4, 1.01e4, 0.8413487504471796224, 0.1586512495528203776},
    {7.5, 50.0, 0.99999999999998695296, 1.3047043436251444266e-14},
};

TEST(RegularizedGammaTest, ReferenceValues) {
  for (const GammaCase& c : kGammaCases) {
    SCOPED_TRACE(c.a);
    SCOPED_TRACE(c.x);
    ExpectRelative(RegularizedGammaP(c.a, c.x), c.p, 1e-12);
    ExpectRelative(RegularizedGammaQ(c.a, c.x), c.q, 1e-12);
  }
}

TEST(RegularizedGammaTest, EndsOfTheDomain) {
  for (double a : {1e-3, 0.5, 1.0, 2.5, 15.9, 16.0, 100.0}) {
    EXPECT_EQ(RegularizedGammaP(a, 0.0), 0.0);
    EXPECT_EQ(RegularizedGammaQ(a, 0.0), 1.0);
    for (double x : {1e5, 1e154, 1e300, kInfinity}) {
      EXPECT_EQ(RegularizedGammaP(a, x), 1.0) << a << " " << x;
      EXPECT_EQ(RegularizedGammaQ(a, x), 0.0) << a << " " << x;
    }
  }
  // P(1/2, x) = erf(sqrt(x)), for small x about 2 sqrt(x / pi).
  ExpectRelative(RegularizedGammaP(0.5, 1e-300), 1.1283791670955126e-150,
                 1e-12);
}

TEST(RegularizedGammaTest, BothMethodsMeet) {
  for (double a : {0.5, 1.0, 3.5, 15.99, 16.0, 40.0, 1000.0}) {
    const double x = a + 1.0;
    const double below = std::nextafter(x, 0.0);
    ExpectRelative(RegularizedGammaQ(a, x), RegularizedGammaQ(a, below), 1e-12);
    ExpectRelative(RegularizedGammaP(a, x), RegularizedGammaP(a, below), 1e-12);
  }
}

TEST(RegularizedGammaTest, RefusesArgumentsOutsideTheDomain) {
  EXPECT_THROW(RegularizedGammaP(0.0, 1.0), std::invalid_argument);
  EXPECT_THROW(RegularizedGammaQ(-1.0, 1.0), std::invalid_argument);
  EXPECT_THROW(RegularizedGammaP(1.0, -1.0), std::invalid_argument);
  EXPECT_THROW(RegularizedGammaQ(1.0, std::nan("")), std::invalid_argument);
  EXPECT_THROW(RegularizedGammaQ(kInfinity, 1.0), std::invalid_argument);
}

struct ChiSquareCase {
  int k;
  double s, p_value, density;
};

const ChiSquareCase kChiSquareCases[] = {
    {1, 1e-6, 0.99920211557217787485, 398.94208093034235403},
    {1, 1.0, 0.31731050786291410283, 0.2419707245191433498},
    {1, 3.841458820694124, 0.05, 0.029819461105429836136},
    {1, 100.0, 1.5239706048321052132e-23, 7.6945986267064193463e-24},
    {2, 3.0, 0.22313016014842982893, 0.11156508007421491447},
    {3, 0.001, 0.99999159208094195384, 0.01260935635549078278},
    {3, 3.0, 0.39162517627108895548, 0.15418032980376927681},
    {3, 50.0, 7.9891792449514711391e-11, 3.9177166327543338271e-11},
    {4, 4.0, 0.40600584970983807568, 0.13533528323661269189},
    {5, 5.0, 0.41588018699550792028, 0.12204152134938739261},
    {6, 2.0, 0.91969860292860580399, 0.091969860292860580399},
    {7, 30.0, 0.000094959725081341837597, 0.000040105572021449392658},
    {50, 60.0, 0.15724202723839160354, 0.021298057262058883979},
};

TEST(ChiSquareTest, ReferenceValues) {
  for (const ChiSquareCase& c : kChiSquareCases) {
    SCOPED_TRACE(c.k);
    SCOPED_TRACE(c.s);
    ExpectRelative(ChiSquarePValue(c.s, c.k), c.p_value, 1e-12);
    ExpectRelative(ChiSquarePdf(c.s, c.k), c.density, 1e-12);
  }
}

TEST(ChiSquareTest, ClosedFormsAgreeWithTheIncompleteGammaFunction) {
  for (int k = 1; k <= 4; ++k) {
    for (double s : {1e-8, 0.01, 0.3, 1.0, 2.0, 5.0, 20.0, 300.0}) {
      ExpectRelative(ChiSquarePValue(s, k), RegularizedGammaQ(0.5 * k, 0.5 * s),
                     1e-12);
    }
  }
}

TEST(ChiSquareTest, FiniteForEveryResidual) {
  for (int k : {1, 2, 3, 4, 5, 6, 9, 40}) {
    SCOPED_TRACE(k);
    EXPECT_EQ(ChiSquarePValue(0.0, k), 1.0);
    EXPECT_EQ(ChiSquarePValue(1e300, k), 0.0);
    EXPECT_EQ(ChiSquarePValue(kInfinity, k), 0.0);
    EXPECT_EQ(ChiSquarePdf(1e300, k), 0.0);
    EXPECT_EQ(ChiSquarePdf(kInfinity, k), 0.0);
    double last = 1.0;
    for (double s = 1e-320; s < 1e305; s *= 3.0) {
      const double p_value = ChiSquarePValue(s, k);
      EXPECT_GE(p_value, 0.0) << s;
      EXPECT_LE(p_value, std::min(1.0, last * (1.0 + 1e-14))) << s;
      last = p_value;
      EXPECT_TRUE(std::isfinite(ChiSquarePdf(s, k))) << s;
      EXPECT_GE(ChiSquarePdf(s, k), 0.0) << s;
    }
  }
  EXPECT_EQ(ChiSquarePdf(0.0, 2), 0.5);
  EXPECT_EQ(ChiSquarePdf(0.0, 3), 0.0);
  EXPECT_GT(ChiSquarePdf(0.0, 1), 1e150);
  EXPECT_TRUE(std::isfinite(ChiSquarePdf(0.0, 1)));
}

TEST(ChiSquareTest, OutsideTheSupport) {
  EXPECT_EQ(ChiSquarePValue(-1.0, 3), 1.0);
  EXPECT_EQ(ChiSquarePdf(-1.0, 1), 0.0);
  EXPECT_TRUE(std::isnan(ChiSquarePValue(std::nan(""), 1)));
  EXPECT_TRUE(std::isnan(ChiSquarePdf(std::nan(""), 5)));
}

TEST(ChiSquareTest, RefusesNoDegreesOfFreedom) {
  EXPECT_THROW(ChiSquarePValue(1.0, 0), std::invalid_argument);
  EXPECT_THROW(ChiSquarePdf(1.0, -2), std::invalid_argument);
  EXPECT_THROW(ChiSquareQuantile(0.5, 0), std::invalid_argument);
}

TEST(ChiSquareTest, QuantilesOfTheTables) {
  EXPECT_NEAR(ChiSquareQuantile(0.95, 1), 3.841458820694124, 1e-11);
  EXPECT_NEAR(ChiSquareQuantile(0.95, 2), 5.991464547107979, 1e-11);
  EXPECT_NEAR(ChiSquareQuantile(0.99, 3), 11.344866730144373, 1e-10);
  EXPECT_NEAR(ChiSquareQuantile(0.5, 2), 1.3862943611198906, 1e-12);
  ExpectRelative(ChiSquareQuantile(1e-10, 1), 1.5707963267948966e-20, 1e-9);
}

TEST(ChiSquareTest, QuantileInvertsTheDistribution) {
  for (int k : {1, 2, 3, 5, 8}) {
    for (double p : {1e-8, 0.01, 0.3, 0.5, 0.7, 0.99, 1.0 - 1e-9}) {
      EXPECT_NEAR(1.0 - ChiSquarePValue(ChiSquareQuantile(p, k), k), p, 1e-14);
    }
    EXPECT_EQ(ChiSquareQuantile(0.0, k), 0.0);
    EXPECT_EQ(ChiSquareQuantile(1.0, k), kInfinity);
  }
  for (double p : {-0.1, 1.1}) {
    EXPECT_THROW(ChiSquareQuantile(p, 1), std::invalid_argument);
  }
  EXPECT_THROW(ChiSquareQuantile(std::nan(""), 1), std::invalid_argument);
}

}  // namespace
}  // namespace plumbline
