#ifndef PLUMBLINE_FRONTEND_RANGE_RATIO_H_
#define PLUMBLINE_FRONTEND_RANGE_RATIO_H_

#include <plumbline/frontend/key_views.h>

#include <optional>
#include <vector>

namespace plumbline {

/// How much longer one laser's ranges are than another's.
struct RangeRatio {
  /// Share by which they are longer, negative where they are shorter, and its
  /// standard error as parts of the log have it.
  double excess = 0.0;
  double sigma = 0.0;
  /// Pairs of views that were compared.
  int pairs = 0;

  /// Less is not told from walls that are not flat.
  static constexpr double kLeast = 0.005;
  /// It is significant from this many standard errors on.
  static constexpr double kSigmas = 5.0;
  bool is_significant() const {
    return (excess > kLeast || excess < -kLeast) &&
           (excess > kSigmas * sigma || excess < -kSigmas * sigma);
  }
};

/// Compares the ranges of `track` with those of `map`, views of one building in
/// one frame. Two lasers that stood at one place and do not agree on the metre
/// do not see one room, whatever the poses: each view of the track is laid on
/// the nearest one of the map, and what is left along the normals of walls is
/// put down to a share of the range, and to an offset of it, by least squares
/// with the pose of every view left free. Nothing where few views lie near each
/// other.
std::optional<RangeRatio> CompareRanges(const std::vector<KeyView>& map,
                                        const std::vector<KeyView>& track);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RANGE_RATIO_H_
