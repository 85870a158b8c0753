#ifndef PLUMBLINE_FRONTEND_RANGE_NOISE_H_
#define PLUMBLINE_FRONTEND_RANGE_NOISE_H_

#include <plumbline/frontend/scan.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace plumbline {

/// Noise of a laser's ranges, m (standard deviation), for which the distances
/// in the options of the front-end are made. A quieter laser does not shrink
/// them: walls are not flat to the millimetre.
inline constexpr double kUsualRangeNoise = 0.015;

/// Factor by which those distances grow with a laser of this noise (standard
/// deviation of a range, m): at least 1.
double RangeNoiseScale(double range_sigma);

/// Noise of a laser's ranges, as its scans show it: how far each range lies off
/// the straight line through its two neighbours, 1 / r being linear in the
/// cosine and sine of the bearing there. It is read off low quantiles of these
/// deviations, so that corners, edges and clutter, where lines are not
/// straight, do not count; the smallest of several is taken, since ranges
/// rounded to centimetres deviate by nothing or by much. Scans may differ in
/// beams and steps.
class RangeNoise {
 public:
  /// Counts what a scan shows. Cost: linear in its beams.
  void Add(const Scan& scan);

  /// Standard deviation of a range, m; 0 before `kFewest` deviations were
  /// counted.
  double sigma() const;

  /// Fewest deviations for an estimate: those of a handful of scans.
  static constexpr std::int64_t kFewest = 1000;

 private:
  static constexpr double kBinWidth = 0.0005;
  static constexpr std::size_t kBins = 600;

  template <typename Archive>
  friend void Exchange(Archive& archive, RangeNoise& noise) {
    ExchangeAll(archive, noise.counts_, noise.total_);
  }

  // Deviations by size, the last bin for all larger ones.
  std::array<std::int64_t, kBins> counts_ = {};
  std::int64_t total_ = 0;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RANGE_NOISE_H_
