#include "lib/matrix_equations.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>
#include <unsupported/Eigen/KroneckerProduct>

#include "lib/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

TEST(DiscreteLyapunov, EqualsTheKroneckerSolution) {
  Random random(1);
  for (const double radius : {0.3, 0.9, 0.999}) {
    for (Index n = 1; n <= 6; ++n) {
      MatrixXd A = random_matrix(random, n, n);
      A *= radius / A.eigenvalues().cwiseAbs().maxCoeff();
      const MatrixXd W = random_matrix(random, n, n);  // not symmetric on purpose
      const MatrixXd big = MatrixXd::Identity(n * n, n * n) - Eigen::kroneckerProduct(A, A).eval();
      const Eigen::VectorXd direct = big.fullPivLu().solve(W.reshaped());
      const auto P = solve_discrete_lyapunov(A, W);
      ASSERT_TRUE(P.has_value());
      EXPECT_TRUE(P->reshaped().isApprox(direct, 1e-10)) << radius << " " << n;
    }
  }
}

TEST(DiscreteLyapunov, RefusesWhatIsNotStable) {
  EXPECT_FALSE(
      solve_discrete_lyapunov(MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2)).has_value());
  EXPECT_FALSE(solve_discrete_lyapunov(1.01 * MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2))
                   .has_value());
}

TEST(SteadyState, SatisfiesTheRiccatiEquation) {
  StateSpace m;
  m.A = (MatrixXd(2, 2) << 1, 1, 0, 1).finished();  // integrators
  m.C = Eigen::RowVector2d(1, 0);
  m.G = MatrixXd::Identity(2, 2);
  m.Q = Eigen::Vector2d(0.1, 0.01).asDiagonal();
  m.R = MatrixXd::Constant(1, 1, 2.0);
  m.S = Eigen::Vector2d(0.05, 0.02);
  const auto s = steady_state(m);
  ASSERT_TRUE(s.has_value());
  const MatrixXd Sigma = m.C * s->P * m.C.transpose() + m.R;
  const MatrixXd K = (m.A * s->P * m.C.transpose() + m.S) / Sigma(0, 0);
  const MatrixXd next = m.A * s->P * m.A.transpose() + m.Q - K * Sigma * K.transpose();
  EXPECT_TRUE(next.isApprox(s->P, 1e-11));
  EXPECT_LT((m.A - s->K * m.C).eigenvalues().cwiseAbs().maxCoeff(), 1.0);
}

}  // namespace
}  // namespace identikal
