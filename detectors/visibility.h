#ifndef PLUMBLINE_DETECTORS_VISIBILITY_H_
#define PLUMBLINE_DETECTORS_VISIBILITY_H_

#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/sight_lines.h>
#include <plumbline/factors/angle.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace plumbline {

/// Options for which sight lines hold which walls back, and which hypotheses
/// they refute.
struct VisibilityOptions {
  /// Looks from within this distance of a wall are set against it, m.
  double range = 6.0;
  /// Sight lines cross a wall at least this far from its ends, m: doors stand
  /// there.
  double door = 0.4;
  /// The end of a sight line may lie this far behind a wall, m, with this
  /// standard deviation, m.
  double margin = 0.1;
  double sigma = 0.05;
  /// A line that ends farther behind a wall, m, went through an opening: no
  /// wall is so far from its place.
  double depth = 1.0;
  /// Least angle between a sight line and the wall, rad.
  double min_angle = DegToRad(10.0);
  /// This many lines of a look, the worst, hold a wall back, if it has as many.
  int lines = 3;
  /// P-value below which one of them is broken: the wall ends there, or what
  /// stood there was moved.
  double break_below = 0.01;
  /// Walls that a hypothesis puts in line are not in line where looks that saw
  /// the one went through where the other would stand, over this width, m: more
  /// than a door. They end at least `passed`, m, behind it.
  double min_width = 1.6;
  double passed = 0.2;
};

/// The sight lines of a look by the sector around the sensor that they lie in.
struct SectoredLook {
  /// Number of sectors of the full circle.
  static constexpr std::size_t kSectors = 64;
  /// Ends as in Look, by sector; those of sector k are begin[k] to begin[k +
  /// 1].
  std::vector<Eigen::Vector2d> ends;
  std::array<int, kSectors + 1> begin{};
  /// Length of the longest in each sector, m.
  std::array<float, kSectors> reach{};
  /// Sectors in each of the groups that are looked at together.
  static constexpr std::size_t kGroup = 8;
  /// Box around the ends of each group and of all, from the sensor on along the
  /// axes of its frame, m; empty where there are none.
  std::array<Eigen::AlignedBox2d, kSectors / kGroup> boxes;
  Eigen::AlignedBox2d box;
};

/// Holds walls back from where the sensor has looked through: proposes, for
/// each wall ("segment" of level 0) and each look that went through it, a
/// wall_visibility of the worst few sight lines, weighed and broken like all
/// structure. And breaks live hypotheses that two walls are in line (one wall,
/// one side of a rectangle) where the looks that saw the one went through where
/// the other stands.
///
/// A look whose frame a live measurement ties to the wall holds it not back: it
/// knows where the wall is, and what it looked through is an opening. Lines
/// that hold a wall back stay while they live, whether they are still violated
/// or not, so that the wall does not come back as soon as it has left; in each
/// round those of the present state come on top, up to `lines` violated ones
/// for each wall and frame, and none where one was broken.
///
/// Sight lines are not in the graph: without SetLooks nothing is proposed.
/// Looks in the map frame (Look::frame is kNoId) refute, but hold no wall back:
/// for that they need a feature to belong to. A scope with a list of features
/// gives no proposal.
class Visibility : public StructureDetector, public LooksReader {
 public:
  /// Options that make no sense are refused by the type's factory.
  explicit Visibility(const VisibilityOptions& options);

  const std::string& name() const override;
  Transaction Detect(const Graph& graph, const Registry& registry,
                     const DetectionScope& scope) const override;
  void SetLooks(std::shared_ptr<const Looks> looks) override;

 private:
  VisibilityOptions options_;
  std::shared_ptr<const Looks> looks_;
  // Of each look.
  std::vector<SectoredLook> sectored_;
};

/// Name of the detector.
extern const char* const kVisibilityDetector;

/// "visibility" with its parameters (angles in degrees).
DetectorType VisibilityType();

}  // namespace plumbline

#endif  // PLUMBLINE_DETECTORS_VISIBILITY_H_
