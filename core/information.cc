#include <plumbline/core/information.h>

namespace plumbline {

template bool IsValidInformation(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);
template int InformationRank(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);
template Eigen::MatrixXd SqrtInformation(
    const Eigen::MatrixBase<Eigen::MatrixXd>& expression);

}  // namespace plumbline
