#include <plumbline/apps/evaluation/json_entry.h>
#include <plumbline/apps/evaluation/traced_rooms.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <unsupported/Eigen/FFT>

namespace plumbline {
namespace {

using Eigen::Vector2d;

constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;
constexpr double kFoundIou = 0.5;
constexpr double kSeen = 0.6;
// Raster of the comparison, and of the search before, m.
constexpr double kCell = 0.1;
constexpr double kMiddleCell = 0.2;
constexpr double kCoarseCell = 0.4;
// Cells of the search everywhere, which takes as many numbers a hundred times
// over: a square of 300 m with rooms of the same size.
constexpr double kMostCells = 1 << 22;
// Pairs of a traced room and one of the plan.
constexpr double kMostPairs = 1 << 26;
// What of a room of the plan lies in rooms seen, m^2, to be judged.
constexpr double kLeastJudged = 1.0;

// Shares of cells, row by row.
struct Raster {
  int width = 0;
  int height = 0;
  std::vector<float> cells;

  Raster(int w, int h)
      : width(w), height(h), cells(static_cast<std::size_t>(w) * h, 0.0f) {}
  float& At(int column, int row) {
    return cells[static_cast<std::size_t>(row) * width + column];
  }
  double Sum() const {
    double sum = 0.0;
    for (const float cell : cells) sum += cell;
    return sum;
  }
};

// What was seen free, from the grid's corner on.
Raster FreeRaster(const SpaceGrid& space, double cell) {
  const double by = space.resolution / cell;
  Raster raster(static_cast<int>(space.width * by) + 1,
                static_cast<int>(space.height * by) + 1);
  for (int row = 0; row < space.height; ++row) {
    for (int column = 0; column < space.width; ++column) {
      if (space.At(column, row) != Space::kFree) continue;
      raster.At(static_cast<int>((column + 0.5) * by),
                static_cast<int>((row + 0.5) * by)) +=
          static_cast<float>(by * by);
    }
  }
  return raster;
}

// The rooms as one mask about the middle of its raster.
Raster MaskRaster(const TracedRooms& rooms, double turn, double scale,
                  double cell) {
  const double by = rooms.metres_per_pixel * scale / cell;
  const int half =
      static_cast<int>(0.5 * by * std::hypot(rooms.width, rooms.height)) + 2;
  Raster raster(2 * half + 1, 2 * half + 1);
  const double cosine = by * std::cos(turn);
  const double sine = by * std::sin(turn);
  // Pixels larger than cells are taken in parts.
  const int parts = std::max(1, static_cast<int>(std::ceil(2.0 * by)));
  const auto weight = static_cast<float>(by * by / (parts * parts));
  for (int row = 0; row < rooms.height; ++row) {
    for (int column = 0; column < rooms.width; ++column) {
      if (rooms.labels[static_cast<std::size_t>(row) * rooms.width + column] ==
          0) {
        continue;
      }
      for (int part = 0; part < parts * parts; ++part) {
        const double x =
            column + (part % parts + 0.5) / parts - 0.5 * rooms.width;
        const double y =
            row + (part / parts + 0.5) / parts - 0.5 * rooms.height;
        raster.At(
            half + static_cast<int>(std::lround(cosine * x - sine * y)),
            half + static_cast<int>(std::lround(sine * x + cosine * y))) +=
            weight;
      }
    }
  }
  return raster;
}

// A place for the mask: of its middle, in cells of the free raster.
struct Place {
  double turn = 0.0;
  double scale = 1.0;
  int column = 0;
  int row = 0;
  double overlap = -1.0;
};

int PowerOfTwo(int least) {
  int size = 1;
  while (size < least) size *= 2;
  return size;
}

// Refuses what would take all memory, or hours.
void CheckSizes(const TracedRooms& rooms, const SpaceGrid& space) {
  const double margin =
      std::hypot(rooms.width, rooms.height) * rooms.metres_per_pixel;
  double cells = 1.0;
  for (const int side : {space.width, space.height}) {
    const double needed = (side * space.resolution + margin) / kCoarseCell;
    cells *= needed > kMostCells ? kMostCells + 1.0
                                 : PowerOfTwo(static_cast<int>(needed) + 8);
  }
  if (cells <= kMostCells) return;
  char sizes[120];
  std::snprintf(sizes, sizeof(sizes),
                "is %.0f x %.0f m large and the picture of the rooms %.0f x "
                "%.0f m",
                space.width * space.resolution, space.height * space.resolution,
                rooms.width * rooms.metres_per_pixel,
                rooms.height * rooms.metres_per_pixel);
  throw PLUMBLINE_ERROR(sizes, "a building of up to 300 m");
}

// Cross-correlation with one raster, by Fourier transforms.
class Correlation {
 public:
  // `margin`: how far the middle of the other raster may lie beyond this one.
  Correlation(const Raster& raster, int margin)
      : margin_(margin),
        width_(PowerOfTwo(raster.width + 2 * margin)),
        height_(PowerOfTwo(raster.height + 2 * margin)),
        spectrum_(Transformed(raster)) {}

  // The best place of a mask, and its product with the raster there.
  Place Best(const Raster& mask, int columns, int rows, double* product) {
    std::vector<Complex> other = Transformed(mask);
    for (std::size_t i = 0; i < other.size(); ++i) {
      other[i] = spectrum_[i] * std::conj(other[i]);
    }
    Transform(false, &other);
    Place best;
    *product = -1.0;
    const int half = mask.width / 2;
    for (int row = -margin_; row < rows + margin_; ++row) {
      for (int column = -margin_; column < columns + margin_; ++column) {
        // The mask's corner.
        const int x = ((column - half) % width_ + width_) % width_;
        const int y = ((row - half) % height_ + height_) % height_;
        const double value =
            other[static_cast<std::size_t>(y) * width_ + x].real();
        // The first of equals, in spite of rounding.
        if (value <= *product + 1e-6) continue;
        *product = value;
        best.column = column;
        best.row = row;
      }
    }
    return best;
  }

 private:
  using Complex = std::complex<double>;

  std::vector<Complex> Transformed(const Raster& raster) {
    std::vector<Complex> values(static_cast<std::size_t>(width_) * height_);
    for (int row = 0; row < raster.height; ++row) {
      for (int column = 0; column < raster.width; ++column) {
        values[static_cast<std::size_t>(row) * width_ + column] =
            raster.cells[static_cast<std::size_t>(row) * raster.width + column];
      }
    }
    Transform(true, &values);
    return values;
  }

  // In place, rows and then columns.
  void Transform(bool is_forward, std::vector<Complex>* values) {
    const auto run = [&](int count, int stride, std::size_t begin) {
      std::vector<Complex> in(static_cast<std::size_t>(count));
      for (int i = 0; i < count; ++i) {
        in[static_cast<std::size_t>(i)] =
            (*values)[begin + static_cast<std::size_t>(i) * stride];
      }
      std::vector<Complex> out(in.size());
      if (is_forward) {
        fft_.fwd(out.data(), in.data(), count);
      } else {
        fft_.inv(out.data(), in.data(), count);
      }
      for (int i = 0; i < count; ++i) {
        (*values)[begin + static_cast<std::size_t>(i) * stride] =
            out[static_cast<std::size_t>(i)];
      }
    };
    for (int row = 0; row < height_; ++row)
      run(width_, 1, static_cast<std::size_t>(row) * width_);
    for (int column = 0; column < width_; ++column)
      run(height_, width_, static_cast<std::size_t>(column));
  }

  int margin_;
  int width_;
  int height_;
  Eigen::FFT<double> fft_;
  std::vector<Complex> spectrum_;
};

double Dice(double common, double a, double b) {
  return a + b > 0.0 ? 2.0 * common / (a + b) : 0.0;
}

// All turns and places at the scale that the truth claims.
Place SearchEverywhere(const TracedRooms& rooms, const SpaceGrid& space) {
  const Raster free = FreeRaster(space, kCoarseCell);
  const double free_sum = free.Sum();
  const int half = MaskRaster(rooms, 0.0, 1.0, kCoarseCell).width / 2;
  Correlation correlation(free, half + 1);
  Place best;
  for (int degrees = 0; degrees < 360; degrees += 3) {
    const double turn = DegToRad(static_cast<double>(degrees));
    const Raster mask = MaskRaster(rooms, turn, 1.0, kCoarseCell);
    double common = 0.0;
    Place place = correlation.Best(mask, free.width, free.height, &common);
    place.turn = turn;
    place.overlap = Dice(common, mask.Sum(), free_sum);
    if (place.overlap > best.overlap) best = place;
  }
  return best;
}

// Turns and scales around a place, and places within `window` cells of it.
Place SearchAround(const TracedRooms& rooms, const SpaceGrid& space,
                   const Place& around, double cell,
                   const std::vector<double>& turns,
                   const std::vector<double>& scales, int window) {
  Raster free = FreeRaster(space, cell);
  const double free_sum = free.Sum();
  Place best;
  for (const double scale : scales) {
    for (const double turn : turns) {
      Raster mask =
          MaskRaster(rooms, around.turn + turn, around.scale + scale, cell);
      const double mask_sum = mask.Sum();
      const int half = mask.width / 2;
      for (int dy = -window; dy <= window; ++dy) {
        for (int dx = -window; dx <= window; ++dx) {
          const int left = around.column + dx - half;
          const int low = around.row + dy - half;
          double common = 0.0;
          for (int y = std::max(0, -low);
               y < std::min(mask.height, free.height - low); ++y) {
            const int first = std::max(0, -left);
            const int last = std::min(mask.width, free.width - left);
            float sum = 0.0f;
            for (int x = first; x < last; ++x)
              sum += mask.At(x, y) * free.At(x + left, y + low);
            common += sum;
          }
          const double overlap = Dice(common, mask_sum, free_sum);
          if (overlap <= best.overlap) continue;
          best = {around.turn + turn, around.scale + scale, around.column + dx,
                  around.row + dy, overlap};
        }
      }
    }
  }
  return best;
}

// The same place in cells of half the size.
Place Finer(Place place) {
  place.column *= 2;
  place.row *= 2;
  return place;
}

// A raster over the grid and all of the picture: the robot may have seen a part
// of a room only. Its cells are as if it began at the grid's corner.
struct Frame {
  Vector2d origin = Vector2d::Zero();
  int width = 0;
  int height = 0;
  // Of the grid's corner.
  int column = 0;
  int row = 0;
};

Frame FrameOf(const TracedRooms& rooms, const TracedPlacement& placement,
              const SpaceGrid& space) {
  const double by = space.resolution / kCell;
  const int width = static_cast<int>(space.width * by) + 1;
  const int height = static_cast<int>(space.height * by) + 1;
  const double pixel = rooms.metres_per_pixel * placement.scale;
  const double half = 0.5 * pixel * std::hypot(rooms.width, rooms.height);
  const Vector2d middle = (placement.center - space.origin) / kCell;
  const auto before = [&](double center) {
    return std::max(0, static_cast<int>(std::ceil(half / kCell - center)));
  };
  const auto beyond = [&](double center, int size) {
    return std::max(0,
                    static_cast<int>(std::ceil(half / kCell + center)) - size);
  };
  Frame frame;
  frame.column = before(middle[0]);
  frame.row = before(middle[1]);
  frame.width = frame.column + width + beyond(middle[0], width);
  frame.height = frame.row + height + beyond(middle[1], height);
  frame.origin = space.origin - kCell * Vector2d(frame.column, frame.row);
  return frame;
}

// The traced room at every cell.
std::vector<int> PlacedLabels(const TracedRooms& rooms,
                              const TracedPlacement& placement,
                              const Frame& frame) {
  const auto [origin, width, height] =
      std::tie(frame.origin, frame.width, frame.height);
  std::vector<int> labels(static_cast<std::size_t>(width) * height, 0);
  const double pixel = rooms.metres_per_pixel * placement.scale;
  const double cosine = std::cos(placement.turn) / pixel;
  const double sine = std::sin(placement.turn) / pixel;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const Vector2d at =
          origin + kCell * Vector2d(column + 0.5, row + 0.5) - placement.center;
      const double x =
          std::floor(cosine * at[0] + sine * at[1] + 0.5 * rooms.width);
      const double y =
          std::floor(-sine * at[0] + cosine * at[1] + 0.5 * rooms.height);
      if (!(x >= 0.0 && y >= 0.0 && x < rooms.width && y < rooms.height))
        continue;
      labels[static_cast<std::size_t>(row) * width + column] =
          rooms.labels[static_cast<std::size_t>(y) * rooms.width +
                       static_cast<std::size_t>(x)];
    }
  }
  return labels;
}

// The plan's room at every cell, from 1.
std::vector<int> PlanLabels(const BuildingPlan& plan, const Frame& frame) {
  const auto [origin, width, height] =
      std::tie(frame.origin, frame.width, frame.height);
  std::vector<int> labels(static_cast<std::size_t>(width) * height, 0);
  for (std::size_t i = 0; i < plan.rooms.size(); ++i) {
    const Polygon& outline = plan.rooms[i].outline;
    Vector2d low = outline.shell.front();
    Vector2d high = low;
    for (const Vector2d& p : outline.shell) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const auto cell = [&](double from_origin, int limit) {
      return static_cast<int>(
          std::clamp(std::floor(from_origin / kCell), 0.0, limit - 1.0));
    };
    const Vector2d from = low - origin;
    const Vector2d to = high - origin;
    for (int row = cell(from[1], height); row <= cell(to[1], height); ++row) {
      for (int column = cell(from[0], width); column <= cell(to[0], width);
           ++column) {
        const Vector2d middle =
            origin + kCell * Vector2d(column + 0.5, row + 0.5);
        if (outline.Contains(middle)) {
          labels[static_cast<std::size_t>(row) * width + column] =
              static_cast<int>(i) + 1;
        }
      }
    }
  }
  return labels;
}

double Mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

int SideOf(const JsonEntry& entry) {
  const std::int64_t side = entry.Integer();
  if (side < 1 || side > kMostPixels)
    entry.Refuse("is no side of a picture", "1 to 67108864 pixels");
  return static_cast<int>(side);
}

}  // namespace

TracedRooms ReadTracedRooms(const std::string& path) {
  InputStream input(path);
  return ReadTracedRooms(&input);
}

TracedRooms ReadTracedRooms(InputStream* input) {
  const nlohmann::json json =
      ParseJson(input, "rooms of a building as traced by somebody");
  const JsonEntry root(input->name(), json, "");
  TracedRooms rooms;
  rooms.name = root["name"].Text();
  const JsonEntry pixel = root["metres_per_pixel"];
  rooms.metres_per_pixel = pixel.Number();
  if (!(rooms.metres_per_pixel >= 1e-3 && rooms.metres_per_pixel <= 10.0))
    pixel.Refuse("is no side of a pixel", "0.001 to 10 m");
  const JsonEntry size = root["size"];
  const std::vector<JsonEntry> sides = size.Elements();
  if (sides.size() != 2)
    size.Refuse("has no two elements", "numbers of rows and columns");
  rooms.height = SideOf(sides[0]);
  rooms.width = SideOf(sides[1]);
  if (std::int64_t{1} * rooms.height * rooms.width > kMostPixels)
    size.Refuse("is too large", "up to 67108864 pixels");
  rooms.labels.assign(static_cast<std::size_t>(rooms.height) * rooms.width, 0);
  const JsonEntry list = root["rooms"];
  const std::vector<JsonEntry> entries = list.Elements();
  if (entries.empty() ||
      entries.size() > std::numeric_limits<std::uint16_t>::max()) {
    list.Refuse("has " + std::to_string(entries.size()) + " elements",
                "1 to 65535 rooms");
  }
  for (const JsonEntry& entry : entries) {
    ++rooms.count;
    const std::vector<JsonEntry> runs = entry["runs"].Elements();
    if (runs.empty()) entry["runs"].Refuse("is empty", "runs of pixels");
    for (const JsonEntry& run : runs) {
      const std::vector<JsonEntry> numbers = run.Elements();
      if (numbers.size() != 3)
        run.Refuse("has " + std::to_string(numbers.size()) + " elements",
                   "row, first and last column");
      const std::int64_t row = numbers[0].Integer();
      const std::int64_t first = numbers[1].Integer();
      const std::int64_t last = numbers[2].Integer();
      if (row < 0 || row >= rooms.height || first < 0 || last < first ||
          last >= rooms.width) {
        run.Refuse("lies outside of the picture",
                   "row, first and last column in " +
                       std::to_string(rooms.height) + " x " +
                       std::to_string(rooms.width) + " pixels");
      }
      const std::size_t line =
          static_cast<std::size_t>(rooms.height - 1 - row) * rooms.width;
      for (std::int64_t column = first; column <= last; ++column) {
        std::uint16_t& label =
            rooms.labels[line + static_cast<std::size_t>(column)];
        if (label != 0) {
          run.Refuse("has a pixel of room " + std::to_string(label),
                     "every pixel in one room at most");
        }
        label = static_cast<std::uint16_t>(rooms.count);
      }
    }
  }
  return rooms;
}

TracedPlacement PlaceTracedRooms(const TracedRooms& rooms,
                                 const SpaceGrid& space) {
  if (std::find(space.cells.begin(), space.cells.end(), Space::kFree) ==
      space.cells.end()) {
    throw PLUMBLINE_ERROR("nothing in the grid was seen free",
                          "the grid of a building, to place rooms over");
  }
  CheckSizes(rooms, space);
  const auto degrees = [](double most, double step) {
    std::vector<double> turns;
    for (double turn = -most; turn <= most + 1e-9; turn += step)
      turns.push_back(DegToRad(turn));
    return turns;
  };
  Place place = Finer(SearchEverywhere(rooms, space));
  place = SearchAround(rooms, space, place, kMiddleCell, degrees(3.0, 1.0),
                       {-0.06, -0.04, -0.02, 0.0, 0.02, 0.04, 0.06}, 6);
  place = SearchAround(rooms, space, Finer(place), kCell, degrees(1.0, 0.5),
                       {-0.01, 0.0, 0.01}, 4);
  TracedPlacement result;
  result.center =
      space.origin + kCell * Vector2d(place.column + 0.5, place.row + 0.5);
  result.turn = NormalizeAngle(place.turn);
  result.scale = place.scale;
  result.overlap = place.overlap;
  return result;
}

TracedEvaluation EvaluateTracedRooms(const BuildingPlan& plan,
                                     const TracedRooms& rooms,
                                     const SpaceGrid& space) {
  TracedEvaluation result;
  if (static_cast<double>(rooms.count) *
          static_cast<double>(plan.rooms.size()) >
      kMostPairs) {
    throw PLUMBLINE_ERROR("lies under " + std::to_string(plan.rooms.size()) +
                              " rooms, and " + std::to_string(rooms.count) +
                              " are traced",
                          "fewer rooms");
  }
  result.placement = PlaceTracedRooms(rooms, space);
  result.traced = rooms.count;
  result.drawn = static_cast<int>(plan.rooms.size());
  const double by = space.resolution / kCell;
  const Frame frame = FrameOf(rooms, result.placement, space);
  const std::vector<int> truth = PlacedLabels(rooms, result.placement, frame);
  const std::vector<int> drawn = PlanLabels(plan, frame);
  // Cells by true and by drawn room; 0: none.
  const auto columns = static_cast<std::size_t>(result.drawn) + 1;
  const auto rows = static_cast<std::size_t>(rooms.count) + 1;
  std::vector<std::int64_t> common(rows * columns, 0);
  std::vector<std::int64_t> size(rows, 0);
  // In cells of the grid.
  std::vector<double> all(rows, 0.0);
  std::vector<double> free(rows, 0.0);
  std::vector<std::int64_t> drawn_size(columns, 0);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto t = static_cast<std::size_t>(truth[i]);
    const auto d = static_cast<std::size_t>(drawn[i]);
    ++common[t * columns + d];
    ++size[t];
    ++drawn_size[d];
  }
  for (int row = 0; row < space.height; ++row) {
    for (int column = 0; column < space.width; ++column) {
      const std::size_t at =
          static_cast<std::size_t>((row + 0.5) * by + frame.row) * frame.width +
          static_cast<std::size_t>((column + 0.5) * by + frame.column);
      const auto t = static_cast<std::size_t>(truth[at]);
      all[t] += 1.0;
      free[t] += space.At(column, row) == Space::kFree;
    }
  }
  // Nothing was seen beyond the grid.
  for (int row = 0; row < frame.height; ++row) {
    for (int column = 0; column < frame.width; ++column) {
      const double x = (column - frame.column + 0.5) / by;
      const double y = (row - frame.row + 0.5) / by;
      if (x >= 0.0 && y >= 0.0 && x < space.width && y < space.height) continue;
      all[static_cast<std::size_t>(
          truth[static_cast<std::size_t>(row) * frame.width + column])] +=
          1.0 / (by * by);
    }
  }
  std::vector<double> ious, recalls, precisions;
  std::vector<bool> is_seen(rows, false);
  for (std::size_t t = 1; t < rows; ++t) {
    is_seen[t] = size[t] > 0 && free[t] >= kSeen * all[t];
    result.iou.push_back(-1.0);
    if (!is_seen[t]) continue;
    std::size_t best = 0;
    std::int64_t most = 0;
    for (std::size_t d = 1; d < columns; ++d) {
      if (common[t * columns + d] <= most) continue;
      most = common[t * columns + d];
      best = d;
    }
    const auto both = static_cast<double>(most);
    const auto either =
        static_cast<double>(size[t] - most + (best > 0 ? drawn_size[best] : 0));
    ious.push_back(both / either);
    recalls.push_back(both / static_cast<double>(size[t]));
    result.iou.back() = ious.back();
    result.found += ious.back() >= kFoundIou;
  }
  for (std::size_t d = 1; d < columns; ++d) {
    std::int64_t inside = 0;
    std::int64_t most = 0;
    for (std::size_t t = 1; t < rows; ++t) {
      if (!is_seen[t]) continue;
      inside += common[t * columns + d];
      most = std::max(most, common[t * columns + d]);
    }
    if (static_cast<double>(inside) * kCell * kCell < kLeastJudged) continue;
    precisions.push_back(static_cast<double>(most) /
                         static_cast<double>(inside));
  }
  result.seen = static_cast<int>(ious.size());
  result.mean_iou = Mean(ious);
  result.recall = Mean(recalls);
  result.precision = Mean(precisions);
  result.judged = static_cast<int>(precisions.size());
  return result;
}

}  // namespace plumbline
