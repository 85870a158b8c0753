#ifndef PLUMBLINE_APPS_SIMULATION_BAG_WRITER_H_
#define PLUMBLINE_APPS_SIMULATION_BAG_WRITER_H_

#include <plumbline/apps/simulation/simulator.h>
#include <plumbline/frontend/bags/message_decoder.h>

#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// A message to be written into a bag.
struct BagRecord {
  std::string topic;
  /// As ROS 1 writes it: "sensor_msgs/LaserScan".
  std::string type;
  /// When it was recorded, ns.
  std::int64_t time = 0;
  /// Packed fields.
  std::string data;
};

/// The messages packed (the inverse of Decode...). `big_endian`: of CDR, which
/// comes in both orders. Covariances, twists and intensities are zero or empty.
std::string EncodeLaserScan(const LaserScanMessage& message,
                            MessageEncoding encoding, bool big_endian = false);
/// As a sensor_msgs/MultiEchoLaserScan: a beam with a return has that and,
/// every third one, a second echo behind it; a beam without one has no echo.
std::string EncodeMultiEchoLaserScan(const LaserScanMessage& message,
                                     MessageEncoding encoding,
                                     bool big_endian = false);
std::string EncodeOdometry(const OdometryMessage& message,
                           MessageEncoding encoding, bool big_endian = false);
std::string EncodeTransforms(const std::vector<TransformMessage>& messages,
                             MessageEncoding encoding, bool big_endian = false);
std::string EncodeImu(const ImuMessage& message, MessageEncoding encoding,
                      bool big_endian = false);

/// How bags are laid out.
struct BagWriterOptions {
  /// Of chunks: "none", "bz2", "lz4" (ROS 1), "none", "lz4", "zstd" (MCAP).
  std::string compression = "none";
  /// A chunk is closed once it has so many bytes.
  std::size_t chunk_size = std::size_t{1} << 18;
  /// MCAP: messages in chunks, or one after another.
  bool chunks = true;
  /// The index at the end, and those of chunks (MCAP).
  bool index = true;
};

/// A ROS 1 bag of version 2.0 with these messages, in this order, which are
/// packed as ROS 1 has it. Throws Error for an unknown compression.
std::string MakeRosbag1(const std::vector<BagRecord>& records,
                        const BagWriterOptions& options = {});

/// An MCAP file with these messages, packed as CDR. Throws Error for an unknown
/// compression.
std::string MakeMcap(const std::vector<BagRecord>& records,
                     const BagWriterOptions& options = {});

/// Writes a ROS 2 bag, a folder with metadata.yaml and a .db3, with these
/// messages, packed as CDR. Until both are there, metadata.yaml names no file.
/// Throws Error when it cannot, and then leaves what was there before, or
/// nothing (only where the new database could be written and its description
/// could not, in the place of an older bag: a metadata.yaml that names no
/// file); or when there is something at `folder` that is
/// not provably, by the digests in its metadata.yaml, a bag that this wrote and
/// nobody changed.
void WriteRosbag2(const std::vector<BagRecord>& records,
                  const std::string& folder);

/// What a robot that drives so publishes: /scan (sensor_msgs/LaserScan, frame
/// laser), /odom (nav_msgs/Odometry, odom to base_link), /tf (the same) and
/// /tf_static (base_link to laser). Numbers are rounded as WriteCarmenLog does,
/// so that all formats say the same; where there is no return the range is
/// infinite.
std::vector<BagRecord> SimulatedMessages(const Simulation& simulation,
                                         const LaserModel& laser,
                                         MessageEncoding encoding);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_BAG_WRITER_H_
