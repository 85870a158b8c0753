#ifndef PLUMBLINE_FRONTEND_BAGS_ROSBAG2_H_
#define PLUMBLINE_FRONTEND_BAGS_ROSBAG2_H_

#include <plumbline/frontend/bags/bag_source.h>
#include <plumbline/frontend/input_stream.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace plumbline {

/// Whether bytes that start with `prefix` are an SQLite database.
bool LooksLikeSqlite(std::string_view prefix);

/// The messages of a .db3 file of a ROS 2 bag. The database is opened for
/// reading only, and its tables are not trusted to be in order. Where `input`
/// is no plain file (a pipe, or compressed) it is copied to a temporary file
/// first. `input` must outlive the source. Throws Error when the file is no
/// such database.
std::unique_ptr<BagSource> OpenRosbag2Sqlite(InputStream* input);

/// Whether the folder `path` is a ROS 2 bag: has a metadata.yaml, or files
/// that end in .db3 or .mcap (or these and .zstd). Or holds bags of ROS 1,
/// files that end in .bag.
bool LooksLikeRosbag2Folder(const std::string& path);

/// The messages of a ROS 2 bag: the files that metadata.yaml names, one after
/// another, or without one all that are there in the order of their names.
/// Or those of a folder of ROS 1 bags, which have to be the parts of one
/// recording by their names (..._0.bag, ..._1.bag and so on).
/// `stop` and `progress` (may be empty) are those of InputStream, the latter
/// over all files. Throws Error when there is none, or none can be read.
std::unique_ptr<BagSource> OpenRosbag2Folder(
    const std::string& path, std::function<bool()> stop = nullptr,
    std::function<void(std::int64_t done, std::int64_t size)> progress =
        nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_ROSBAG2_H_
