#include <plumbline/apps/evaluation/grid_file.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/input_stream.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <vector>

namespace plumbline {
namespace {

// Pixels and metres beyond which a map is garbage.
constexpr std::int64_t kMostPixels = std::int64_t{1} << 28;
constexpr double kFarthest = 1e7;

struct MapYaml {
  std::string image;
  double resolution = 0.0;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  bool has_origin = false;
  bool negate = false;
  // Defaults of map_server.
  double occupied_threshold = 0.65;
  double free_threshold = 0.196;
};

std::string Trimmed(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text[0])))
    text.remove_prefix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())))
    text.remove_suffix(1);
  return std::string(text);
}

// Numbers separated by commas, in brackets or not; empty for anything else.
std::vector<double> Numbers(std::string text) {
  if (text.size() >= 2 && text.front() == '[' && text.back() == ']')
    text = text.substr(1, text.size() - 2);
  std::vector<double> numbers;
  const char* at = text.c_str();
  for (;;) {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (end == at || !(std::abs(value) <= kFarthest)) return {};
    numbers.push_back(value);
    at = end;
    while (std::isspace(static_cast<unsigned char>(*at))) ++at;
    if (*at == '\0') return numbers;
    if (*at++ != ',') return {};
  }
}

MapYaml ReadYaml(const std::string& path) {
  InputStream input(path);
  MapYaml yaml;
  std::string_view line;
  while (input.ReadLine(&line)) {
    const auto colon = line.find(':');
    if (colon == std::string_view::npos) continue;
    const std::string key = Trimmed(line.substr(0, colon));
    const std::string value = Trimmed(line.substr(colon + 1));
    const auto refuse = [&](const std::string& expected) {
      throw Error(path, input.line_number(), "'" + key + "' is wrong",
                  expected);
    };
    const auto number = [&](double low, double high) {
      const std::vector<double> numbers = Numbers(value);
      if (numbers.size() != 1 || !(numbers[0] >= low && numbers[0] <= high)) {
        refuse("a number from " + std::to_string(low) + " to " +
               std::to_string(high));
      }
      return numbers[0];
    };
    if (key == "image") {
      yaml.image = value;
    } else if (key == "resolution") {
      yaml.resolution = number(1e-3, 10.0);
    } else if (key == "origin") {
      const std::vector<double> numbers = Numbers(value);
      if (numbers.size() != 3 || numbers[2] != 0.0) refuse("[x, y, 0], in m");
      yaml.origin = {numbers[0], numbers[1]};
      yaml.has_origin = true;
    } else if (key == "negate") {
      yaml.negate = number(0.0, 1.0) != 0.0;
    } else if (key == "occupied_thresh") {
      yaml.occupied_threshold = number(0.0, 1.0);
    } else if (key == "free_thresh") {
      yaml.free_threshold = number(0.0, 1.0);
    }
  }
  if (yaml.image.empty() || yaml.resolution == 0.0 || !yaml.has_origin) {
    throw Error(path, 0, "is no map of map_server",
                "image, resolution and origin: occupancy.yaml of a solve");
  }
  return yaml;
}

// Takes the next number of a PGM's header.
int HeaderNumber(const std::string& path, const std::string& bytes,
                 std::size_t* at) {
  for (;;) {
    while (*at < bytes.size() &&
           std::isspace(static_cast<unsigned char>(bytes[*at]))) {
      ++*at;
    }
    if (*at >= bytes.size() || bytes[*at] != '#') break;
    while (*at < bytes.size() && bytes[*at] != '\n') ++*at;
  }
  std::int64_t value = -1;
  while (*at < bytes.size() &&
         std::isdigit(static_cast<unsigned char>(bytes[*at])) &&
         value < kMostPixels) {
    value = 10 * std::max<std::int64_t>(value, 0) + (bytes[(*at)++] - '0');
  }
  if (value <= 0 || value > kMostPixels) {
    throw Error(path, 0, "has no width, height and maximum",
                "a binary PGM (P5)");
  }
  return static_cast<int>(value);
}

}  // namespace

SpaceGrid ReadSpaceGrid(const std::string& yaml_path) {
  const MapYaml yaml = ReadYaml(yaml_path);
  const std::string path =
      (std::filesystem::path(yaml_path).parent_path() / yaml.image).string();
  InputStream input(path);
  const std::string bytes = input.ReadRest();
  if (bytes.substr(0, 2) != "P5")
    throw Error(path, 0, "is no PGM", "a binary PGM (P5)");
  std::size_t at = 2;
  SpaceGrid grid;
  grid.resolution = yaml.resolution;
  grid.origin = yaml.origin;
  grid.width = HeaderNumber(path, bytes, &at);
  grid.height = HeaderNumber(path, bytes, &at);
  const int maximum = HeaderNumber(path, bytes, &at);
  ++at;
  const std::int64_t size = std::int64_t{1} * grid.width * grid.height;
  if (maximum > 255 || size > kMostPixels ||
      static_cast<std::int64_t>(bytes.size()) - static_cast<std::int64_t>(at) <
          size) {
    throw Error(path, 0,
                "ends early or is no picture of " + std::to_string(grid.width) +
                    " x " + std::to_string(grid.height) + " bytes",
                "a byte a pixel");
  }
  grid.cells.resize(static_cast<std::size_t>(size));
  for (int row = 0; row < grid.height; ++row) {
    // Pictures begin at the top.
    const std::size_t line =
        at + static_cast<std::size_t>(grid.height - 1 - row) * grid.width;
    for (int column = 0; column < grid.width; ++column) {
      const double level = static_cast<unsigned char>(bytes[line + column]) /
                           static_cast<double>(maximum);
      const double occupied = yaml.negate ? level : 1.0 - level;
      grid.cells[static_cast<std::size_t>(row) * grid.width + column] =
          occupied > yaml.occupied_threshold ? Space::kOccupied
          : occupied < yaml.free_threshold   ? Space::kFree
                                             : Space::kUnknown;
    }
  }
  return grid;
}

}  // namespace plumbline
