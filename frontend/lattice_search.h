#ifndef PLUMBLINE_FRONTEND_LATTICE_SEARCH_H_
#define PLUMBLINE_FRONTEND_LATTICE_SEARCH_H_

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace plumbline {

/// A likelihood field, by rows, and where on it a search begins, cells.
struct FieldView {
  const std::vector<std::uint8_t>& likelihood;
  int columns;
  int rows;
  double resolution;
  Eigen::Vector2d begin;

  /// The likelihood of a cell, 255 at most; 0 where it is not on the field.
  int At(int column, int row) const {
    return static_cast<unsigned>(column) < static_cast<unsigned>(columns) &&
                   static_cast<unsigned>(row) < static_cast<unsigned>(rows)
               ? likelihood[static_cast<std::size_t>(row) * columns + column]
               : 0;
  }
};

/// Poses around a prediction.
struct Lattice {
  /// Heading of the prediction, and how far rotations go each way, in steps of
  /// at most `rotation_step`, rad.
  double heading = 0.0;
  double rotation_window = 0.0;
  double rotation_step = 0.0;
  /// Steps of the translation each way, of `step`, m.
  int steps = 0;
  double step = 0.0;
};

/// A pose of a lattice: its score, from 0 to 1; its rotation off the
/// prediction, rad; its steps from there.
struct LatticePose {
  double score = 0.0;
  double angle = 0.0;
  int rotation = 0;
  int row = 0;
  int column = 0;
};

/// The pose of a lattice at which points (robot frame, m) have the largest mean
/// likelihood, those farther from the prediction a little less; of equal ones
/// the first. The prediction, with score 0, where nothing fits. Exact: poses
/// are left out only where they cannot be the best. `points` must not be empty.
LatticePose FindBestOnLattice(const FieldView& field,
                              const std::vector<Eigen::Vector2d>& points,
                              const Lattice& lattice);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_LATTICE_SEARCH_H_
