#ifndef PLUMBLINE_CORE_INFORMATION_H_
#define PLUMBLINE_CORE_INFORMATION_H_

#include <plumbline/factors/information.h>

#include <Eigen/Core>

namespace plumbline {

// The matrices of constraints have a size known at run time. Their
// decompositions are compiled once, in information.cc: every other source that
// compiled them too would take seconds for it.
extern template bool IsValidInformation(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);
extern template int InformationRank(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);
extern template Eigen::MatrixXd SqrtInformation(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_INFORMATION_H_
