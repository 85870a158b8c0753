#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/evaluation/trajectory_file.h>
#include <plumbline/apps/simulation/bag_writer.h>
#include <plumbline/core/error.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "refusal.h"

namespace plumbline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class TrajectoryFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "trajectory_file_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name() +
              "_" + std::to_string(getpid()) + "/";
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + name, std::ios::binary) << text;
    return folder_ + name;
  }
  TrajectoryFile Read(const std::string& text, const std::string& topic = "") {
    return ReadTrajectory(Write("file", text), topic);
  }
  std::string RefusalOf(const std::string& text,
                        const std::string& topic = "") {
    return Refusal([&] { Read(text, topic); });
  }

  std::string folder_;
};

TEST_F(TrajectoryFileTest, Tum) {
  const TrajectoryFile file = Read(
      "# timestamp tx ty tz qx qy qz qw\n"
      "10.5 1 2 3 0 0 0 1\n"
      "\n"
      "11.5 4 5 6 0 0 0.70710678 0.70710678\r\n");
  EXPECT_EQ(file.format, "TUM");
  EXPECT_TRUE(file.has_times);
  ASSERT_EQ(file.poses.size(), 2u);
  EXPECT_EQ(file.poses[1].timestamp, 11.5);
  EXPECT_EQ(file.poses[1].pose.translation, Eigen::Vector3d(4, 5, 6));
  EXPECT_NEAR(InPlane(file)[1].pose[2], std::acos(-1.0) / 2, 1e-9);
  EXPECT_THAT(file.notes, IsEmpty());
}

TEST_F(TrajectoryFileTest, Kitti) {
  const TrajectoryFile file = Read(
      "1 0 0 7 0 1 0 8 0 0 1 9\n"
      "0 -1 0 1 1 0 0 2 0 0 1 3\n");
  EXPECT_EQ(file.format, "KITTI");
  EXPECT_FALSE(file.has_times);
  ASSERT_EQ(file.poses.size(), 2u);
  EXPECT_EQ(file.poses[0].pose.translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(file.poses[1].timestamp, 1.0);
  EXPECT_NEAR(InPlane(file)[1].pose[2], std::acos(-1.0) / 2, 1e-12);
}

TEST_F(TrajectoryFileTest, DisorderIsSaid) {
  const TrajectoryFile file =
      Read("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n");
  EXPECT_THAT(file.notes, ElementsAre(HasSubstr("go back 1 time:")));
  EXPECT_EQ(file.poses[0].timestamp, 2.0);
}

TEST_F(TrajectoryFileTest, BadInputIsRefused) {
  EXPECT_THAT(RefusalOf(""), HasSubstr("holds no pose"));
  EXPECT_THAT(RefusalOf("# nothing\n"), HasSubstr("holds no pose"));
  // Cut in the middle of a line.
  EXPECT_THAT(RefusalOf("1 0 0 0 0 0 0 1\n2 0 0 0"),
              HasSubstr("file:2: 4 fields: expected eight numbers"));
  EXPECT_THAT(RefusalOf("1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n"),
              HasSubstr("file:2: 'nan' is no finite number"));
  EXPECT_THAT(RefusalOf("1 0 0 0 0 0 0 0\n"), HasSubstr("unit length"));
  EXPECT_THAT(RefusalOf("1 0 0 7 0 1 0 8 0 0 1 9\n1 0 0 7 0 1 0\n"),
              HasSubstr("file:2: 7 fields: expected twelve numbers"));
  EXPECT_THAT(RefusalOf("1 0 0 7 0 1 0 8 0 0 1 inf\n"),
              HasSubstr("file:1: 'inf' is no finite number"));
  EXPECT_THAT(RefusalOf("1 0 0 7 0 1 0 8 0 0 1 1e300\n"),
              HasSubstr("file:1: '1e300' is absurd"));
  EXPECT_THAT(RefusalOf("1 0 0 7 0 1 0 8 0 0 2 9\n"),
              HasSubstr("file:1: the matrix is no rotation"));
  // A mirror.
  EXPECT_THAT(RefusalOf("1 0 0 7 0 1 0 8 0 0 -1 9\n"),
              HasSubstr("the matrix is no rotation"));
  EXPECT_THAT(RefusalOf(std::string("\x7f"
                                    "ELF\0\0\0 x",
                                    9)),
              HasSubstr("of a format that is not known"));
  EXPECT_THAT(RefusalOf("1 0 0 0 0 0 0 1\n", "/odom"),
              HasSubstr("is no bag, and has no topic '/odom'"));
  EXPECT_THAT(Refusal([&] { ReadTrajectory(folder_ + "none"); }),
              HasSubstr("cannot be opened"));
}

BagRecord Odometry(const std::string& topic, std::int64_t time, double x) {
  OdometryMessage message;
  message.header.stamp = time;
  message.header.frame = "odom";
  message.child_frame = "base_link";
  message.pose.x = x;
  return {topic, "nav_msgs/Odometry", time,
          EncodeOdometry(message, MessageEncoding::kRos1)};
}

BagRecord Transform(const std::string& parent, const std::string& child,
                    std::int64_t time, double x) {
  TransformMessage message;
  message.header.stamp = time;
  message.header.frame = parent;
  message.child_frame = child;
  message.transform.x = x;
  return {"/tf", "tf2_msgs/TFMessage", time,
          EncodeTransforms({message}, MessageEncoding::kRos1)};
}

TEST_F(TrajectoryFileTest, TheOnlyTopicOfABag) {
  const TrajectoryFile file =
      Read(MakeRosbag1({Odometry("/odom", 1500000000, 1.0),
                        Odometry("/odom", 2000000000, 2.0)}));
  EXPECT_EQ(file.source, "/odom");
  ASSERT_EQ(file.poses.size(), 2u);
  EXPECT_EQ(file.poses[0].timestamp, 1.5);
  EXPECT_EQ(file.poses[1].pose.translation.x(), 2.0);
}

TEST_F(TrajectoryFileTest, OfSeveralTopicsOneIsNamed) {
  const std::string bag = MakeRosbag1(
      {Odometry("/odom", 1000000000, 1.0), Odometry("/slam", 1000000000, 5.0)});
  EXPECT_THAT(RefusalOf(bag), AllOf(HasSubstr("several topics"),
                                    HasSubstr("/slam (nav_msgs/Odometry, 1)"),
                                    HasSubstr("--trajectory_topic")));
  EXPECT_EQ(Read(bag, "slam").poses[0].pose.translation.x(), 5.0);
  EXPECT_THAT(RefusalOf(bag, "/none"),
              HasSubstr("has no poses in a topic '/none'"));
}

TEST_F(TrajectoryFileTest, TransformsAreJoined) {
  // map to odom is known from 1 s to 3 s, odom to base from 2 s on: in between
  // there are the times of both.
  const std::string bag =
      MakeRosbag1({Transform("map", "odom", 1000000000, 1.0),
                   Transform("odom", "base", 2000000000, 10),
                   Transform("map", "odom", 3000000000, 3.0),
                   Transform("odom", "base", 4000000000, 30)});
  const TrajectoryFile file = Read(bag, "tf:map.base");
  ASSERT_EQ(file.poses.size(), 2u);
  EXPECT_EQ(file.poses[0].timestamp, 2.0);
  EXPECT_DOUBLE_EQ(file.poses[0].pose.translation.x(), 12.0);
  EXPECT_EQ(file.poses[1].timestamp, 3.0);
  EXPECT_DOUBLE_EQ(file.poses[1].pose.translation.x(), 23.0);
  EXPECT_THAT(RefusalOf(bag, "tf:map.laser"),
              AllOf(HasSubstr("from 'map' to 'laser'"), HasSubstr("odom")));
  EXPECT_THAT(RefusalOf(bag, "tf:map"), HasSubstr("names no two frames"));
  EXPECT_THAT(RefusalOf(bag), HasSubstr("has no topic of poses"));
}

TEST_F(TrajectoryFileTest, ACutBagSaysSo) {
  std::vector<BagRecord> records;
  for (int i = 0; i < 50; ++i) {
    records.push_back(Odometry("/odom", 1000000000LL * i, i));
  }
  const std::string bag = MakeRosbag1(records);
  for (std::size_t cut = 1; cut < bag.size(); cut += bag.size() / 50) {
    try {
      const TrajectoryFile file = Read(bag.substr(0, cut));
      EXPECT_THAT(file.notes, ::testing::Not(IsEmpty())) << cut;
    } catch (const Error&) {
      // Nothing that is a pose was left.
    }
  }
}

}  // namespace
}  // namespace plumbline
