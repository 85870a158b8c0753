#include <plumbline/apps/evaluation/json_entry.h>
#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/core/error.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/same_wall.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

namespace plumbline {
namespace {

using Json = nlohmann::json;

// Closures of a map.json; one that names no segment of the map is refused.
void ReadClosures(const JsonEntry& root, StraightMap* map) {
  if (!root.Has("constraints")) return;
  std::set<std::int64_t> segments;
  for (const MapSegment& segment : map->segments) segments.insert(segment.id);
  for (const JsonEntry& entry : root["constraints"].Elements()) {
    if (entry["type"].Text() != kSameWallRelation) continue;
    const std::vector<JsonEntry> features = entry["features"].Elements();
    if (features.size() != 2) {
      entry["features"].Refuse("does not have 2 elements", "two segments");
    }
    MapClosure closure;
    closure.first = features[0].Integer();
    closure.second = features[1].Integer();
    closure.is_live = entry["state"].Text() == "live";
    for (const std::int64_t id : {closure.first, closure.second}) {
      if (segments.count(id) == 0) {
        entry["features"].Refuse("names " + std::to_string(id),
                                 "segments of the map");
      }
    }
    map->closures.push_back(closure);
  }
}

}  // namespace

MapTruth ReadMapTruth(const std::string& path) {
  InputStream input(path);
  return ReadMapTruth(&input);
}

MapTruth ReadMapTruth(InputStream* input) {
  const std::string expected = "a truth file of plumbline_simulate";
  const Json json = ParseJson(input, expected);
  const JsonEntry root(input->name(), json, "");
  if (!root.Has("format") || root["format"].Text() != "plumbline-truth")
    root.Refuse("is no truth file", expected);
  if (root["version"].Integer() != 1) {
    root["version"].Refuse("is " + std::to_string(root["version"].Integer()),
                           "1");
  }
  MapTruth truth;
  truth.name = input->name();
  for (const JsonEntry& degrees : root["orientations_deg"].Elements())
    truth.orientations_deg.push_back(degrees.Number());
  for (const JsonEntry& entry : root["walls"].Elements()) {
    TruthWall wall;
    wall.id = static_cast<int>(entry["id"].Integer());
    wall.begin = {entry["x1"].Metres(), entry["y1"].Metres()};
    wall.end = {entry["x2"].Metres(), entry["y2"].Metres()};
    const std::int64_t orientation = entry["orientation"].Integer();
    if (orientation < -1 || orientation >= static_cast<std::int64_t>(
                                               truth.orientations_deg.size())) {
      entry["orientation"].Refuse("is no index into orientations_deg",
                                  "an index or -1");
    }
    wall.orientation = static_cast<int>(orientation);
    for (const JsonEntry& seen : entry["seen"].Elements()) {
      const std::vector<double> ends = seen.Numbers(2);
      if (ends[1] < ends[0])
        seen.Refuse("ends before it begins", "[begin, end]");
      wall.seen.emplace_back(ends[0], ends[1]);
    }
    truth.walls.push_back(wall);
  }
  // Truths of older versions have neither rooms nor doors.
  if (root.Has("rooms")) {
    for (const JsonEntry& entry : root["rooms"].Elements()) {
      truth.rooms.push_back(entry["outline"].ReadPolygon());
    }
  }
  if (root.Has("doors")) {
    for (const JsonEntry& entry : root["doors"].Elements()) {
      TrueDoor door;
      door.begin = {entry["x1"].Metres(), entry["y1"].Metres()};
      door.end = {entry["x2"].Metres(), entry["y2"].Metres()};
      door.thickness = entry["thickness"].Metres();
      door.is_shut = entry["shut"].Flag();
      truth.doors.push_back(door);
    }
  }
  for (const JsonEntry& entry : root["poses"].Elements()) {
    const std::vector<double> numbers = entry.Numbers(4);
    TimedPose timed;
    timed.timestamp = numbers[0];
    timed.pose = Pose2(numbers[1], numbers[2], numbers[3]);
    if (timed.pose.cwiseAbs().maxCoeff() > kAbsurdCoordinate)
      entry.Refuse("is absurd", "metres and radians within 1e7");
    truth.poses.push_back(timed);
  }
  return truth;
}

StraightMap ReadStraightMap(const std::string& path) {
  InputStream input(path);
  return ReadStraightMap(&input);
}

StraightMap ReadStraightMap(InputStream* input) {
  const Json json = ParseJson(input, "a map.json of plumbline_solve");
  const JsonEntry root(input->name(), json, "");
  if (!root.Has("features"))
    root.Refuse("has no features", "a map.json of plumbline_solve");
  StraightMap map;
  for (const JsonEntry& entry : root["features"].Elements()) {
    const std::string type = entry["type"].Text();
    if (type == "orientation") {
      MapOrientation orientation;
      orientation.id = entry["id"].Integer();
      orientation.angle = entry["parameters"].Numbers(1)[0];
      map.orientations.push_back(orientation);
      continue;
    }
    if (type != "segment" && type != "line") continue;
    MapSegment segment;
    segment.id = entry["id"].Integer();
    if (type == "segment") {
      const std::vector<double> p = entry["parameters"].Numbers(3);
      segment.pose = Pose2(p[0], p[1], p[2]);
    } else {
      const std::vector<double> p = entry["parameters"].Numbers(2);
      const std::vector<double> anchor = entry["anchor"].Numbers(2);
      const Eigen::Vector2d foot =
          FootPoint({anchor[0], anchor[1]}, p[0], p[1]);
      segment.pose = Pose2(foot.x(), foot.y(), p[1]);
    }
    const std::vector<double> extent = entry["extent"].Numbers(2);
    segment.begin = std::min(extent[0], extent[1]);
    segment.end = std::max(extent[0], extent[1]);
    if (segment.pose.cwiseAbs().maxCoeff() > kAbsurdCoordinate ||
        segment.end - segment.begin > 1e5)
      entry.Refuse("is absurd", "metres");
    map.segments.push_back(segment);
  }
  ReadClosures(root, &map);
  return map;
}

}  // namespace plumbline
