#ifndef PLUMBLINE_DETECTORS_THICKNESS_CLASSES_H_
#define PLUMBLINE_DETECTORS_THICKNESS_CLASSES_H_

#include <vector>

namespace plumbline {

/// A thickness that was measured, m, and its variance, m^2.
struct ThicknessSample {
  double thickness = 0.0;
  double variance = 0.0;
};

/// A thickness that walls share, m, and the standard deviation of the walls
/// around it, m: the measurements' own errors are not in it.
struct ThicknessClass {
  double thickness = 0.0;
  double stddev = 0.0;
};

/// Options of the search for classes. Lengths in m.
struct ThicknessClassOptions {
  /// Range in which thicknesses that nothing is shared of are spread evenly.
  double min_thickness = 0.04;
  double max_thickness = 0.6;
  /// Fewest samples of a class.
  int min_support = 4;
  /// Widest standard deviation of a class: beyond it walls have nothing in
  /// common.
  double max_stddev = 0.012;
  /// Classes nearer to each other are one.
  double min_separation = 0.03;
  /// Expected number of classes that evenly spread thicknesses look like.
  double significance = 0.03;
};

/// Thicknesses that samples share: a mixture of normal distributions, one for
/// each class, and of thicknesses that are spread evenly. It begins without a
/// class; where the samples are densest one more is tried, all are estimated
/// anew by maximum likelihood, each sample with its own variance, and it stays
/// when
///
///   the likelihood rises by more than its three parameters cost (Schwarz 1978:
///   3/2 ln n),
///   uniform samples would hardly have as many within three standard deviations
///   anywhere (`significance`),
///   it is narrow enough, has support and lies apart from the others.
///
/// Samples that `known` classes explain do not count, nor do those outside the
/// range. The result is sorted by thickness and does not depend on the order of
/// the samples.
std::vector<ThicknessClass> FindThicknessClasses(
    std::vector<ThicknessSample> samples,
    const std::vector<ThicknessClass>& known,
    const ThicknessClassOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_THICKNESS_CLASSES_H_
