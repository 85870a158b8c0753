#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/tum.h>

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/timed_poses.h"
#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

std::vector<TimedPose> ParseTum(const std::string& text) {
  InputStream input("path.tum", text);
  return ReadTum(&input);
}

TEST(TumTest, Writes) {
  std::vector<TimedPose> trajectory = {At(12.5, 1, -2, kPi / 2),
                                       At(13, 0, 0, 3 * kPi)};
  trajectory[1].timestamp_text = "13.000000125";
  std::ostringstream output;
  WriteTum(trajectory, output);
  EXPECT_EQ(output.str(),
            "12.500000 1.000000000 -2.000000000 0 0 0 0.707106781187 "
            "0.707106781187\n"
            "13.000000125 0.000000000 0.000000000 0 0 0 1.000000000000 "
            "0.000000000000\n");

  trajectory[0].pose[0] = NAN;
  EXPECT_THAT(Refusal([&] { WriteTum(trajectory, output); }),
              HasSubstr("not finite"));
}

TEST(TumTest, ReadsBack) {
  const std::vector<TimedPose> trajectory = {
      At(976052857.337530, 1.5, -2.25, 3.0), At(2.0, 1e4, 0, -3.1)};
  std::ostringstream output;
  WriteTum(trajectory, output);
  const std::vector<TimedPose> read = ParseTum(output.str());
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].timestamp_text, "976052857.337530");
  EXPECT_EQ(read[0].timestamp, 976052857.337530);
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(read[i].pose[k], trajectory[i].pose[k], 1e-9);
  }
}

TEST(TumTest, YawOfATiltedQuaternion) {
  // Yaw 90 degrees after roll 180: q = qz(90) qx(180) = (s, s, 0, 0), and the
  // x axis goes to y.
  const std::vector<TimedPose> read =
      ParseTum("# comment\n1 0 0 7 0.70710678 0.70710678 0 0\n");
  EXPECT_NEAR(read[0].pose[2], kPi / 2, 1e-9);
}

TEST(TumTest, RefusesBadFiles) {
  EXPECT_THAT(Refusal([] { ParseTum("1 0 0 0 0 0 0 1\n1 0 0\n"); }),
              HasSubstr("path.tum:2: 3 fields"));
  EXPECT_THAT(Refusal([] { ParseTum("1 0 0 0 0 0 0 0\n"); }),
              HasSubstr("path.tum:1: quaternion is not of unit length"));
  EXPECT_THAT(Refusal([] { ParseTum("1 0 inf 0 0 0 0 1\n"); }),
              HasSubstr("'inf' is no finite number"));
  // Squares of it would be none.
  EXPECT_THAT(Refusal([] { ParseTum("1 0 1e200 0 0 0 0 1\n"); }),
              HasSubstr("path.tum:1: '1e200' is absurd"));
  EXPECT_THAT(Refusal([] { ParseTum(""); }), HasSubstr("holds no pose"));
  EXPECT_THAT(Refusal([] { ReadTum("no/such.tum"); }),
              HasSubstr("no/such.tum: cannot be opened"));
}

}  // namespace
}  // namespace plumbline
