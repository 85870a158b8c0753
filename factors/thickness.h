#ifndef PLUMBLINE_FACTORS_THICKNESS_H_
#define PLUMBLINE_FACTORS_THICKNESS_H_

#include <plumbline/factors/blocks.h>

namespace plumbline {

/// A thickness that walls of a building share.
struct ThicknessBlock : DescribedBlock {
  static constexpr char kName[] = "thickness";
  static constexpr char kG2oTag[] = "PLUMBLINE_THICKNESS";
  static constexpr char kDescription[] = "Thickness shared by walls";
  static constexpr Quantity kParameters[] = {Quantity::Length("thickness")};
};

}  // namespace plumbline

#endif  // PLUMBLINE_FACTORS_THICKNESS_H_
