#ifndef MINE_EQUAL_RADIUS_H_
#define MINE_EQUAL_RADIUS_H_

#include <ceres/autodiff_cost_function.h>
#include <plumbline/core/registry.h>

#include <memory>

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

inline plumbline::RelationType EqualRadiusType() {
  plumbline::RelationType type;
  type.name = "equal_radius";
  type.g2o_tag = "MINE_EQUAL_RADIUS";
  type.feature_types = {{"circle"}, {"circle"}};
  type.residual_size = 1;
  type.description = "R2 - R1 - u; m";
  type.make_cost = [](const plumbline::RelationArguments& a) {
    return std::make_unique<ceres::AutoDiffCostFunction<EqualRadius, 1, 3, 3>>(
        new EqualRadius(a.expected[0], a.sqrt_information(0, 0)));
  };
  return type;
}
//! [relation]

}  // namespace mine

#endif  // MINE_EQUAL_RADIUS_H_
