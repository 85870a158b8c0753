#ifndef PLUMBLINE_APPS_CLI_OUTPUT_FILES_H_
#define PLUMBLINE_APPS_CLI_OUTPUT_FILES_H_

#include <string>
#include <vector>

namespace plumbline {

/// A file that a flag names; nothing where `path` is empty.
struct FlagFile {
  /// Without dashes.
  std::string flag;
  std::string path;
};

/// Throws Error when a file that is to be written is one that is read, or when
/// two flags name the same file to write, by whatever names and links. Devices
/// and pipes may be named as often as one likes.
void CheckOutputFiles(const std::vector<FlagFile>& inputs,
                      const std::vector<FlagFile>& outputs);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_OUTPUT_FILES_H_
