#ifndef PLUMBLINE_CORE_PROBLEM_CHANGES_H_
#define PLUMBLINE_CORE_PROBLEM_CHANGES_H_

#include <ceres/problem.h>

#include <vector>

namespace plumbline {

/// What was done to a ceres::Problem since it was read last, for whoever knows:
/// what did not change is not asked for again. Residual blocks that were
/// removed are noticed.
struct ProblemChanges {
  /// Whether a parameter block came or went, got its first residual block or
  /// lost its last one, became constant or variable, or has another manifold.
  bool parameter_blocks = true;
  /// Residual blocks that were added; some of them may have gone since.
  std::vector<ceres::ResidualBlockId> added;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_PROBLEM_CHANGES_H_
