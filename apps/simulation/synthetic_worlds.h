#ifndef PLUMBLINE_APPS_SIMULATION_SYNTHETIC_WORLDS_H_
#define PLUMBLINE_APPS_SIMULATION_SYNTHETIC_WORLDS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

namespace plumbline {

/// A straight row of points.
struct SyntheticLine {
  /// m.
  Eigen::Vector2d begin = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  /// Index into SyntheticTruth::orientations.
  int orientation = -1;
  /// Points on it, ascending.
  std::vector<FeatureId> points;
};

/// A circle, with points on it or (S6) a feature itself.
struct SyntheticCircle {
  /// m.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius = 0.0;
  /// Index into SyntheticTruth::centers; -1 when nothing shares its centre.
  int common_center = -1;
  /// Points on it, ascending.
  std::vector<FeatureId> points;
};

/// What is so in a synthetic world.
struct SyntheticTruth {
  /// True position of every feature of the graph, by feature id, m.
  std::vector<Eigen::Vector2d> positions;
  std::vector<SyntheticLine> lines;
  std::vector<SyntheticCircle> circles;
  /// Directions that at least two lines share, rad, axial.
  std::vector<double> orientations;
  /// Centres that at least two circles share, m.
  std::vector<Eigen::Vector2d> centers;
  /// Features that belong to no structure: random points (S4), trees that only
  /// nearly stand in a line (S5), the circle that is out of place (S6).
  std::vector<FeatureId> outliers;

  /// Virtual features to be found: lines, orientations, circles and common
  /// centres.
  int num_virtual_features() const {
    return static_cast<int>(lines.size() + orientations.size() +
                            circles.size() + centers.size());
  }
};

struct SyntheticOptions {
  /// Initial positions are off by a uniform draw from [-noise, noise) on x and
  /// on y, measured distances likewise, m. The information of a distance is
  /// that of the uniform distribution: sigma = noise / sqrt(3), at least 1 mm.
  double position_noise = 0.25;
  double distance_noise = 0.05;
  /// Random points beside the structure, each with a distance to its three
  /// nearest points.
  int outliers = 0;
};

/// A graph with measurements only, and its truth.
struct SyntheticWorld {
  std::unique_ptr<Graph> graph;
  SyntheticTruth truth;
};

/// "S1" to "S6".
const std::vector<std::string>& SyntheticWorldNames();

/// The noise and outliers that core/method.md, section 8 gives a world. S2
/// starts from its largest initial noise, 0.3 m, and S3 has its larger distance
/// noise, 0.1 m.
SyntheticOptions DefaultSyntheticOptions(const std::string& name);

/// The paper's synthetic worlds as graphs (core/method.md, section 8). The
/// layout is fixed; `seed` draws the noise and what belongs to no structure.
///
///   S1 to S4  572 points and 1193 distances: a building of four rooms, each
///             with a round hall. Seven corridors (two walls 1.5 m apart, so 14
///             lines in 2 directions) and four ambulatories (two concentric
///             circles 1.5 m apart, so 8 circles and 4 common centres) with a
///             point about every metre, triangulated; 70 distances tie near
///             parts to each other. The graph is rigid with 52 distances more
///             than it takes. A point a metre is what the paper's noise allows:
///             closer, an initial noise of 0.25 to 0.3 m turns triangles over,
///             and distances alone cannot turn them back.
///   S5        three pairs of parallel walls with two rows of 30 trees between
///             them, which stand to the left and right of a line in turn, 0.05
///             to 0.15 m off (drawn from `seed`). Every tree has distances to
///             its two neighbours either way and two to each wall.
///   S6        a fixed point at the origin and seven circles with measured
///             centres, six of them concentric at the origin; the seventh, at
///             a place in the order that is drawn, is 0.2 to 0.5 m off on x
///             and y. position_noise is that of the measured centres, from
///             which the circles start.
///
/// Only S6 has a fixed feature: compare positions after AlignToTruth. Throws
/// Error for another name and options out of range.
SyntheticWorld MakeSyntheticWorld(const std::string& name,
                                  const SyntheticOptions& options,
                                  std::uint64_t seed, const Registry& registry);

/// Writes the truth as JSON (m, degrees; format "plumbline-synthetic-truth",
/// version 1): positions [id, x, y], lines (x1, y1, x2, y2, orientation,
/// points), circles (x, y, r, common_center, points), orientations_deg,
/// centers [x, y], outliers (ids).
void WriteSyntheticTruth(const SyntheticTruth& truth, std::ostream& output);

/// A rotation and translation of the plane: p -> R p + t.
struct RigidTransform {
  Eigen::Matrix2d rotation = Eigen::Matrix2d::Identity();
  Eigen::Vector2d translation = Eigen::Vector2d::Zero();

  Eigen::Vector2d operator*(const Eigen::Vector2d& p) const {
    return rotation * p + translation;
  }
};

/// The transformation that brings the features of level 0 closest to their true
/// positions in the least squares sense. Measured distances say nothing about
/// where a map lies in the plane, so this is taken out before errors are
/// measured. The identity when a feature of the graph is fixed, for then the
/// map has its place. Features without a true position are passed over; the
/// identity when fewer than two are left.
RigidTransform AlignToTruth(const Graph& graph, const SyntheticTruth& truth);

/// Mean distance of features from their true positions after AlignToTruth, m
/// (Eq. 24): over all features of level 0 that are not fixed, those that belong
/// to no structure (SyntheticTruth::outliers) only with `with_outliers`.
double MeanPositionError(const Graph& graph, const SyntheticTruth& truth,
                         bool with_outliers = true);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_SYNTHETIC_WORLDS_H_
