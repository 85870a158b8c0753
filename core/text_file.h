#ifndef PLUMBLINE_CORE_TEXT_FILE_H_
#define PLUMBLINE_CORE_TEXT_FILE_H_

#include <cstddef>
#include <functional>
#include <string>

namespace plumbline {

/// The content of a small text file (or a pipe), without a byte order mark.
/// Throws Error when it cannot be read, and when it holds more than `limit`
/// bytes or a byte that is zero: a device may have no end.
///
/// `stop` (may be null) is asked five times a second while nothing comes from a
/// pipe: once it returns true, what came before is all.
std::string ReadTextFile(const std::string& path, std::size_t limit,
                         const std::function<bool()>& stop = nullptr);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_TEXT_FILE_H_
