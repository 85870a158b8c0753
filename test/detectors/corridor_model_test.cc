#include <gtest/gtest.h>
#include <plumbline/detectors/corridor_model.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

// Tolerance of a face against its side, m and rad.
constexpr double kSideSigma = 0.02;
constexpr double kSideSigmaAngle = 0.01;

SideFace MakeSideFace(CorridorSide side, double along, double past,
                      double turn = 0.0) {
  SideFace on;
  on.side = side;
  on.along = along;
  on.past = past;
  on.turn = turn;
  return on;
}

// Faces measured independently of each other, to `sigma` (m) and 0.001 rad.
CorridorModel ModelOf(const std::vector<SideFace>& faces, double sigma) {
  const auto size = static_cast<Eigen::Index>(2 * faces.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; i += 2) {
    covariance(i, i) = sigma * sigma;
    covariance(i + 1, i + 1) = 1e-6;
  }
  std::vector<Eigen::Vector2d> tolerances(
      faces.size(), Eigen::Vector2d(kSideSigma, kSideSigmaAngle));
  return CorridorModel::OfNewCorridor(faces, covariance, tolerances);
}

TEST(CorridorModelTest, TiesMoveTheCorridorToItsFaces) {
  // Both sides 0.1 m to the left of where they are taken to be, and 0.06 m
  // wider apart.
  const std::vector<SideFace> faces = {MakeSideFace(kRightSide, 0.0, -0.07),
                                       MakeSideFace(kLeftSide, 0.0, 0.13)};
  CorridorModel model = ModelOf(faces, 0.001);
  EXPECT_EQ(model.Correction().norm(), 0.0);
  // Nothing is known of the corridor: anything fits.
  EXPECT_LT(model.Predict(0).chi_square, 1e-3);
  model.Tie(0);
  model.Tie(1);
  EXPECT_NEAR(model.Correction()[0], 0.1, 1e-4);
  EXPECT_NEAR(model.Correction()[1], 0.0, 1e-4);
  EXPECT_NEAR(model.Correction()[2], 0.03, 1e-4);
}

TEST(CorridorModelTest, TheDirectionIsThatOfTheFaces) {
  CorridorModel model = ModelOf({MakeSideFace(kRightSide, -3.0, 0.0, 0.01),
                                 MakeSideFace(kLeftSide, 3.0, 0.0, 0.01)},
                                0.001);
  model.Tie(0);
  model.Tie(1);
  EXPECT_NEAR(model.Correction()[1], 0.01, 1e-4);
}

TEST(CorridorModelTest, AnInnovationIsOfWhatIsTied) {
  const std::vector<SideFace> faces = {MakeSideFace(kRightSide, 0.0, 0.0),
                                       MakeSideFace(kLeftSide, 0.0, 0.0),
                                       MakeSideFace(kRightSide, 0.0, 0.3)};
  CorridorModel model = ModelOf(faces, 0.01);
  model.Tie(0);
  model.Tie(1);
  const CorridorModel::Innovation innovation = model.Predict(2);
  EXPECT_NEAR(innovation.error[0], 0.3, 1e-4);
  // Its own error and tolerance, and those of the face that made the side.
  const double variance = 2.0 * (0.01 * 0.01 + kSideSigma * kSideSigma);
  EXPECT_NEAR(innovation.covariance(0, 0), variance, 1e-3 * variance);
  EXPECT_NEAR(innovation.chi_square, 0.09 / variance, 0.01 * 0.09 / variance);
}

TEST(CorridorModelTest, FacesThatDoNotFitStayUntied) {
  const std::vector<SideFace> faces = {
      MakeSideFace(kRightSide, 0.0, 0.3), MakeSideFace(kRightSide, 4.0, 0.0),
      MakeSideFace(kLeftSide, 4.0, 0.0), MakeSideFace(kRightSide, 8.0, 0.01)};
  CorridorModel model = ModelOf(faces, 0.005);
  const std::vector<SideFace> fitting = model.TieFitting({1, 2}, 11.8);
  ASSERT_EQ(fitting.size(), 3u);
  EXPECT_EQ(fitting[0].along, 4.0);
  EXPECT_EQ(fitting[0].side, kRightSide);
  EXPECT_EQ(fitting[1].side, kLeftSide);
  EXPECT_EQ(fitting[2].along, 8.0);
}

TEST(CorridorModelTest, NoneFitsWhereOneOfTheFirstDoesNot) {
  const std::vector<SideFace> faces = {MakeSideFace(kRightSide, 0.0, 0.0),
                                       MakeSideFace(kLeftSide, 0.0, 0.0),
                                       MakeSideFace(kRightSide, 0.0, 0.3)};
  CorridorModel model = ModelOf(faces, 0.005);
  EXPECT_TRUE(model.TieFitting({0, 1, 2}, 11.8).empty());
  CorridorModel again = ModelOf(faces, 0.005);
  EXPECT_EQ(again.TieFitting({0, 1}, 11.8).size(), 2u);
}

}  // namespace
}  // namespace plumbline
