#include <fcntl.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/version.h>
#include <plumbline/outputs/output_folder.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kStagingPrefix[] = ".plumbline_files.";
// The summary.json of the moment in which files are put in place.
constexpr char kMixedSummary[] = ".mixed_summary.json";

// Locks an open folder against other processes; false when one has it. A file
// system without locks has none to wait for.
bool Lock(int descriptor, bool wait) {
  while (flock(descriptor, LOCK_EX | (wait ? 0 : LOCK_NB)) != 0) {
    if (errno != EINTR) return errno != EWOULDBLOCK;
  }
  return true;
}

// A folder that is open, and locked while this lives.
class LockedFolder {
 public:
  explicit LockedFolder(const fs::path& folder)
      : descriptor_(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (descriptor_ >= 0) Lock(descriptor_, /*wait=*/true);
  }
  ~LockedFolder() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  LockedFolder(const LockedFolder&) = delete;
  LockedFolder& operator=(const LockedFolder&) = delete;

  // What was renamed so far is on the disk.
  void Sync() const {
    if (descriptor_ >= 0) fsync(descriptor_);
  }

 private:
  int descriptor_;
};

// Whether a name is "<one of names>.tmp<process>_<number>" (atomic_file.cc) of
// a process that is gone.
bool IsDeadTemporary(const std::string& name,
                     const std::set<std::string>& names) {
  const std::size_t suffix = name.rfind(".tmp");
  if (suffix == std::string::npos || names.count(name.substr(0, suffix)) == 0) {
    return false;
  }
  const std::string numbers = name.substr(suffix + 4);
  const std::size_t line = numbers.find('_');
  const auto is_number = [](const std::string& text) {
    return !text.empty() && text.size() < 10 &&
           text.find_first_not_of("0123456789") == std::string::npos;
  };
  if (line == std::string::npos || !is_number(numbers.substr(0, line)) ||
      !is_number(numbers.substr(line + 1))) {
    return false;
  }
  const pid_t process = static_cast<pid_t>(std::stol(numbers));
  return process > 0 && kill(process, 0) != 0 && errno == ESRCH;
}

[[noreturn]] void FailToReplace(const fs::path& path, int error_number,
                                const std::string& state) {
  throw Error(path.string(), 0,
              std::string("cannot put the file in place: ") +
                  std::strerror(error_number) + state,
              "a writable place");
}

// Renames over `target`, or over what it points at; false, with errno, when it
// cannot be.
bool MoveFile(const fs::path& from, const fs::path& target) {
  std::error_code error;
  if (!fs::is_symlink(target, error)) {
    return std::rename(from.c_str(), target.c_str()) == 0;
  }
  const fs::path resolved = fs::canonical(target, error);
  if (error) return std::rename(from.c_str(), target.c_str()) == 0;
  if (std::rename(from.c_str(), resolved.c_str()) == 0) return true;
  if (errno != EXDEV) return false;
  std::ifstream content(from, std::ios::binary);
  WriteFileAtomically(resolved.string(), [&](std::ostream& output) {
    if (content.peek() != std::ifstream::traits_type::eof()) {
      output << content.rdbuf();
    }
  });
  fs::remove(from, error);
  return true;
}

// Those of a folder and the folders that it lies in that are not there, the
// innermost first. Throws Error when the working folder was removed, from which
// a relative path would lead nowhere.
std::vector<fs::path> MissingFolders(const fs::path& folder) {
  std::vector<fs::path> missing;
  std::error_code error;
  fs::path path = fs::absolute(folder, error).lexically_normal();
  if (error) {
    throw Error(folder.string(), 0,
                "the working folder is not there (" + error.message() + ")",
                "a working folder, or a path from the root on");
  }
  // "out/" is "out".
  if (path.filename().empty()) path = path.parent_path();
  while (fs::symlink_status(path, error).type() == fs::file_type::not_found) {
    missing.push_back(path);
    path = path.parent_path();
  }
  return missing;
}

}  // namespace

// What summary.json says of the files beside it.
struct OutputFolder::Manifest {
  bool is_whole = false;
  std::set<std::string> files;
  // There may be several when two runs are mixed.
  std::map<std::string, std::set<std::string>> digests;
};

OutputFolder::Manifest OutputFolder::ReadManifest(const fs::path& path) {
  Manifest manifest;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return manifest;
  std::ifstream file(path);
  const Json json = Json::parse(file, nullptr, false);
  if (!json.is_object()) return manifest;
  const auto files = json.find("files");
  if (files != json.end() && files->is_array()) {
    for (const Json& name : *files) {
      if (name.is_string()) manifest.files.insert(name.get<std::string>());
    }
  }
  const auto digests = json.find("sha256");
  if (digests != json.end() && digests->is_object()) {
    for (const auto& [name, digest] : digests->items()) {
      for (const Json& one :
           digest.is_array() ? digest : Json::array({digest})) {
        if (one.is_string()) {
          manifest.digests[name].insert(one.get<std::string>());
        }
      }
    }
  }
  const auto partial = json.find("partial");
  manifest.is_whole = json.contains("counts") &&
                      (partial == json.end() || *partial == Json(false));
  return manifest;
}

OutputFolder::OutputFolder(fs::path folder, std::set<std::string> own_names,
                           std::vector<fs::path> inputs)
    : folder_(std::move(folder)),
      own_names_(std::move(own_names)),
      inputs_(std::move(inputs)) {
  own_names_.insert(kSummary);
  std::error_code error;
  made_ = MissingFolders(folder_);
  fs::create_directories(folder_, error);
  if (error || !fs::is_directory(folder_)) {
    throw Error(folder_.string(), 0,
                "cannot make the output folder" +
                    (error ? " (" + error.message() + ")" : std::string()),
                "a folder that can be written to");
  }
  if (access(folder_.c_str(), W_OK | X_OK) != 0) {
    throw Error(folder_.string(), 0,
                std::string("cannot write to the output folder (") +
                    std::strerror(errno) + ")",
                "a folder that can be written to");
  }
  CleanUp();
}

OutputFolder::~OutputFolder() {
  RemoveStaging();
  // Only those that are empty go.
  std::error_code ignored;
  for (const fs::path& path : made_) fs::remove(path, ignored);
}

void OutputFolder::RemoveStaging() {
  if (staging_descriptor_ < 0) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  close(staging_descriptor_);
  staging_descriptor_ = -1;
}

bool OutputFolder::IsInput(const fs::path& path) const {
  return std::any_of(inputs_.begin(), inputs_.end(),
                     [&](const fs::path& input) {
                       std::error_code error;
                       return fs::equivalent(input, path, error) && !error;
                     });
}

void OutputFolder::CleanUp() {
  const LockedFolder lock(folder_);
  std::error_code error;
  std::vector<fs::path> files, stagings;
  for (fs::directory_iterator entry(folder_, error), end;
       !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code status_error;
    const fs::file_status status = entry->symlink_status(status_error);
    if (fs::is_regular_file(status) && IsDeadTemporary(name, own_names_)) {
      files.push_back(entry->path());
    } else if (fs::is_directory(status) && name.rfind(kStagingPrefix, 0) == 0) {
      stagings.push_back(entry->path());
    }
  }
  for (const fs::path& file : files) {
    if (!IsInput(file) && fs::remove(file, error)) {
      cleaned_.push_back(file.filename().string());
    }
  }
  std::set<std::string> staged_names = own_names_;
  staged_names.insert(kMixedSummary);
  for (const fs::path& staging : stagings) {
    // A process that lives holds the lock.
    const int descriptor =
        open(staging.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) continue;
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) {
      std::vector<fs::path> staged;
      for (fs::directory_iterator entry(staging, error), end;
           !error && entry != end; entry.increment(error)) {
        const std::string name = entry->path().filename().string();
        if (staged_names.count(name) > 0 ||
            IsDeadTemporary(name, staged_names)) {
          staged.push_back(entry->path());
        }
      }
      for (const fs::path& file : staged) {
        if (!IsInput(file)) fs::remove(file, error);
      }
      // Fails while anything else is in there.
      if (rmdir(staging.c_str()) == 0) {
        cleaned_.push_back(staging.filename().string());
      }
    }
    close(descriptor);
  }
  std::sort(cleaned_.begin(), cleaned_.end());
}

void OutputFolder::CheckTargets(const std::set<std::string>& names) const {
  std::set<std::string> all = names;
  all.insert(kSummary);
  for (const std::string& name : all) {
    const fs::path path = folder_ / name;
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) continue;
    if (fs::is_directory(status)) {
      throw Error(path.string(), 0, "is a folder",
                  "a place for the file of this name");
    }
    if (!fs::is_regular_file(status)) {
      throw Error(path.string(), 0, "is a pipe or a device",
                  "a regular file or nothing in its place");
    }
    if (IsInput(path)) {
      throw Error(path.string(), 0,
                  "is read by this run, which would replace it",
                  "another --output_dir, or --outputs without it");
    }
  }
}

const fs::path& OutputFolder::staging() {
  if (staging_descriptor_ >= 0) return staging_;
  // Somebody may have removed it in the meantime.
  std::error_code ignored;
  fs::create_directories(folder_, ignored);
  // Nobody takes the new folder for a leftover before it is locked.
  const LockedFolder lock(folder_);
  std::string name = (folder_ / kStagingPrefix).string() + "XXXXXX";
  if (mkdtemp(name.data()) == nullptr) {
    throw Error(folder_.string(), 0,
                std::string("cannot write to the output folder: ") +
                    std::strerror(errno),
                "a folder that can be written to");
  }
  staging_ = name;
  staging_descriptor_ = open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (staging_descriptor_ < 0) {
    const int error_number = errno;
    rmdir(name.c_str());
    throw Error(name, 0,
                std::string("cannot be opened: ") + std::strerror(error_number),
                "a folder that was made just now");
  }
  Lock(staging_descriptor_, /*wait=*/false);
  return staging_;
}

Error OutputFolder::InPlace(const Error& error) const {
  std::string message = error.what();
  const std::string from = staging_.string();
  const std::string to = folder_.string();
  if (from.empty()) return error;
  for (std::size_t i = message.find(from); i != std::string::npos;
       i = message.find(from, i + to.size())) {
    message.replace(i, from.size(), to);
  }
  const std::size_t colon = message.find(": ");
  if (colon == std::string::npos) return error;
  return Error(message.substr(0, colon), 0, message.substr(colon + 2), "");
}

std::vector<std::string> OutputFolder::Leftovers(
    const Manifest& old, const std::set<std::string>& staged,
    Changes* changes) const {
  std::vector<std::string> to_remove;
  for (const std::string& name : old.files) {
    if (own_names_.count(name) == 0 || staged.count(name) > 0) continue;
    const fs::path path = folder_ / name;
    std::error_code error;
    const fs::file_status status = fs::symlink_status(path, error);
    if (!fs::exists(status)) continue;
    const auto recorded = old.digests.find(name);
    if (!fs::is_regular_file(status)) {
      changes->kept.push_back(name + " (no regular file)");
    } else if (IsInput(path)) {
      changes->kept.push_back(name + " (read by this run)");
    } else if (recorded == old.digests.end()) {
      changes->kept.push_back(name +
                              " (written by a version that recorded no "
                              "digest)");
    } else if (recorded->second.count(Sha256OfFile(path.string())) == 0) {
      changes->kept.push_back(name + " (changed since it was written)");
    } else {
      to_remove.push_back(name);
    }
  }
  return to_remove;
}

OutputFolder::Changes OutputFolder::Clear() {
  Changes changes;
  {
    const LockedFolder lock(folder_);
    const fs::path summary = folder_ / kSummary;
    const Manifest old = ReadManifest(summary);
    if (old.files.empty()) return changes;
    changes.replaced_whole_run = old.is_whole;
    std::error_code error;
    for (const std::string& name : Leftovers(old, {}, &changes)) {
      if (fs::remove(folder_ / name, error)) changes.removed.push_back(name);
    }
    if (!changes.kept.empty() || IsInput(summary)) return changes;
    if (fs::remove(summary, error)) changes.removed.push_back(kSummary);
    lock.Sync();
  }
  // Fails while anything else is in there.
  rmdir(folder_.c_str());
  return changes;
}

OutputFolder::Changes OutputFolder::Commit(
    const std::map<std::string, std::string>& digests,
    const std::function<void()>& before_step) {
  const auto step = [&] {
    if (before_step) before_step();
  };
  std::vector<std::string> staged;
  std::set<std::string> staged_set;
  for (const auto& entry : fs::directory_iterator(staging())) {
    const std::string name = entry.path().filename().string();
    if (name == kMixedSummary) continue;
    staged_set.insert(name);
    if (name != kSummary) staged.push_back(name);
  }
  std::sort(staged.begin(), staged.end());
  staged.push_back(kSummary);

  const LockedFolder lock(folder_);
  CheckTargets(staged_set);
  const Manifest old = ReadManifest(folder_ / kSummary);
  Changes changes;
  changes.replaced_whole_run = old.is_whole;

  // Written beforehand, since a disk may be full.
  std::map<std::string, std::set<std::string>> all_digests = old.digests;
  std::set<std::string> all_files = old.files;
  for (const auto& [name, digest] : digests) all_digests[name].insert(digest);
  all_files.insert(staged.begin(), staged.end() - 1);
  Json mixed;
  mixed["partial"] = true;
  mixed["mixed"] =
      "a run ended while it put its files in place: some are its own, some of "
      "the run before";
  mixed["version"] = kVersion;
  mixed["files"] = all_files;
  mixed["sha256"] = all_digests;
  WriteFileAtomically(
      (staging_ / kMixedSummary).string(), [&](std::ostream& output) {
        output << mixed.dump(2, ' ', false, Json::error_handler_t::replace)
               << '\n';
      });

  // What goes is settled before anything changes.
  const std::vector<std::string> to_remove =
      Leftovers(old, staged_set, &changes);
  for (const std::string& name : staged_set) {
    std::error_code error;
    if (name != kSummary && old.files.count(name) == 0 &&
        fs::exists(folder_ / name, error)) {
      changes.replaced_foreign.push_back(name);
    }
  }

  step();
  if (!MoveFile(staging_ / kMixedSummary, folder_ / kSummary)) {
    FailToReplace(folder_ / kSummary, errno, "");
  }
  lock.Sync();
  for (const std::string& name : to_remove) {
    step();
    std::error_code error;
    if (fs::remove(folder_ / name, error)) changes.removed.push_back(name);
  }
  for (const std::string& name : staged) {
    // The summary says that all is there.
    if (name == kSummary) lock.Sync();
    step();
    if (!MoveFile(staging_ / name, folder_ / name)) {
      FailToReplace(folder_ / name, errno,
                    "; the folder holds files of two runs");
    }
  }
  lock.Sync();
  step();
  RemoveStaging();
  return changes;
}

}  // namespace plumbline
