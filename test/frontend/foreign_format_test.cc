#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/carmen_reader.h>
#include <plumbline/frontend/foreign_format.h>
#include <plumbline/frontend/input_stream.h>

#include <string>

#include "refusal.h"

namespace plumbline {
namespace {

TEST(ForeignFormatTest, IsToldByItsFirstBytes) {
  EXPECT_EQ(ForeignFormat("%PDF-1.7\n"), "a PDF document");
  EXPECT_EQ(ForeignFormat("# .PCD v0.7 - Point Cloud"), "a PCD point cloud");
  EXPECT_EQ(ForeignFormat(std::string("\xdb\x01\xf5\x5b\x7b\x1f\x1d\x7b\0", 9)),
            "a Cartographer state (pbstream)");
  EXPECT_EQ(ForeignFormat(std::string(257, '\0') + "ustar  "), "a tar archive");
  EXPECT_EQ(ForeignFormat("\n {\"features\": []}"), "JSON");
  EXPECT_EQ(ForeignFormat("image: map.pgm\nresolution: 0.05\n"),
            "the YAML of a ROS map");
  EXPECT_EQ(ForeignFormat("# t x y z\n1 0 0 0 0 0 0 1\n"),
            "a trajectory (TUM) or a relations file");
  EXPECT_EQ(ForeignFormat("1 0 0 0 0 1 0 0 0 0 1 0\n"), "a trajectory (KITTI)");
}

TEST(ForeignFormatTest, WhatMayBeALogIsLeftAlone) {
  EXPECT_EQ(ForeignFormat(""), "");
  EXPECT_EQ(ForeignFormat("# CARMEN\nFLASER 2 1 1 0 0 0 0 0 0 1 r 1\n"), "");
  EXPECT_EQ(ForeignFormat("PARAM robot_front_laser_max 80\n"), "");
  EXPECT_EQ(ForeignFormat("time,range_0,range_1\n1,2,3\n"), "");
  // A line that does not end: a number may go on.
  EXPECT_EQ(ForeignFormat("1 2 3 4 5 6 7 8"), "");
}

TEST(ForeignFormatTest, TheRefusalNamesIt) {
  InputStream input("scans.pcd", "# .PCD v0.7 - Point Cloud Data\n");
  EXPECT_EQ(Refusal([&] { ReadCarmenLog(&input, {}); }),
            "scans.pcd: is a PCD point cloud: expected a robot's log (CARMEN, "
            "or a ROS 1 or ROS 2 bag) or a graph (g2o)");
}

}  // namespace
}  // namespace plumbline
