#ifndef PLUMBLINE_CORE_FEATURE_H_
#define PLUMBLINE_CORE_FEATURE_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// Ids are handed out in order by the graph, from 0, and never reused.
using FeatureId = std::int64_t;
using ConstraintId = std::int64_t;

constexpr std::int64_t kNoId = -1;

/// Most parameters that a feature type may have: room for a box in space, that
/// is a position, a quaternion and three sizes.
constexpr int kMaxFeatureSize = 10;
/// Most coordinates of an anchor.
constexpr int kMaxAnchorSize = 3;

/// Highest level of a feature: far more than any hierarchy has, so that a
/// nonsensical number is refused.
constexpr int kMaxLevel = 1000;

struct DetectorType;  // core/registry.h
struct FeatureType;   // core/registry.h

/// A node of the graph: something with parameters to be estimated (method.md,
/// section 3). Built-in types and the order of their parameters:
///
///   point        x, y              m
///   pose         x, y, theta       m, m, rad
///   segment      x, y, theta       m, m, rad
///   line         d, alpha          m, rad; relative to `anchor`
///   end_points   x1, y1, x2, y2    m
///   circle       x, y, R           m
///   rectangle    x, y, theta, half_length, half_width
///                                  m, m, rad, m, m; half its size along theta
///                                  and across
///   orientation  theta             rad
///   corridor     d, alpha, w       m, rad, m; its axis relative to `anchor`,
///   and
///                                  half its width
///   thickness    w                 m
///
/// The name of a type and of its parameters are in the type, and in the files;
/// code asks for its traits and its frame, not for its name.
struct Feature {
  FeatureId id = kNoId;
  /// Owned by the registry; never null in a graph.
  const FeatureType* type = nullptr;
  /// 0 for raw features; a detector puts what it finds one level up.
  int level = 0;
  /// Made by a detector and not by a sensor.
  bool is_virtual = false;
  /// Held constant in every solve: this is what fixes the gauge.
  bool fixed = false;
  /// The state; entries past type->size are zero. Its address is stable for
  /// the life of the feature in the graph, solvers write to it.
  std::array<double, kMaxFeatureSize> parameters{};
  /// Reference point (m, map frame) of parameters that would lose accuracy far
  /// from the origin (lines): constant. Entries past type->anchor_size are zero
  /// and mean nothing.
  std::array<double, kMaxAnchorSize> anchor{};
  /// Where the visible part of something straight begins and ends along its
  /// direction, m, relative to the feature's own position (a segment's (x, y),
  /// a line's foot point seen from its anchor). An attribute for association
  /// and drawing, not state.
  double extent_begin = 0.0;
  double extent_end = 0.0;
  /// Number of scans that saw it (0 for virtual features).
  int observations = 0;
  /// The detector whose rules of support keep it alive (SupportPolicy): the one
  /// that made it. The orchestrator and readers of files set it; null for raw
  /// features.
  const DetectorType* maker = nullptr;
  /// Label in files and reports: "frontend", a reader, a detector's name.
  /// Nothing is decided by it.
  std::string source;

  /// The parameter block, type->size numbers.
  double* data() { return parameters.data(); }
  const double* data() const { return parameters.data(); }
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_FEATURE_H_
