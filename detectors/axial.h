#ifndef PLUMBLINE_DETECTORS_AXIAL_H_
#define PLUMBLINE_DETECTORS_AXIAL_H_

#include <plumbline/factors/angle.h>

#include <vector>

namespace plumbline {

/// Angle between two undirected directions (rad), in [0, pi/2].
double AxialDistance(double a, double b);

/// Index of the direction nearest to `angle` and not farther than `gate` (all
/// rad, axial); the first of equally near ones, -1 when there is none.
int NearestAxial(const std::vector<double>& directions, double angle,
                 double gate);

/// An observed undirected direction.
struct AxialSample {
  /// rad; angle and angle + pi are the same.
  double angle = 0.0;
  /// Standard deviation of the observation, rad: short walls have a poor
  /// direction.
  double stddev = 0.0;
  /// Length of wall that it stands for, m.
  double length = 0.0;
};

/// A direction that stands out of the clutter.
struct AxialComponent {
  /// rad, in (-pi/2, pi/2].
  double mean = 0.0;
  /// Spread of the true directions (the samples' own noise taken out), rad.
  double stddev = 0.0;
  /// Samples within three standard deviations that are nearer to this than to
  /// another component, and the sum of their lengths in m.
  int count = 0;
  double length = 0.0;
};

/// Options for telling a building's directions from clutter. Angles in rad.
struct AxialMixtureOptions {
  /// A sample nearer than this to a direction belongs to it, and no further
  /// direction is made of it.
  double gate = DegToRad(8.0);
  /// A component with a larger spread is split where it can be. One that
  /// spreads wider than the gate is refused.
  double max_stddev = DegToRad(3.0);
  /// Components nearer to each other are one.
  double min_separation = DegToRad(2.0);
  /// Fewest samples, and smallest sum of their lengths (m), of a component.
  int min_support = 3;
  double min_support_length = 5.0;
  /// Probability that clutter in uniformly random directions yields a
  /// component, anywhere.
  double significance = 0.01;
  /// A component is at least this many times as dense as the clutter.
  double min_contrast = 2.0;
  /// A component whose K^2 test of normality has a smaller p-value is split.
  double normality_significance = 0.01;
};

/// Finds the directions in a set of axial samples that come from a few
/// Gaussians of unknown number over clutter, after the manner of Ponsa and Roca
/// 2002 (core/method.md, section 6):
///
/// 1. Outliers. Clutter is a Poisson process of uniform direction whose marks,
///    the samples' weights, grow with length up to 3 m. Windows of several
///    widths slide over the half circle; where the weight inside exceeds what
///    the clutter explains (Bennett's inequality for a compound Poisson sum,
///    with Bonferroni's correction for the number of windows) the window is
///    taken out of the clutter, whose density is estimated again from the rest,
///    until nothing changes. What lies outside all such windows is outliers.
/// 2. Mixture. Each run of overlapping windows starts as one Gaussian over the
///    clutter. A component that fails D'Agostino's K^2 (20 samples at least) or
///    spreads wider than max_stddev is split at the most likely cut, or its
///    densest window is taken out of it, and everything is estimated again by
///    maximum likelihood (EM; each sample brings its own variance). A split
///    stands when it pays by the Bayesian information criterion and the parts
///    are separate modes.
/// 3. Decision. A component stays when it has support, is narrow enough, stands
///    out of the clutter as in 1 and is denser in its middle than on both
///    sides.
///
/// The three steps are repeated on the samples that are beyond the gate of
/// everything known until nothing is found, so calling again with the result
/// among `known` finds nothing. `known` directions (rad) and their gates are
/// left out; the shoulder of a known direction, one that reaches into its gate,
/// is not a direction. Result: the longest first. Does not depend on the order
/// of the samples. Samples that are not finite are passed over.
std::vector<AxialComponent> FindAxialComponents(
    const std::vector<AxialSample>& samples, const std::vector<double>& known,
    const AxialMixtureOptions& options);

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_AXIAL_H_
