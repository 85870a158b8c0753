#include <plumbline/apps/simulation/world_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/utf8.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Of a building, and of the way through it.
constexpr double kAbsurdNumber = 1e5;

// Whole text as a number, or false.
bool ParseNumber(const std::string& text, double* value) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end && std::isfinite(*value);
}

// Reads a world line by line; the doors are cut once all walls are there.
class WorldReader {
 public:
  explicit WorldReader(const std::string& name) { world_.name = name; }

  World Read(std::istream& input) {
    std::string text;
    while (std::getline(input, text)) {
      ++line_;
      ReadLine(text.substr(0, text.find('#')));
    }
    if (input.bad()) throw Error(world_.name, line_, "reading failed", "");
    for (const Door& door : doors_) {
      if (CutDoor(door.position, door.width, &world_) == 0) {
        throw Error(world_.name, door.line, "the door is in no wall",
                    "a position inside a wall");
      }
    }
    return std::move(world_);
  }

 private:
  struct Door {
    Vector2d position;
    double width;
    int line;
  };

  void ReadLine(const std::string& text) {
    std::istringstream words(text);
    if (!(words >> keyword_)) return;
    values_.clear();
    for (std::string word; words >> word;) {
      double value = 0.0;
      if (!ParseNumber(word, &value)) {
        throw Error(world_.name, line_,
                    "'" + PrintableUtf8(word) + "' is not a number",
                    "a finite number");
      }
      if (std::abs(value) > kAbsurdNumber) {
        throw Error(world_.name, line_,
                    "'" + PrintableUtf8(word) + "' is absurd",
                    "metres and degrees within 1e5");
      }
      values_.push_back(value);
    }
    static const std::map<std::string, void (WorldReader::*)()> readers = {
        {"wall", &WorldReader::ReadWall},
        {"door", &WorldReader::ReadDoor},
        {"doorway", &WorldReader::ReadDoorway},
        {"opening", &WorldReader::ReadDoorway},
        {"circle", &WorldReader::ReadCircle},
        {"arc", &WorldReader::ReadArc},
        {"box", &WorldReader::ReadBox},
        {"path", &WorldReader::ReadPath}};
    const auto reader = readers.find(keyword_);
    if (reader == readers.end()) {
      throw Error(world_.name, line_,
                  "'" + PrintableUtf8(keyword_) + "' is unknown",
                  "wall, door, doorway, opening, circle, arc, box or path");
    }
    (this->*reader->second)();
  }

  void Require(bool holds, const std::string& expected) const {
    if (holds) return;
    throw Error(world_.name, line_, "bad '" + keyword_ + "'", expected);
  }

  Vector2d Point(std::size_t first) const {
    return {values_[first], values_[first + 1]};
  }

  void ReadWall() {
    Require(values_.size() == 4 || values_.size() == 5,
            "wall x1 y1 x2 y2 [thickness]");
    const WorldWall wall{Point(0), Point(2),
                         values_.size() == 5 ? values_[4] : 0.0};
    Require((wall.end - wall.begin).norm() > 0.0 && wall.thickness >= 0.0,
            "two different points and a thickness of at least 0");
    world_.walls.push_back(wall);
  }

  void ReadDoor() {
    Require(values_.size() == 3 && values_[2] > 0.0,
            "door x y width with a width above 0");
    doors_.push_back({Point(0), values_[2], line_});
  }

  void ReadDoorway() {
    Require(values_.size() == 4 || values_.size() == 5,
            keyword_ + " x1 y1 x2 y2 [thickness]");
    WorldDoor door;
    door.is_opening = keyword_ == "opening";
    door.begin = Point(0);
    door.end = Point(2);
    door.thickness = values_.size() == 5 ? values_[4] : 0.0;
    Require((door.end - door.begin).norm() > 0.0 && door.thickness >= 0.0,
            "two different points and a thickness of at least 0");
    world_.doors.push_back(door);
  }

  void ReadCircle() {
    Require(values_.size() == 3 && values_[2] > 0.0,
            "circle x y radius with a radius above 0");
    world_.circles.push_back({Point(0), values_[2], 0.0, 360.0});
  }

  void ReadArc() {
    Require(values_.size() == 5 && values_[2] > 0.0 &&
                values_[4] > values_[3] && values_[4] - values_[3] <= 360.0,
            "arc x y radius begin_deg end_deg with a radius above 0 and an "
            "end at most 360 degrees after the begin");
    world_.circles.push_back(
        {Point(0), values_[2], values_[3], values_[4] - values_[3]});
  }

  void ReadBox() {
    Require(values_.size() == 5 && values_[2] > 0.0 && values_[3] > 0.0,
            "box x y length width angle_deg with sides above 0");
    world_.boxes.push_back({Point(0), values_[2], values_[3], values_[4]});
  }

  void ReadPath() {
    Require(!values_.empty() && values_.size() % 2 == 0,
            "path x1 y1 [x2 y2 ...]");
    for (std::size_t i = 0; i < values_.size(); i += 2) {
      world_.path.push_back(Point(i));
    }
  }

  World world_;
  std::vector<Door> doors_;
  // The line that is being read.
  int line_ = 0;
  std::string keyword_;
  std::vector<double> values_;
};

}  // namespace

World ReadWorld(std::istream& input, const std::string& name) {
  return WorldReader(name).Read(input);
}

void WriteWorld(const World& world, std::ostream& output) {
  const auto write = [&output](const char* keyword,
                               const std::vector<double>& values) {
    output << keyword;
    for (const double value : values) {
      char text[64];
      std::snprintf(text, sizeof(text), " %.6f", value);
      output << text;
    }
    output << '\n';
  };
  for (const WorldWall& wall : world.walls) {
    write("wall", {wall.begin.x(), wall.begin.y(), wall.end.x(), wall.end.y(),
                   wall.thickness});
  }
  for (const WorldDoor& door : world.doors) {
    write(door.is_opening ? "opening" : "doorway",
          {door.begin.x(), door.begin.y(), door.end.x(), door.end.y(),
           door.thickness});
  }
  for (const WorldCircle& c : world.circles) {
    if (c.sweep_deg >= 360.0) {
      write("circle", {c.center.x(), c.center.y(), c.radius});
    } else {
      write("arc", {c.center.x(), c.center.y(), c.radius, c.begin_deg,
                    c.begin_deg + c.sweep_deg});
    }
  }
  for (const WorldBox& box : world.boxes) {
    write("box", {box.center.x(), box.center.y(), box.length, box.width,
                  box.angle_deg});
  }
  for (const Vector2d& point : world.path) {
    write("path", {point.x(), point.y()});
  }
}

}  // namespace plumbline
