// The stationary covariance of a register by its autocovariances, against the equation that it solves.
#include "lib/internal/stationary_start.h"

#include <vector>

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A register of 1 - phi z - ... = (1 - root z)(1 - root z^season).
MatrixXd seasonal_register(double root, Index season) {
  MatrixXd A = MatrixXd::Zero(season + 1, season + 1);
  for (Index i = 1; i <= season; ++i) A(i, i - 1) = 1.0;
  A(0, 0) = root;
  A(0, season - 1) += root;
  A(0, season) = -root * root;
  return A;
}

MatrixXd first_alone(Index n, double variance) {
  MatrixXd W = MatrixXd::Zero(n, n);
  W(0, 0) = variance;
  return W;
}

// How far P is from A P A' + W, against its size.
double defect(const MatrixXd& P, const MatrixXd& A, const MatrixXd& W) {
  return (P - A * P * A.transpose() - W).cwiseAbs().maxCoeff() / P.cwiseAbs().maxCoeff();
}

TEST(StationaryStart, OfARegisterSolvesTheEquation) {
  for (const double root : {-0.5, 0.3, 0.8, 0.9}) {
    for (const Index season : {2, 4, 12}) {
      SCOPED_TRACE(testing::Message() << root << " " << season);
      const MatrixXd A = seasonal_register(root, season), W = first_alone(season + 1, 0.7);
      StationaryStart start;
      ASSERT_TRUE(start.compute(A, W));
      EXPECT_LT(defect(start.P(), A, W), 1e-14);
      EXPECT_LT((start.PA() - start.P() * A.transpose()).cwiseAbs().maxCoeff(),
                1e-14 * start.P()(0, 0));
      MatrixXd dA = MatrixXd::Zero(season + 1, season + 1);
      dA.row(0).setLinSpaced(0.1, -0.3);
      const MatrixXd dW = first_alone(season + 1, 0.2);
      ASSERT_TRUE(start.is_quick(dA, dW));
      const MatrixXd dP = start.derivative(dA, dW), half = dA * start.PA();
      EXPECT_LT(defect(dP, A, half + half.transpose() + dW), 1e-13);
    }
  }
}

// The same numbers as by powers, which a state more that nothing drives makes it take.
TEST(StationaryStart, OfARegisterIsThatByPowers) {
  const MatrixXd A = seasonal_register(0.8, 4), W = first_alone(5, 1.3);
  MatrixXd more = MatrixXd::Zero(6, 6), driven = MatrixXd::Zero(6, 6);
  more.topLeftCorner(5, 5) = A;
  driven.topLeftCorner(5, 5) = W;
  StationaryStart quick, by_powers;
  ASSERT_TRUE(quick.compute(A, W));
  ASSERT_TRUE(by_powers.compute(more, driven));
  EXPECT_FALSE(by_powers.is_quick(MatrixXd::Zero(6, 6), driven));
  EXPECT_LT((quick.P() - by_powers.P().topLeftCorner(5, 5)).cwiseAbs().maxCoeff(),
            1e-12 * quick.P()(0, 0));
  // A derivative that is none of a register: the last state gets another gain.
  MatrixXd dA = MatrixXd::Zero(5, 5);
  dA(4, 3) = 1.0;
  const MatrixXd dP = quick.derivative(dA, MatrixXd::Zero(5, 5)), half = dA * quick.PA();
  EXPECT_LT(defect(dP, A, half + half.transpose()), 1e-13);
}

TEST(StationaryStart, NearTheUnitCircleIsByPowers) {
  StationaryStart start;
  const MatrixXd A = seasonal_register(0.99, 4), W = first_alone(5, 1.0);
  ASSERT_TRUE(start.compute(A, W));
  EXPECT_FALSE(start.is_quick(MatrixXd::Zero(5, 5), W));
  EXPECT_LT(defect(start.P(), A, W), 1e-10);
}

TEST(StationaryStart, ThereIsNoneOfAnUnstableRegister) {
  StationaryStart start;
  for (const double root : {1.0, 1.02, -1.5}) {
    EXPECT_FALSE(start.compute(seasonal_register(root, 4), first_alone(5, 1.0))) << root;
  }
  EXPECT_TRUE(start.compute(seasonal_register(0.5, 4), first_alone(5, 1.0)));
}

}  // namespace
}  // namespace identikal
