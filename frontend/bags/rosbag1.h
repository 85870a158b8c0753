#ifndef PLUMBLINE_FRONTEND_BAGS_ROSBAG1_H_
#define PLUMBLINE_FRONTEND_BAGS_ROSBAG1_H_

#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/input_stream.h>

#include <memory>
#include <string_view>

namespace plumbline {

/// Whether bytes that start with `prefix` are a ROS 1 bag, of any version.
bool LooksLikeRosbag1(std::string_view prefix);

/// The messages of a ROS 1 bag of version 2.0 (wiki.ros.org/Bags/Format/2.0),
/// chunks plain, bz2 or lz4. The bag is read from its beginning to its end: the
/// index is neither needed nor trusted. Where a record is damaged or its size
/// is a lie, reading goes on with the next record that can be one. `input` must
/// outlive the source. Throws Error for other versions and for encrypted bags.
std::unique_ptr<BagSource> OpenRosbag1(InputStream* input);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_ROSBAG1_H_
