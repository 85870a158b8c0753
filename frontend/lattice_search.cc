#include <plumbline/factors/angle.h>
#include <plumbline/frontend/lattice_search.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace plumbline {
namespace {

// A point's most score, the points between two looks at what a pose can still
// come to, and the step in which points are taken.
constexpr int kMostScore = 255;
constexpr std::size_t kBoundBlock = 16;
constexpr std::size_t kSpread = 8;
// Search: one in so many poses of the lattice, each way, is looked at first.
constexpr int kFewSteps = 3;
constexpr int kFewRotations = 3;
// Where the window has at least so many steps each way, squares of poses of
// this side are left out together.
constexpr int kManySteps = 8;
constexpr int kSquare = 4;

// The same points in an order in which those of every surface are spread over
// the whole: what does not fit shows early.
std::vector<Eigen::Vector2d> Spread(
    const std::vector<Eigen::Vector2d>& points) {
  std::vector<Eigen::Vector2d> spread;
  spread.reserve(points.size());
  for (std::size_t first = 0; first < kSpread; ++first) {
    for (std::size_t i = first; i < points.size(); i += kSpread) {
      spread.push_back(points[i]);
    }
  }
  return spread;
}

// The best likelihood of the cells from (column, row) on, so many each way.
class BestAround {
 public:
  BestAround(const FieldView& field, int size)
      : size_(size),
        columns_(field.columns + size),
        rows_(field.rows + size),
        best_(static_cast<std::size_t>(columns_) * rows_, 0) {
    // First along the rows, then down the columns.
    std::vector<std::uint8_t> along(best_.size(), 0);
    for (int y = 0; y < field.rows; ++y) {
      const std::uint8_t* const from =
          &field.likelihood[static_cast<std::size_t>(y) * field.columns];
      for (int k = 0; k < size; ++k) {
        std::uint8_t* const to =
            &along[static_cast<std::size_t>(y + size) * columns_ + size - k];
        for (int x = 0; x < field.columns; ++x) {
          to[x] = std::max(to[x], from[x]);
        }
      }
    }
    for (int y = 0; y < rows_; ++y) {
      std::uint8_t* const to = &best_[static_cast<std::size_t>(y) * columns_];
      for (int k = y; k < std::min(y + size, rows_); ++k) {
        const std::uint8_t* const from =
            &along[static_cast<std::size_t>(k) * columns_];
        for (int x = 0; x < columns_; ++x) to[x] = std::max(to[x], from[x]);
      }
    }
  }

  // From the cell of a position on, cells; what is rounded is within the one
  // cell more.
  int At(double column, double row) const {
    const int x = static_cast<int>(column + size_);
    const int y = static_cast<int>(row + size_);
    return static_cast<unsigned>(x) < static_cast<unsigned>(columns_) &&
                   static_cast<unsigned>(y) < static_cast<unsigned>(rows_)
               ? best_[static_cast<std::size_t>(y) * columns_ + x]
               : 0;
  }

 private:
  int size_;
  int columns_;
  int rows_;
  std::vector<std::uint8_t> best_;
};

// The best of all translations and rotations of a lattice.
class LatticeSearch {
 public:
  // All must outlive it.
  LatticeSearch(const FieldView& field,
                const std::vector<Eigen::Vector2d>& points,
                const Lattice& lattice)
      : field_(field),
        points_(points),
        heading_(lattice.heading),
        rotation_window_(lattice.rotation_window),
        rotations_(static_cast<int>(
            std::ceil(lattice.rotation_window / lattice.rotation_step))),
        steps_(lattice.steps),
        step_(lattice.step),
        normalization_(1.0 / (kMostScore * points.size())),
        rotated_(points.size()) {
    const int side = 2 * steps_ + 1;
    penalties_.reserve(static_cast<std::size_t>(side) * side);
    for (int iy = -steps_; iy <= steps_; ++iy) {
      for (int ix = -steps_; ix <= steps_; ++ix) {
        penalties_.push_back(0.03 * std::hypot(ix * step_, iy * step_) / 0.5);
      }
    }
  }

  LatticePose Run() {
    if (steps_ >= kManySteps) {
      SearchSquares();
    } else {
      SearchAll();
    }
    best_.angle = Angle(best_.rotation);
    return best_;
  }

 private:
  double Angle(int rotation) const {
    return rotations_ > 0 ? rotation * (rotation_window_ / rotations_) : 0.0;
  }

  void SearchAll() {
    // What the best pose has at least: that of the best of a few.
    for (int k = -rotations_; k <= rotations_; k += kFewRotations) {
      Rotate(k);
      for (int iy = -steps_; iy <= steps_; iy += kFewSteps) {
        for (int ix = -steps_; ix <= steps_; ix += kFewSteps) {
          least_ = std::max(least_, ScoreOf(k, ix, iy));
        }
      }
    }
    for (int k = -rotations_; k <= rotations_; ++k) {
      Rotate(k);
      LookAt(k, -steps_, -steps_, 2 * steps_ + 1);
    }
  }

  void SearchSquares() {
    // Cells that a point comes to at the poses of a square, and one more: cells
    // are rounded towards zero.
    const BestAround around(
        field_,
        static_cast<int>(std::ceil((kSquare - 1) * step_ / field_.resolution)) +
            2);
    for (int k = -rotations_; k <= rotations_; k += kFewRotations) {
      VisitSquares(around, k, [&](int ix, int iy) {
        least_ = std::max(least_, ScoreOf(k, std::min(ix + 1, steps_),
                                          std::min(iy + 1, steps_)));
      });
    }
    for (int k = -rotations_; k <= rotations_; ++k) {
      VisitSquares(around, k,
                   [&](int ix, int iy) { LookAt(k, ix, iy, kSquare); });
    }
  }

  // Calls `visit(ix, iy)` with the first corners of the squares of poses at a
  // rotation that may hold the best pose.
  template <typename Visit>
  void VisitSquares(const BestAround& around, int rotation,
                    const Visit& visit) {
    Rotate(rotation);
    const auto best_at = [&](double x, double y) { return around.At(x, y); };
    for (int iy = -steps_; iy <= steps_; iy += kSquare) {
      for (int ix = -steps_; ix <= steps_; ix += kSquare) {
        // The share of the pose of the square that is nearest to the middle.
        const double share = ShareOf(rotation, Nearest(ix), Nearest(iy));
        if (SumOf(ix, iy, share, best_at) >= least_) visit(ix, iy);
      }
    }
  }

  // The step nearest to the middle of those of a square that begins here.
  int Nearest(int first) const {
    const int last = std::min(first + kSquare - 1, steps_);
    return first > 0 ? first : std::min(last, 0);
  }

  // Takes the best of a square of poses, unless there is a better one.
  void LookAt(int k, int first_x, int first_y, int size) {
    for (int iy = first_y; iy < std::min(first_y + size, steps_ + 1); ++iy) {
      for (int ix = first_x; ix < std::min(first_x + size, steps_ + 1); ++ix) {
        const double score = ScoreOf(k, ix, iy);
        if (score < least_ || score <= 0.0) continue;
        least_ = score;
        const bool is_first =
            std::make_tuple(k, iy, ix) <
            std::make_tuple(best_.rotation, best_.row, best_.column);
        if (score > best_.score || is_first) best_ = {score, 0.0, k, iy, ix};
      }
    }
  }

  // Ties go to the pose nearest to the prediction.
  double ShareOf(int k, int ix, int iy) const {
    return 1.0 - 0.05 * std::abs(Angle(k)) / DegToRad(30.0) -
           penalties_[static_cast<std::size_t>(iy + steps_) * (2 * steps_ + 1) +
                      (ix + steps_)];
  }

  // The score of a pose whose points are rotated; something below least_ when
  // it is less than that.
  double ScoreOf(int k, int ix, int iy) const {
    return SumOf(ix, iy, ShareOf(k, ix, iy), [this](double x, double y) {
      return field_.At(static_cast<int>(x), static_cast<int>(y));
    });
  }

  template <typename At>
  double SumOf(int ix, int iy, double share, const At& at) const {
    const double cx = ix * step_ / field_.resolution;
    const double cy = iy * step_ / field_.resolution;
    int sum = 0;
    for (std::size_t begin = 0; begin < rotated_.size(); begin += kBoundBlock) {
      const std::size_t end = std::min(begin + kBoundBlock, rotated_.size());
      const int most =
          sum + kMostScore * static_cast<int>(rotated_.size() - begin);
      const double bound = most * normalization_ * share;
      if (bound < least_) return bound;
      for (std::size_t i = begin; i < end; ++i) {
        sum += at(rotated_[i].x() + cx, rotated_[i].y() + cy);
      }
    }
    return sum * normalization_ * share;
  }

  void Rotate(int k) {
    const double theta = heading_ + Angle(k);
    const double c = std::cos(theta) / field_.resolution;
    const double s = std::sin(theta) / field_.resolution;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      rotated_[i] = field_.begin +
                    Eigen::Vector2d(c * points_[i].x() - s * points_[i].y(),
                                    s * points_[i].x() + c * points_[i].y());
    }
  }

  const FieldView& field_;
  const std::vector<Eigen::Vector2d>& points_;
  const double heading_;
  const double rotation_window_;
  // Each way.
  const int rotations_;
  const int steps_;
  const double step_;
  const double normalization_;
  std::vector<double> penalties_;
  std::vector<Eigen::Vector2d> rotated_;
  // What the best pose has at least.
  double least_ = 0.0;
  LatticePose best_;
};

}  // namespace

LatticePose FindBestOnLattice(const FieldView& field,
                              const std::vector<Eigen::Vector2d>& points,
                              const Lattice& lattice) {
  const std::vector<Eigen::Vector2d> spread = Spread(points);
  return LatticeSearch(field, spread, lattice).Run();
}

}  // namespace plumbline
