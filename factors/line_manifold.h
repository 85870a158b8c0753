#ifndef PLUMBLINE_FACTORS_LINE_MANIFOLD_H_
#define PLUMBLINE_FACTORS_LINE_MANIFOLD_H_

#include <plumbline/factors/angle_manifold.h>

namespace plumbline {

/// Directed lines (d, alpha), in m, rad: the real numbers times the circle.
/// That (-d, alpha + pi) is the same line turned round is left to those who
/// compare lines: a solver never needs to go from one form to the other, and
/// the set of undirected lines (a Moebius strip) has no global coordinates.
class LineManifold final : public WrappedAngleManifold<2, 1> {};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_LINE_MANIFOLD_H_
