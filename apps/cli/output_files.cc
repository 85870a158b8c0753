#include <plumbline/apps/cli/output_files.h>
#include <plumbline/core/error.h>

#include <cstddef>
#include <filesystem>
#include <system_error>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

// What a link points at, if only at a file that is not there yet: once that is
// written, the link leads to it.
fs::path BehindLinks(fs::path path) {
  constexpr int kMostLinks = 40;
  std::error_code error;
  for (int i = 0; i < kMostLinks && fs::is_symlink(path, error); ++i) {
    const fs::path target = fs::read_symlink(path, error);
    if (error) break;
    // An absolute one takes the place of all.
    path = path.parent_path() / target;
  }
  return path;
}

bool AreTheSame(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::exists(a, error) && fs::exists(b, error)) {
    return (fs::is_regular_file(a, error) || fs::is_directory(a, error)) &&
           fs::equivalent(a, b, error);
  }
  // One that is not there yet, perhaps through a link to it or its folder.
  const auto place = [&error](const fs::path& path) {
    const fs::path absolute = fs::absolute(path, error);
    // Without a working folder.
    if (error) return absolute;
    return fs::weakly_canonical(BehindLinks(absolute), error);
  };
  const fs::path first = place(a);
  return !error && first == place(b) && !error;
}

}  // namespace

void CheckOutputFiles(const std::vector<FlagFile>& inputs,
                      const std::vector<FlagFile>& outputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const FlagFile& output = outputs[i];
    if (output.path.empty()) continue;
    for (const FlagFile& input : inputs) {
      if (input.path.empty() || !AreTheSame(output.path, input.path)) continue;
      throw Error("--" + output.flag, 0,
                  "'" + output.path + "' is what --" + input.flag +
                      " reads, and would be replaced",
                  "another name");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (outputs[j].path.empty() || !AreTheSame(output.path, outputs[j].path))
        continue;
      throw Error("--" + output.flag, 0,
                  "'" + output.path + "' is written for --" + outputs[j].flag +
                      " already",
                  "another name");
    }
  }
}

}  // namespace plumbline
