#ifndef PLUMBLINE_TEST_FUZZ_SCRATCH_FOLDER_H_
#define PLUMBLINE_TEST_FUZZ_SCRATCH_FOLDER_H_

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace plumbline {

// A folder of this process alone, and gone with it: in memory where the system
// has such a place, as a disk is waited for a hundred times as long as most
// inputs take.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name) {
    std::filesystem::path root = "/dev/shm";
    if (access(root.c_str(), W_OK) != 0) {
      root = std::filesystem::temp_directory_path();
    }
    path_ = root / ("plumbline_" + name + "_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  std::string path() const { return path_.string(); }

  // Path of a file in it with this content.
  std::string Write(const std::string& file, const std::string& text) const {
    std::ofstream(path_ / file, std::ios::binary) << text;
    return (path_ / file).string();
  }

 private:
  std::filesystem::path path_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_FUZZ_SCRATCH_FOLDER_H_
