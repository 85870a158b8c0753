#include <plumbline/core/error.h>
#include <plumbline/frontend/place_chain.h>

#include <algorithm>
#include <string>

namespace plumbline {

std::vector<std::size_t> PlaceBegins(const std::vector<KeyScanRecord>& records,
                                     int stride) {
  if (stride < 1) {
    throw PLUMBLINE_ERROR("place_stride is " + std::to_string(stride),
                          "1 or more");
  }
  std::vector<std::size_t> begins;
  for (std::size_t k = 0; k < records.size(); ++k) {
    if (begins.empty() ||
        k - begins.back() == static_cast<std::size_t>(stride) ||
        !FollowsTheOneBefore(records[k])) {
      begins.push_back(k);
    }
  }
  return begins;
}

PlaceArrival ArrivalAt(const std::vector<KeyScanRecord>& records,
                       const std::vector<std::size_t>& begins,
                       std::size_t place) {
  const std::size_t end = begins[place];
  PlaceArrival arrival{place - 1, {}};
  std::size_t until = end - 1;
  // Its first record's motion counts from another place when the robot was lost
  // and found.
  if (records[end].from >= 0) {
    until = static_cast<std::size_t>(records[end].from);
    arrival.from = static_cast<std::size_t>(
        std::upper_bound(begins.begin(), begins.end(), until) - begins.begin() -
        1);
  }
  for (std::size_t k = begins[arrival.from] + 1; k <= until; ++k) {
    arrival.steps.push_back(k);
  }
  arrival.steps.push_back(end);
  return arrival;
}

}  // namespace plumbline
