#include <plumbline/apps/evaluation/map_truth.h>
#include <plumbline/core/error.h>
#include <plumbline/core/utf8.h>
#include <plumbline/core/wall.h>
#include <plumbline/detectors/same_wall.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

namespace plumbline {
namespace {

using Json = nlohmann::json;

// Coordinates beyond it are garbage, m.
constexpr double kAbsurdCoordinate = 1e7;
// Bytes; a JSON document takes several times as much memory.
constexpr std::size_t kLargestJson = std::size_t{1} << 28;

// A value of a JSON document with the way to it, for messages.
class Entry {
 public:
  Entry(const std::string& file, const Json& json, std::string path)
      : file_(file), json_(json), path_(std::move(path)) {}

  Entry operator[](const std::string& key) const {
    const std::string path = path_.empty() ? key : path_ + "." + key;
    if (!json_.is_object()) Refuse("is no object", "an object");
    const auto found = json_.find(key);
    if (found == json_.end())
      throw Error(file_, 0, "'" + path + "' is missing", "a value");
    return Entry(file_, *found, path);
  }

  bool Has(const std::string& key) const {
    return json_.is_object() && json_.contains(key);
  }

  std::vector<Entry> Elements() const {
    if (!json_.is_array()) Refuse("is no array", "an array");
    std::vector<Entry> elements;
    elements.reserve(json_.size());
    for (std::size_t i = 0; i < json_.size(); ++i)
      elements.emplace_back(file_, json_[i],
                            path_ + "[" + std::to_string(i) + "]");
    return elements;
  }

  // An array of `count` numbers.
  std::vector<double> Numbers(std::size_t count) const {
    const std::vector<Entry> elements = Elements();
    if (elements.size() != count) {
      Refuse("has " + std::to_string(elements.size()) + " elements",
             std::to_string(count) + " numbers");
    }
    std::vector<double> numbers;
    for (const Entry& element : elements) numbers.push_back(element.Number());
    return numbers;
  }

  double Number() const {
    if (!json_.is_number()) Refuse("is no number", "a number");
    const double value = json_.get<double>();
    if (!std::isfinite(value)) Refuse("is not finite", "a finite number");
    return value;
  }

  // A length or coordinate, m.
  double Metres() const {
    const double value = Number();
    if (std::abs(value) > kAbsurdCoordinate)
      Refuse("is absurd", "metres within 1e7");
    return value;
  }

  std::int64_t Integer() const {
    if (!json_.is_number_integer()) Refuse("is no integer", "an integer");
    return json_.get<std::int64_t>();
  }

  std::string Text() const {
    if (!json_.is_string()) Refuse("is no text", "a text");
    return json_.get<std::string>();
  }

  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(
        file_, 0,
        (path_.empty() ? "the document" : "'" + path_ + "'") + " " + what,
        expected);
  }

 private:
  const std::string& file_;
  const Json& json_;
  std::string path_;
};

// Closures of a map.json; one that names no segment of the map is refused.
void ReadClosures(const Entry& root, StraightMap* map) {
  if (!root.Has("constraints")) return;
  std::set<std::int64_t> segments;
  for (const MapSegment& segment : map->segments) segments.insert(segment.id);
  for (const Entry& entry : root["constraints"].Elements()) {
    if (entry["type"].Text() != kSameWallRelation) continue;
    const std::vector<Entry> features = entry["features"].Elements();
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

Json ParseJson(InputStream* input, const std::string& expected) {
  const std::string text = input->ReadRest(kLargestJson);
  if (!input->damage().empty())
    throw Error(input->name(), 0, input->damage(), "a whole file");
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    const std::size_t place = std::min<std::size_t>(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + place, '\n');
    throw Error(input->name(), static_cast<int>(line), "is no valid JSON",
                expected);
  } catch (const Json::out_of_range& error) {
    // "... number overflow parsing '1e400'"
    const std::string what = error.what();
    const std::size_t quote = what.find('\'');
    const std::string number =
        quote == std::string::npos
            ? ""
            : what.substr(quote + 1, what.rfind('\'') - quote - 1);
    const std::size_t place = std::min(text.find(number), text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + place, '\n');
    throw Error(
        input->name(), static_cast<int>(line),
        PrintableUtf8(number.substr(0, 40)) + " is too large for a number",
        "numbers up to 1.8e308");
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
  const Entry root(input->name(), json, "");
  if (!root.Has("format") || root["format"].Text() != "plumbline-truth")
    root.Refuse("is no truth file", expected);
  if (root["version"].Integer() != 1) {
    root["version"].Refuse("is " + std::to_string(root["version"].Integer()),
                           "1");
  }
  MapTruth truth;
  truth.name = input->name();
  for (const Entry& degrees : root["orientations_deg"].Elements())
    truth.orientations_deg.push_back(degrees.Number());
  for (const Entry& entry : root["walls"].Elements()) {
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
    for (const Entry& seen : entry["seen"].Elements()) {
      const std::vector<double> ends = seen.Numbers(2);
      if (ends[1] < ends[0])
        seen.Refuse("ends before it begins", "[begin, end]");
      wall.seen.emplace_back(ends[0], ends[1]);
    }
    truth.walls.push_back(wall);
  }
  for (const Entry& entry : root["poses"].Elements()) {
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
  const Entry root(input->name(), json, "");
  if (!root.Has("features"))
    root.Refuse("has no features", "a map.json of plumbline_solve");
  StraightMap map;
  for (const Entry& entry : root["features"].Elements()) {
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
