#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/solve/run_identity.h>
#include <plumbline/apps/solve_flags.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/version.h>
#include <sys/stat.h>

#include <cstddef>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace plumbline {
namespace {

// Everything that a log is solved from, as one number.
std::string DigestOf(const Log& log) {
  Sha256 sha;
  const auto take = [&sha](const void* data, std::size_t size) {
    sha.Update(std::string_view(static_cast<const char*>(data), size));
  };
  for (const Scan& scan : log.scans) {
    const double numbers[] = {
        scan.timestamp,       scan.odometry[0],        scan.odometry[1],
        scan.odometry[2],     scan.laser_offset[0],    scan.laser_offset[1],
        scan.laser_offset[2], scan.start_angle,        scan.angle_step,
        scan.maximum_range,   1.0 * scan.ranges.size()};
    take(numbers, sizeof numbers);
    take(scan.ranges.data(), scan.ranges.size() * sizeof(float));
    take(scan.bearings.data(), scan.bearings.size() * sizeof(float));
    sha.Update(scan.timestamp_text);
  }
  return sha.HexDigest();
}

}  // namespace

CheckpointFile::Identity IdentityOfRun(const Log& log) {
  CheckpointFile::Identity identity;
  // A state is memory of this program, which nobody else is to write: whoever
  // sends a folder with one does not know what the folder will be here.
  struct stat folder = {};
  stat(FLAGS_output_dir.c_str(), &folder);
  identity["the folder's inode"] = std::to_string(folder.st_ino);
  identity["the version"] = kVersion;
  identity["the program's digest"] = Sha256OfFile("/proc/self/exe");
  identity["the input's digest"] = DigestOf(log);
  std::istringstream plugins(FLAGS_plugins);
  std::string plugin;
  while (std::getline(plugins, plugin, ',')) {
    identity["the digest of " + plugin] = Sha256OfFile(plugin);
  }
  for (const auto& [what, file] :
       {std::make_pair("the structure prior's digest", &FLAGS_structure_prior),
        std::make_pair("the plan's digest", &FLAGS_plan),
        std::make_pair("the digest of the constraints", &FLAGS_constraints)}) {
    if (!file->empty()) identity[what] = Sha256OfFile(*file);
  }
  const std::set<std::string> without_effect = {"input",
                                                "output_dir",
                                                "outputs",
                                                "marginals",
                                                "verbose",
                                                "quiet",
                                                "live_dir",
                                                "live_every",
                                                "checkpoint_every",
                                                "num_threads",
                                                "marginals_hold_gauge",
                                                "help_format",
                                                "ellipse_sigmas",
                                                "grid_resolution"};
  for (const FlagValue& flag : OwnFlags()) {
    if (without_effect.count(flag.name) == 0) {
      identity["--" + flag.name] = flag.value;
    }
  }
  return identity;
}

}  // namespace plumbline
