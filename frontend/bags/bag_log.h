#ifndef PLUMBLINE_FRONTEND_BAGS_BAG_LOG_H_
#define PLUMBLINE_FRONTEND_BAGS_BAG_LOG_H_

#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/log_reader.h>
#include <plumbline/frontend/scan.h>

#include <string>

namespace plumbline {

/// Makes a log of the messages of a bag (frontend/bags.md says how topics and
/// frames are chosen). `name` stands for the bag in messages.
///
/// Scans come from a topic of type sensor_msgs/LaserScan or MultiEchoLaserScan,
/// odometry from one of type nav_msgs/Odometry or from the transform of a frame
/// called "odom" to the robot, and the laser's place on the robot from /tf and
/// /tf_static. Poses are taken at the time of each scan, interpolated. Without
/// odometry Log::yaw_rates has what a sensor_msgs/Imu measured.
///
/// Messages that cannot be used are counted in Log::skipped. Throws Error, with
/// a list of what is there, when there is no scan, or more than one topic that
/// could be meant and no option says which.
Log ReadBag(BagSource* source, const std::string& name,
            const LaserOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_BAG_LOG_H_
