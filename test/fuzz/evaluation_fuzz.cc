// Feeds arbitrary bytes to what plumbline_evaluate reads beside the small
// formats of texts_fuzz: trajectories of all kinds, grids and their pictures,
// rooms as traced by somebody, plans; and compares what they are with each
// other where it is small. Also to the key scans of an earlier map.

#include <plumbline/apps/evaluation/grid_file.h>
#include <plumbline/apps/evaluation/plan_evaluation.h>
#include <plumbline/apps/evaluation/traced_rooms.h>
#include <plumbline/apps/evaluation/trajectory_file.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/key_scan_archive.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>

#include "scratch_folder.h"

namespace {

// m; what is larger takes seconds to compare.
constexpr double kSmall = 8.0;

void Require(bool holds) {
  if (!holds) std::abort();
}

// What `read` gives, or nothing when it refuses.
template <typename Read>
auto Try(const Read& read) -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
    return std::nullopt;
  }
}

bool IsSmall(const plumbline::TracedRooms& rooms) {
  return std::hypot(rooms.width, rooms.height) * rooms.metres_per_pixel <
         kSmall;
}

bool IsSmall(const plumbline::SpaceGrid& grid) {
  return std::hypot(grid.width, grid.height) * grid.resolution < kSmall;
}

// Something free of 3 x 2 m.
plumbline::SpaceGrid FreeSpace() {
  plumbline::SpaceGrid grid;
  grid.resolution = 0.5;
  grid.width = 6;
  grid.height = 4;
  grid.cells.assign(24, plumbline::Space::kFree);
  return grid;
}

plumbline::TracedRooms Room() {
  plumbline::TracedRooms rooms;
  rooms.metres_per_pixel = 0.5;
  rooms.width = 6;
  rooms.height = 4;
  rooms.count = 1;
  rooms.labels.assign(24, 1);
  return rooms;
}

void Compare(const plumbline::BuildingPlan& plan,
             const plumbline::TracedRooms& rooms,
             const plumbline::SpaceGrid& grid) {
  const auto result =
      Try([&] { return plumbline::EvaluateTracedRooms(plan, rooms, grid); });
  Require(!result || (std::isfinite(result->mean_iou) &&
                      result->placement.center.allFinite()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  using plumbline::InputStream;
  const std::string text(reinterpret_cast<const char*>(data), size);
  static const plumbline::ScratchFolder folder("evaluation");
  static const std::string picture = folder.Write("picture.yaml",
                                                  "image: file\n"
                                                  "resolution: 0.1\n"
                                                  "origin: [0, 0, 0]\n");
  [[maybe_unused]] static const std::string named =
      folder.Write("picture", std::string("P5 2 2 255\n") + "\xfe\xfe\xfe\xfe");
  const std::string path = folder.Write("file", text);

  if (const auto trajectory =
          Try([&] { return plumbline::ReadTrajectory(path); })) {
    for (const plumbline::TimedPose& pose : plumbline::InPlane(*trajectory)) {
      Require(pose.pose.allFinite());
    }
  }
  Try([&] { return plumbline::ReadKeyScans(text, "fuzz"); });
  const auto plan = Try([&] {
    InputStream input("fuzz", text);
    return plumbline::ReadBuildingPlan(&input);
  });
  if (plan) {
    plumbline::MapTruth truth;
    truth.walls.resize(1);
    truth.walls[0].end = {3.0, 0.0};
    truth.walls[0].seen = {{0.0, 3.0}};
    Try([&] {
      return plumbline::EvaluatePlan(*plan, truth, plumbline::Pose2::Zero());
    });
    Compare(*plan, Room(), FreeSpace());
  }
  const auto rooms = Try([&] {
    InputStream input("fuzz", text);
    return plumbline::ReadTracedRooms(&input);
  });
  if (rooms && IsSmall(*rooms)) Compare({}, *rooms, FreeSpace());
  for (const std::string& yaml : {path, picture}) {
    const auto grid = Try([&] { return plumbline::ReadSpaceGrid(yaml); });
    if (grid && IsSmall(*grid)) Compare({}, Room(), *grid);
  }
  return 0;
}
