#ifndef PLUMBLINE_FRONTEND_TUM_H_
#define PLUMBLINE_FRONTEND_TUM_H_

#include <plumbline/frontend/input_stream.h>
#include <plumbline/frontend/timed_pose.h>

#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// Writes a trajectory in the format of the TUM benchmark,
/// `timestamp x y z qx qy qz qw`: one line per pose, single blanks, no
/// comments, in the order given. The time stamp is written as the input wrote
/// it, else with six decimals. Throws Error for a pose that is not finite.
void WriteTum(const std::vector<TimedPose>& trajectory, std::ostream& output);

/// Reads a trajectory in the TUM format (plain, gzip, bzip2, "-"); comments
/// (#) and empty lines are passed over. The pose is that in the plane: z, roll
/// and pitch are dropped. Throws Error with file and line for wrong numbers of
/// fields, numbers that do not parse or are not finite, quaternions that are
/// not of unit length, and a file without poses.
std::vector<TimedPose> ReadTum(const std::string& path);
std::vector<TimedPose> ReadTum(InputStream* input);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_TUM_H_
