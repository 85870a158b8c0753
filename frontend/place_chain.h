#ifndef PLUMBLINE_FRONTEND_PLACE_CHAIN_H_
#define PLUMBLINE_FRONTEND_PLACE_CHAIN_H_

#include <plumbline/frontend/graph_builder.h>

#include <cstddef>
#include <vector>

namespace plumbline {

/// The records that places begin with: every `stride`-th (at least 1), and
/// those where the robot was lost. Throws Error when the stride is less than 1.
std::vector<std::size_t> PlaceBegins(const std::vector<KeyScanRecord>& records,
                                     int stride);

/// How the robot came to a place.
struct PlaceArrival {
  /// The place that it came from, by index.
  std::size_t from = 0;
  /// The records whose motions took it there, in order.
  std::vector<std::size_t> steps;
};

/// How the robot came to a place that is not the first. `begins`: the record
/// that each place begins with.
PlaceArrival ArrivalAt(const std::vector<KeyScanRecord>& records,
                       const std::vector<std::size_t>& begins,
                       std::size_t place);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_PLACE_CHAIN_H_
