// Second derivatives by differences in which coordinates that have nothing in common move together.
#include "solvers/covariance.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "solvers/internal/matrix_root.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

int evaluations = 0;

// The slope of -1/2 sum_i (x_0 exp(x_i) - i)^2 - 1/4 sum x_i^4: x_0 is in all terms, each other x_i in its own.
bool slope(const VectorXd& x, VectorXd& g) {
  ++evaluations;
  g = -x.array().cube().matrix();
  for (Index i = 1; i < x.size(); ++i) {
    const double e = std::exp(x[i]), r = x[0] * e - static_cast<double>(i);
    g[0] -= r * e;
    g[i] -= r * x[0] * e;
  }
  return true;
}

TEST(ObservedInformation, IsTheSameWhereOwnersMoveTogether) {
  constexpr Index kOwners = 12;
  const VectorXd x = VectorXd::LinSpaced(kOwners + 1, 0.9, 0.2);
  const VectorXd step = VectorXd::Constant(x.size(), 1e-4);
  std::vector<Index> owner{-1};
  for (Index i = 0; i < kOwners; ++i) owner.push_back(i);
  evaluations = 0;
  const auto one_by_one = observed_information(slope, x, step);
  EXPECT_EQ(evaluations, 2 * (kOwners + 1));
  evaluations = 0;
  const auto together = observed_information(slope, x, step, owner);
  EXPECT_EQ(evaluations, 4);
  ASSERT_TRUE(one_by_one && together);
  EXPECT_LT((*one_by_one - *together).cwiseAbs().maxCoeff(), 1e-6);
}

// Steps of many unknowns go by a triangular root: the maximum is that of the same problem in parts.
TEST(ObservedInformation, ASearchOfManyUnknownsEndsWhereItsPartsDo) {
  constexpr Index kMany = 150;
  const VectorXd target = VectorXd::LinSpaced(kMany, -2.0, 3.0);
  LikelihoodProblem problem;
  problem.lower = VectorXd::Constant(kMany, -HUGE_VAL);
  problem.upper = -problem.lower;
  problem.evaluate = [&](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const VectorXd r = x.array().sinh().matrix() - target, by = x.array().cosh();
    L = -0.5 * r.squaredNorm();
    if (g != nullptr) *g = -by.cwiseProduct(r);
    if (J != nullptr) *J = by.cwiseAbs2().asDiagonal();
    return true;
  };
  const Solution found = maximise(problem, VectorXd::Zero(kMany));
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  EXPECT_LT((found.x.array().sinh().matrix() - target).cwiseAbs().maxCoeff(), 1e-5);
}

// Two unknowns of all, others of owners who have one or two each, scaled to unit diagonal.
MatrixXd arrow(Index owners, double link) {
  const Index n = 2 + owners + owners / 2;
  MatrixXd M = MatrixXd::Identity(n, n);
  const auto set = [&M](Index i, Index j, double value) { M(i, j) = M(j, i) = value; };
  set(0, 1, 0.3);
  for (Index i = 2; i < n; ++i) {
    set(0, i, link * std::sin(static_cast<double>(i)));
    set(1, i, link * std::cos(static_cast<double>(i)));
  }
  for (Index i = 0; i < owners / 2; ++i) set(2 + i, 2 + owners + i, 0.4);
  return M;
}

TEST(LargeInformation, HasTheInverseAndTheEndsOfItsSpectrumThatEigenvectorsGive) {
  for (const double share : {0.2, 0.9}) {
    const Index owners = 200;
    const MatrixXd M = arrow(owners, std::sqrt(share * 0.5 / static_cast<double>(owners)));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M);
    ASSERT_GT(eigen.eigenvalues()[0], 0.0);
    const auto ends = extreme_eigenvalues(M);
    ASSERT_TRUE(ends);
    EXPECT_NEAR((*ends)[0] / eigen.eigenvalues()[0], 1.0, 1e-9);
    EXPECT_NEAR((*ends)[1] / eigen.eigenvalues()[M.rows() - 1], 1.0, 1e-9);
    const VectorXd units = VectorXd::LinSpaced(M.rows(), 1e-3, 1e4);
    const auto inverse = scaled_inverse(units.asDiagonal() * M * units.asDiagonal());
    ASSERT_TRUE(inverse);
    const MatrixXd product = units.asDiagonal() * *inverse * units.asDiagonal() * M;
    EXPECT_LT((product - MatrixXd::Identity(M.rows(), M.rows())).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// One with entries everywhere takes the other root.
TEST(LargeInformation, WithoutZerosIsInvertedToo) {
  MatrixXd M = MatrixXd::Constant(150, 150, 0.3);
  M.diagonal().setOnes();
  const auto ends = extreme_eigenvalues(M);
  ASSERT_TRUE(ends);
  EXPECT_NEAR((*ends)[0], 0.7, 1e-12);
  EXPECT_NEAR((*ends)[1], 0.7 + 0.3 * 150, 1e-10);
  const auto inverse = scaled_inverse(M);
  ASSERT_TRUE(inverse);
  EXPECT_LT((*inverse * M - MatrixXd::Identity(150, 150)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(LargeInformation, OfLostRankIsRefused) {
  MatrixXd M = arrow(200, 0.01);
  M.row(7) = M.row(5);
  M.col(7) = M.col(5);
  M(7, 7) = M(5, 5);
  EXPECT_FALSE(scaled_inverse(M));
}

// Steps of a search: of some coordinates, of one that nothing is known of, with and without zeros.
TEST(LargeInformation, DampedStepsAreThoseOfTheDenseMatrix) {
  for (const bool sparse : {true, false}) {
    MatrixXd M = sparse ? arrow(200, 0.03) : MatrixXd(MatrixXd::Constant(302, 302, 0.3));
    if (!sparse) M.diagonal().setOnes();
    const Index n = M.rows();
    const VectorXd units = VectorXd::LinSpaced(n, 1e-2, 1e3);
    M = units.asDiagonal() * M * units.asDiagonal();
    M.row(9).setZero();
    M.col(9).setZero();
    std::vector<Index> free, known;
    for (Index i = 3; i < n; ++i) {
      free.push_back(i);
      if (i != 9) known.push_back(i);
    }
    const VectorXd d = units.cwiseAbs2() * 0.5,
                   g = units.cwiseProduct(VectorXd::LinSpaced(n, -1, 2));
    DampedRoots roots(M, free, d);
    for (const double lambda : {0.0, 1e-3, 10.0}) {
      MatrixXd damped = M(known, known);
      damped.diagonal() += lambda * VectorXd(d(known));
      const VectorXd expected = damped.ldlt().solve(VectorXd(g(known)));
      const auto step = roots.solve(g, lambda);
      ASSERT_TRUE(step);
      const VectorXd difference = VectorXd((*step)(known)) - expected;
      EXPECT_LT(difference.cwiseQuotient(expected).cwiseAbs().maxCoeff(), 1e-8);
      EXPECT_EQ((*step)[9], 0.0);
      EXPECT_EQ((*step)[1], 0.0);
    }
  }
}

}  // namespace
}  // namespace identikal
