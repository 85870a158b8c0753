#ifndef PLUMBLINE_FRONTEND_FOREIGN_FORMAT_H_
#define PLUMBLINE_FRONTEND_FOREIGN_FORMAT_H_

#include <string>
#include <string_view>

namespace plumbline {

/// Describes a file that is no log by its first bytes: "a PCD point cloud", "a
/// PDF document", "a trajectory (TUM)". Empty when the format is not known for
/// certain, so that it may still be a log. 512 bytes and the first line that is
/// no comment are enough.
std::string ForeignFormat(std::string_view prefix);

/// What was expected in the place of a file that no reader recognizes: what a
/// file of its name begins with, "an MCAP file, which begins with the bytes
/// 0x89 MCAP0", or any input where the name says nothing.
std::string ExpectedInFileOf(const std::string& name);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_FOREIGN_FORMAT_H_
