#ifndef MINE_EQUAL_RADIUS_H_
#define MINE_EQUAL_RADIUS_H_

#include <plumbline/factors/blocks.h>

namespace mine {

//! [relation]
/// Difference of the radii of two circles: columns cast in one mould.
///
///   residual:   r = L (R2 - R1 - difference)
///   blocks:     circles (x1, y1, R1) and (x2, y2, R2)
///   frames:     none, the residual does not change when the world is moved
///   unit:       row 0: m (before whitening)
///   chi-square: 1 degree of freedom
///   degenerate: nowhere
///   source:     this example
class EqualRadius {
 public:
  static constexpr char kName[] = "equal_radius";
  static constexpr char kG2oTag[] = "MINE_EQUAL_RADIUS";
  static constexpr char kDescription[] = "R2 - R1 - u; m";
  static constexpr plumbline::RelationRole kRole =
      plumbline::RelationRole::kOther;
  static constexpr plumbline::Quantity kRows[] = {
      plumbline::Quantity::Length("difference", "radius tolerance")};
  using Blocks =
      plumbline::BlockList<plumbline::CircleBlock, plumbline::CircleBlock>;

  EqualRadius(double difference, double sqrt_information)
      : difference_(difference), sqrt_information_(sqrt_information) {}

  template <typename T>
  bool operator()(const T* circle1, const T* circle2, T* residual) const {
    residual[0] = sqrt_information_ * (circle2[2] - circle1[2] - difference_);
    return true;
  }

 private:
  double difference_;
  double sqrt_information_;
};
//! [relation]

}  // namespace mine

#endif  // MINE_EQUAL_RADIUS_H_
