#ifndef PLUMBLINE_CORE_ATOMIC_FILE_H_
#define PLUMBLINE_CORE_ATOMIC_FILE_H_

#include <functional>
#include <ostream>
#include <string>

namespace plumbline {

/// Writes a file whole or not at all: `write` fills a temporary file beside
/// `path`, which is flushed, checked and renamed. On any failure (also an
/// exception from `write`, which is passed on) the temporary file is gone and
/// an older `path` stays as it was; on file systems that have files without
/// names (O_TMPFILE) so it is when the process is killed. Throws Error when the
/// file cannot be written.
void WriteFileAtomically(const std::string& path,
                         const std::function<void(std::ostream&)>& write);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_ATOMIC_FILE_H_
