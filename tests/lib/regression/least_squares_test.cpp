#include "lib/regression/least_squares.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// NIST's data set Longley (Statistical Reference Datasets, linear regression, higher difficulty).
MatrixXd longley() {
  MatrixXd data(16, 7);
  data << 60323, 83.0, 234289, 2356, 1590, 107608, 1947,  //
      61122, 88.5, 259426, 2325, 1456, 108632, 1948,      //
      60171, 88.2, 258054, 3682, 1616, 109773, 1949,      //
      61187, 89.5, 284599, 3351, 1650, 110929, 1950,      //
      63221, 96.2, 328975, 2099, 3099, 112075, 1951,      //
      63639, 98.1, 346999, 1932, 3594, 113270, 1952,      //
      64989, 99.0, 365385, 1870, 3547, 115094, 1953,      //
      63761, 100.0, 363112, 3578, 3350, 116219, 1954,     //
      66019, 101.2, 397469, 2904, 3048, 117388, 1955,     //
      67857, 104.6, 419180, 2822, 2857, 118734, 1956,     //
      68169, 108.4, 442769, 2936, 2798, 120445, 1957,     //
      66513, 110.8, 444546, 4681, 2637, 121950, 1958,     //
      68655, 112.6, 482704, 3813, 2552, 123366, 1959,     //
      69564, 114.2, 502601, 3931, 2514, 125368, 1960,     //
      69331, 115.7, 518173, 4806, 2572, 127852, 1961,     //
      70551, 116.9, 554894, 4007, 2827, 130081, 1962;
  return data;
}

TEST(LeastSquares, ReachesTheCertifiedDigitsOfLongley) {
  const MatrixXd data = longley();
  MatrixXd X(16, 7);
  X << VectorXd::Ones(16), data.rightCols(6);
  const LinearLeastSquares fit = least_squares(X, data.col(0));
  const double theta[] = {-3482258.63459582, 15.0618722713733,  -0.358191792925910E-01,
                          -2.02022980381683, -1.03322686717359, -0.511041056535807E-01,
                          1829.15146461355};
  const double se[] = {890420.383607373,  84.9149257747669,  0.334910077722432E-01,
                       0.488399681651699, 0.214274163161675, 0.226073200069370,
                       455.478499142212};
  const MatrixXd errors = standard_errors(fit);
  EXPECT_EQ(fit.rank, 7);
  for (Index i = 0; i < 7; ++i) {
    EXPECT_NEAR(fit.theta(i, 0) / theta[i], 1.0, 1e-9) << i;
    EXPECT_NEAR(errors(i, 0) / se[i], 1.0, 1e-9) << i;
  }
  EXPECT_NEAR(std::sqrt(fit.noise_variance[0]), 304.854073561965, 1e-7);
}

TEST(LeastSquares, WeightsAreCopiesOfSamples) {
  Random random(1);
  const MatrixXd X = random_matrix(random, 12, 3), Y = random_matrix(random, 12, 2);
  VectorXd weights(12);
  weights << 1, 2, 0, 3, 1, 1, 4, 0, 2, 1, 1, 2;
  MatrixXd copies_x(18, 3), copies_y(18, 2);
  Index n = 0;
  for (Index t = 0; t < 12; ++t) {
    for (int k = 0; k < static_cast<int>(weights[t]); ++k, ++n) {
      copies_x.row(n) = X.row(t);
      copies_y.row(n) = Y.row(t);
    }
  }
  ASSERT_EQ(n, 18);
  const LinearLeastSquares a = weighted_least_squares(X, Y, weights);
  const LinearLeastSquares b = least_squares(copies_x, copies_y);
  EXPECT_LT((a.theta - b.theta).norm(), 1e-12);
  EXPECT_LT((a.P - b.P).norm(), 1e-12);
  const MatrixXd normal = (copies_x.transpose() * copies_x).llt().solve(MatrixXd::Identity(3, 3));
  EXPECT_LT((a.P - normal).norm(), 1e-12);
}

TEST(LeastSquares, LossOfRankIsSaid) {
  Random random(2);
  MatrixXd X = random_matrix(random, 40, 4);
  X.col(2) = 1e3 * X.col(0) - 2e3 * X.col(1);
  const VectorXd y = random.normal(40);
  const LinearLeastSquares fit = least_squares(X, y);
  EXPECT_EQ(fit.rank, 3);
  ASSERT_EQ(fit.open.cols(), 1);
  EXPECT_LT((X * fit.open).norm(), 1e-9);
  const MatrixXd se = standard_errors(fit);
  EXPECT_TRUE(std::isnan(se(0, 0)) && std::isnan(se(1, 0)) && std::isnan(se(2, 0)));
  MatrixXd kept(40, 3);
  kept << X.leftCols(2), X.col(3);
  const LinearLeastSquares without = least_squares(kept, y);
  EXPECT_NEAR(se(3, 0), standard_errors(without)(2, 0), 1e-12);
  EXPECT_LT((fit.residuals - without.residuals).norm(), 1e-9);
  EXPECT_TRUE(std::isnan(least_squares(X.topRows(3), y.head(3)).noise_variance[0]));
}

TEST(LeastSquares, RefusesWhatIsNoProblem) {
  const MatrixXd X = MatrixXd::Ones(3, 1);
  const VectorXd y = VectorXd::Ones(3);
  EXPECT_THROW(least_squares(X, y.head(2)), std::invalid_argument);
  EXPECT_THROW(weighted_least_squares(X, y, -y), std::invalid_argument);
  EXPECT_THROW(least_squares(X, std::nan("") * y), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
