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

TEST(ForeignFormatTest, WhatTheNamePromisesIsExpected) {
  const auto refusal = [](const std::string& name, const std::string& text) {
    InputStream input(name, text);
    return Refusal([&] { ReadCarmenLog(&input, {}); });
  };
  EXPECT_EQ(refusal("a.bag", ""),
            "a.bag: is empty: expected a ROS 1 bag, which begins with "
            "'#ROSBAG V2.0'");
  EXPECT_EQ(refusal("a.mcap", ""),
            "a.mcap: is empty: expected an MCAP file, which begins with the "
            "bytes 0x89 MCAP0");
  EXPECT_EQ(refusal("a.csv", "a,b\n1,2\n").substr(0, 32),
            "a.csv: no laser scan found: 2 li");
  EXPECT_EQ(ExpectedInFileOf("a.csv"),
            "a line that names the columns, among them time and r0, then a "
            "line per scan");
  EXPECT_EQ(refusal("a.g2o.bz2", "BZh9"),
            "a.g2o.bz2: nothing of it can be unpacked: bzip2 data breaks off "
            "before its end: expected a graph (g2o) with lines such as "
            "VERTEX_SE2 and EDGE_SE2");
  const std::string any =
      "a robot's log (CARMEN, CSV, or a ROS 1 or ROS 2 bag) or a graph (g2o)";
  for (const char* name : {"", "bag", "standard input", "a.log.gz"}) {
    EXPECT_EQ(ExpectedInFileOf(name), any);
  }
}

TEST(ForeignFormatTest, TheRefusalNamesIt) {
  InputStream input("scans.pcd", "# .PCD v0.7 - Point Cloud Data\n");
  EXPECT_EQ(Refusal([&] { ReadCarmenLog(&input, {}); }),
            "scans.pcd: is a PCD point cloud: expected a robot's log (CARMEN, "
            "CSV, or a ROS 1 or ROS 2 bag) or a graph (g2o)");
}

}  // namespace
}  // namespace plumbline
