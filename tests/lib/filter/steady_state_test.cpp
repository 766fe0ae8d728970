#include "lib/filter/steady_state.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>
#include <unsupported/Eigen/KroneckerProduct>

#include "lib/base/random.h"
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

TEST(DiscreteLyapunov, RefusesShapesThatDisagree) {
  const MatrixXd square = MatrixXd::Zero(2, 2);
  EXPECT_THROW(solve_discrete_lyapunov(MatrixXd::Zero(2, 3), square), std::invalid_argument);
  EXPECT_THROW(solve_discrete_lyapunov(square, MatrixXd::Zero(2, 3)), std::invalid_argument);
}

// x(t+1) = A x + K e, y = C x + e: nothing is left to be estimated, and P is rounding.
TEST(SteadyState, OfOneNoiseForStateAndOutputIsItsOwnGain) {
  Random random(7);
  int solved = 0;
  for (int k = 0; k < 300; ++k) {
    StateSpace model;
    const Index n = 2 + k % 9, ny = 1 + k % 3;
    model.A = random_matrix(random, n, n);
    model.A *= 0.97 / model.A.eigenvalues().cwiseAbs().maxCoeff();
    model.C = random_matrix(random, ny, n);
    model.G = 0.2 * random_matrix(random, n, ny);
    model.B = MatrixXd(n, 0);
    model.D = MatrixXd(ny, 0);
    const MatrixXd root = random_matrix(random, ny, ny);
    model.Q = model.R = model.S = root * root.transpose() + 1e-4 * MatrixXd::Identity(ny, ny);
    if ((model.A - model.G * model.C).eigenvalues().cwiseAbs().maxCoeff() > 0.95) continue;
    const auto steady = steady_state(model);
    ASSERT_TRUE(steady.has_value()) << k;
    EXPECT_LT((steady->K - model.G).norm(), 1e-6 * (1.0 + model.G.norm())) << k;
    ++solved;
  }
  EXPECT_GT(solved, 50);
}

// The same with a predictor that forgets next to nothing, as of lightly damped modes measured with little noise.
TEST(SteadyState, OfOneNoiseIsItsOwnGainHoweverSlowlyThatForgets) {
  Random random(8);
  for (int k = 0; k < 60; ++k) {
    StateSpace model;
    const Index n = 2 + k % 11, ny = 1 + k % 2;
    MatrixXd F = random_matrix(random, n, n);
    F *= (k % 3 == 0 ? 0.999999 : 0.9999) / F.eigenvalues().cwiseAbs().maxCoeff();
    model.C = random_matrix(random, ny, n);
    model.G = 0.1 * random_matrix(random, n, ny);
    model.A = F + model.G * model.C;
    model.B = MatrixXd(n, 0);
    model.D = MatrixXd(ny, 0);
    model.Q = model.R = model.S = 1e-9 * MatrixXd::Identity(ny, ny);
    const auto steady = steady_state(model);
    ASSERT_TRUE(steady.has_value()) << k;
    EXPECT_LT((steady->K - model.G).norm(), 1e-5 * model.G.norm()) << k;
  }
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

// w and v nearly the same noise: P is then a small part of what cancels in it. With S = (1 - eps)
// sqrt(Q R) one state, seen as it is, has P = a'^2 P R / (P + R) + q', a' = a - S / R and
// q' = Q - S^2 / R = Q eps (2 - eps).
TEST(SteadyState, IsFoundForNoisesThatAreNearlyOne) {
  const auto one = [](double x) { return MatrixXd::Constant(1, 1, x); };
  StateSpace m;
  m.A = one(0.9);
  m.C = m.G = one(1.0);
  m.Q = one(1.2);
  m.R = one(0.13);
  double worst = 0.0;
  for (double eps = 0.1; eps > 1e-14; eps /= 10.0) {
    SCOPED_TRACE(eps);
    m.S = one((1.0 - eps) * std::sqrt(1.2 * 0.13));
    const auto s = steady_state(m);
    ASSERT_TRUE(s.has_value());
    const double R = 0.13, a = 0.9 - m.S(0, 0) / R, q = 1.2 * eps * (2.0 - eps);
    const double b = R * (1.0 - a * a) - q;
    const double P = b > 0.0 ? 2.0 * q * R / (b + std::sqrt(b * b + 4.0 * q * R))
                             : (-b + std::sqrt(b * b + 4.0 * q * R)) / 2.0;
    // As far as Q and S tell it.
    EXPECT_NEAR(s->P(0, 0), P, 1e-11 * P + 1e-14);
    worst = std::max(worst, std::abs(s->P(0, 0) - P));
    EXPECT_LT(std::abs(0.9 - s->K(0, 0)), 1.0);
    StateSpace two;
    two.A = MatrixXd{{0.9, 0.2}, {-0.1, 0.8}};
    two.C = MatrixXd{{1.0, 0.0}, {0.3, 1.0}};
    two.G = Eigen::Vector2d(0.5, 1.0);
    two.Q = one(1.2);
    two.R = Eigen::Vector2d(0.13, 1.7).asDiagonal();
    two.S = Eigen::RowVector2d(m.S(0, 0), 0.0);
    const auto t = steady_state(two);
    ASSERT_TRUE(t.has_value());
    EXPECT_LT((two.A - t->K * two.C).eigenvalues().cwiseAbs().maxCoeff(), 0.9);
    EXPECT_GT(t->P.eigenvalues().real().minCoeff(), -1e-14);
  }
  std::printf("off by %.1e at most, of noise of 1.2\n", worst);
}

// (1 - z)(1 - z^s) y = (1 + m z)(1 + M z^s) e without measurement noise: in the end everything is known
// but the next e, and the gain is 1 in e(t - 1) and in y(t - 1), which move with y(t).
TEST(SteadyState, IsFoundForSeasonalDifferencesSeenWithoutNoise) {
  constexpr Index kSeason = 12, kErrors = kSeason + 2, kBefore = kSeason + 1, n = kErrors + kBefore;
  const double m = -0.4, M = -0.6;
  StateSpace s;
  s.A = MatrixXd::Zero(n, n);
  s.C = MatrixXd::Zero(1, n);
  s.C(0, 0) = 1.0, s.C(0, 1) = m, s.C(0, kSeason) = M, s.C(0, kSeason + 1) = m * M;
  s.C(0, kErrors) = 1.0, s.C(0, kErrors + kSeason - 1) = 1.0, s.C(0, kErrors + kSeason) = -1.0;
  for (Index i = 1; i < n; ++i) s.A(i, i - 1) = 1.0;
  s.A.row(kErrors) = s.C;
  s.G = MatrixXd::Identity(n, 1);
  s.Q = MatrixXd::Constant(1, 1, 0.0013);
  s.R = MatrixXd::Zero(1, 1);
  s.S = MatrixXd::Zero(1, 1);
  const auto steady = steady_state(s);
  ASSERT_TRUE(steady.has_value());
  Eigen::VectorXd K = Eigen::VectorXd::Zero(n);
  K[1] = K[kErrors] = 1.0;
  EXPECT_LT((steady->K - K).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(steady->Sigma(0, 0), 0.0013, 1e-14);
}

// One noise, and a zero of its way to the output outside of the circle: P = 0 solves the equation with an
// unstable filter. By hand: (1 - 2 z) e / (1 - 0.8 z) has the spectrum of 4 times (1 - 0.5 z) e / (1 - 0.8 z).
TEST(SteadyState, MirrorsZerosOfOneNoise) {
  const auto one = [](double x) { return MatrixXd::Constant(1, 1, x); };
  StateSpace s;
  s.A = one(0.8), s.C = one(1.0), s.G = one(-1.2);
  s.Q = s.R = s.S = one(0.7);
  const auto steady = steady_state(s);
  ASSERT_TRUE(steady.has_value());
  EXPECT_NEAR(steady->K(0, 0), 0.8 - 0.5, 1e-12);
  EXPECT_NEAR(steady->Sigma(0, 0), 4.0 * 0.7, 1e-12);
  // Two outputs: the noise of the one has such a zero, that of the other has not.
  StateSpace two;
  two.A = MatrixXd{{0.8, 0.1}, {0.0, 0.5}};
  two.C = two.G = MatrixXd::Identity(2, 2);
  two.G(0, 0) = -1.2;
  two.Q = MatrixXd{{0.7, 0.2}, {0.2, 0.4}};
  two.R = two.S = two.Q;
  const auto of_two = steady_state(two);
  ASSERT_TRUE(of_two.has_value());
  EXPECT_LT((two.A - of_two->K * two.C).eigenvalues().cwiseAbs().maxCoeff(), 0.99);
  // The outputs' covariance is that of before.
  const auto covariance = [&](const MatrixXd& K, const MatrixXd& Sigma) -> MatrixXd {
    const auto P = solve_discrete_lyapunov(two.A, K * Sigma * K.transpose());
    return two.C * P.value() * two.C.transpose() + Sigma;
  };
  EXPECT_LT((covariance(of_two->K, of_two->Sigma) - covariance(two.G, two.Q)).norm(), 1e-11);
}

}  // namespace
}  // namespace identikal
