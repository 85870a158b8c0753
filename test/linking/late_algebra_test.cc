// This binary is linked as those of apps are: SuiteSparse within, what it calls
// of others looked for when it is called.

#include <ceres/ceres.h>
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <plumbline/core/serial_openmp.h>
#include <suitesparse/SuiteSparseQR_C.h>
#include <suitesparse/cholmod.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

extern "C" {
void dpotrf_(char* uplo, int* n, double* a, int* lda, int* info);
void dpotrs_(char* uplo, int* n, int* nrhs, double* a, int* lda, double* b,
             int* ldb, int* info);
}

namespace plumbline {
namespace {

constexpr int kSize = 60;

// Symmetric and positive definite, without zeros.
Eigen::MatrixXd DenseMatrix() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const Eigen::MatrixXd any = Eigen::MatrixXd::NullaryExpr(
      kSize, kSize, [&](Eigen::Index, Eigen::Index) { return number(random); });
  return any * any.transpose() + Eigen::MatrixXd::Identity(kSize, kSize);
}

class Cholmod {
 public:
  Cholmod() { cholmod_start(&common_); }
  ~Cholmod() { cholmod_finish(&common_); }

  // Solves by the factor that `supernodal` names, CHOLMOD_SUPERNODAL or
  // CHOLMOD_SIMPLICIAL, with columns ordered by `ordering`.
  Eigen::VectorXd Solve(const Eigen::MatrixXd& matrix,
                        const Eigen::VectorXd& right, int supernodal,
                        int ordering) {
    common_.supernodal = supernodal;
    common_.nmethods = 1;
    common_.method[0].ordering = ordering;
    const int n = static_cast<int>(matrix.rows());
    Eigen::MatrixXd numbers = matrix;
    cholmod_dense dense = Dense(numbers.data(), n, n);
    cholmod_sparse* any = cholmod_dense_to_sparse(&dense, 1, &common_);
    cholmod_sparse* upper = cholmod_copy(any, 1, 1, &common_);
    cholmod_factor* factor = cholmod_analyze(upper, &common_);
    cholmod_factorize(upper, factor, &common_);
    Eigen::VectorXd rhs = right;
    cholmod_dense b = Dense(rhs.data(), n, 1);
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor, &b, &common_);
    const Eigen::VectorXd solution =
        Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(x->x), n);
    EXPECT_EQ(common_.status, CHOLMOD_OK);
    cholmod_free_dense(&x, &common_);
    cholmod_free_factor(&factor, &common_);
    cholmod_free_sparse(&upper, &common_);
    cholmod_free_sparse(&any, &common_);
    return solution;
  }

  static cholmod_dense Dense(double* numbers, int rows, int columns) {
    cholmod_dense dense = {};
    dense.nrow = static_cast<std::size_t>(rows);
    dense.ncol = static_cast<std::size_t>(columns);
    dense.d = dense.nrow;
    dense.nzmax = dense.nrow * dense.ncol;
    dense.x = numbers;
    dense.xtype = CHOLMOD_REAL;
    dense.dtype = CHOLMOD_DOUBLE;
    return dense;
  }

 private:
  cholmod_common common_;
};

bool IsLoaded(const char* library) {
  void* const handle = dlopen(library, RTLD_LAZY | RTLD_NOLOAD);
  if (handle != nullptr) dlclose(handle);
  return handle != nullptr;
}

// Each test runs in a process of its own.

TEST(LateAlgebraTest, NothingIsLoadedBeforeItIsCalled) {
  const Eigen::MatrixXd matrix = DenseMatrix();
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, -1.0, 2.0);
  const Eigen::VectorXd solution =
      Cholmod().Solve(matrix, right, CHOLMOD_SIMPLICIAL, CHOLMOD_AMD);
  EXPECT_LT((matrix * solution - right).norm(), 1e-9);
  for (const char* library : {"libblas.so.3", "liblapack.so.3", "libmetis.so.5",
                              "libgomp.so.1", "libcholmod.so.3"}) {
    EXPECT_FALSE(IsLoaded(library)) << library;
  }
}

TEST(LateAlgebraTest, SupernodesAreFactorizedByBlasAndLapack) {
  const Eigen::MatrixXd matrix = DenseMatrix();
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, -1.0, 2.0);
  const SerialOpenMp serial;
  const Eigen::VectorXd solution =
      Cholmod().Solve(matrix, right, CHOLMOD_SUPERNODAL, CHOLMOD_AMD);
  EXPECT_LT((solution - matrix.llt().solve(right)).norm(), 1e-9);
  EXPECT_TRUE(IsLoaded("libblas.so.3"));
  EXPECT_TRUE(IsLoaded("liblapack.so.3"));
}

TEST(LateAlgebraTest, RegionsOfOpenMpGiveTheSameBytes) {
  const Eigen::MatrixXd matrix = DenseMatrix();
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, -1.0, 2.0);
  Eigen::VectorXd alone;
  {
    const SerialOpenMp serial;
    alone = Cholmod().Solve(matrix, right, CHOLMOD_SUPERNODAL, CHOLMOD_AMD);
  }
  EXPECT_EQ(Cholmod().Solve(matrix, right, CHOLMOD_SUPERNODAL, CHOLMOD_AMD),
            alone);
}

TEST(LateAlgebraTest, MetisOrdersColumns) {
  const Eigen::MatrixXd matrix = DenseMatrix();
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, -1.0, 2.0);
  const Eigen::VectorXd solution =
      Cholmod().Solve(matrix, right, CHOLMOD_SIMPLICIAL, CHOLMOD_METIS);
  EXPECT_LT((matrix * solution - right).norm(), 1e-9);
  EXPECT_TRUE(IsLoaded("libmetis.so.5"));
}

// Residuals (x1, x2, x1 + x2) minus (1, 2, 6): least at x = (2, 3).
struct Plane {
  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    residuals[0] = x[0] - 1.0;
    residuals[1] = x[1] - 2.0;
    residuals[2] = x[0] + x[1] - 6.0;
    return true;
  }
};

TEST(LateAlgebraTest, CeresSolvesDenseProblemsByLapack) {
  for (const ceres::LinearSolverType type :
       {ceres::DENSE_QR, ceres::DENSE_NORMAL_CHOLESKY}) {
    double x[2] = {10.0, -10.0};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Plane, 3, 2>(new Plane), nullptr, x);
    ceres::Solver::Options options;
    options.linear_solver_type = type;
    options.dense_linear_algebra_library_type = ceres::LAPACK;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_TRUE(summary.IsSolutionUsable()) << summary.message;
    EXPECT_NEAR(x[0], 2.0, 1e-6);
    EXPECT_NEAR(x[1], 3.0, 1e-6);
  }
}

TEST(LateAlgebraTest, SpqrSolvesLeastSquares) {
  constexpr int kColumns = 40;
  Eigen::MatrixXd numbers = DenseMatrix().leftCols(kColumns);
  Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kSize, -1.0, 2.0);
  const Eigen::VectorXd expected =
      (numbers.transpose() * numbers).llt().solve(numbers.transpose() * right);
  cholmod_common common;
  cholmod_l_start(&common);
  cholmod_dense dense = Cholmod::Dense(numbers.data(), kSize, kColumns);
  cholmod_dense b = Cholmod::Dense(right.data(), kSize, 1);
  cholmod_sparse* matrix = cholmod_l_dense_to_sparse(&dense, 1, &common);
  cholmod_dense* x = SuiteSparseQR_C_backslash_default(matrix, &b, &common);
  ASSERT_NE(x, nullptr);
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(static_cast<const double*>(x->x),
                                               kColumns) -
             expected)
                .norm(),
            1e-8);
  cholmod_l_free_dense(&x, &common);
  cholmod_l_free_sparse(&matrix, &common);
  cholmod_l_finish(&common);
}

// 4 x1 + 2 x2 = 2 and 2 x1 + 3 x2 = 5: x1 = -0.5, x2 = 2. The factor of
// [4 2; 2 3] is [2 0; 1 sqrt(2)].
TEST(LateAlgebraTest, LapackHasItsArgumentsInOrder) {
  std::vector<double> matrix = {4.0, 2.0, 2.0, 3.0};
  std::vector<double> right = {2.0, 5.0};
  char lower = 'L';
  int two = 2;
  int one = 1;
  int info = -1;
  dpotrf_(&lower, &two, matrix.data(), &two, &info);
  EXPECT_EQ(info, 0);
  EXPECT_DOUBLE_EQ(matrix[0], 2.0);
  EXPECT_DOUBLE_EQ(matrix[1], 1.0);
  EXPECT_DOUBLE_EQ(matrix[3], std::sqrt(2.0));
  dpotrs_(&lower, &two, &one, matrix.data(), &two, right.data(), &two, &info);
  EXPECT_EQ(info, 0);
  EXPECT_DOUBLE_EQ(right[0], -0.5);
  EXPECT_DOUBLE_EQ(right[1], 2.0);
}

}  // namespace
}  // namespace plumbline
