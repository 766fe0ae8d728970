#include "lib/model/discretise.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <unsupported/Eigen/MatrixFunctions>

#include "lib/base/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

StateSpace random_continuous(std::uint64_t seed, Index n) {
  Random random(seed);
  StateSpace m = random_model(random, n, 1, 1, n);
  m.A = random_matrix(random, n, n) - 2.0 * MatrixXd::Identity(n, n);
  m.S.setZero();
  return m;
}

TEST(Discretise, DoubleIntegratorInClosedForm) {
  StateSpace m;
  m.A = (MatrixXd(2, 2) << 0, 1, 0, 0).finished();
  m.B = m.G = Eigen::Vector2d(0, 1);
  m.C = Eigen::RowVector2d(1, 0);
  m.D = MatrixXd::Zero(1, 1);
  m.Q = MatrixXd::Constant(1, 1, 3.0);
  m.R = MatrixXd::Identity(1, 1);
  m.S = MatrixXd::Zero(1, 1);
  const double h = 0.2;
  const StateSpace d = discretise(m, ProcessNoise::density, h);
  EXPECT_TRUE(d.A.isApprox((MatrixXd(2, 2) << 1, h, 0, 1).finished(), 1e-14));
  EXPECT_TRUE(d.B.isApprox(Eigen::Vector2d(h * h / 2, h), 1e-14));
  const MatrixXd Qd = (MatrixXd(2, 2) << h * h * h / 3, h * h / 2, h * h / 2, h).finished() * 3.0;
  EXPECT_TRUE(d.Q.isApprox(Qd, 1e-13));
  EXPECT_EQ(d.dt, h);
  const StateSpace per_sample = discretise(m, ProcessNoise::per_sample, h);
  EXPECT_EQ(per_sample.Q, m.Q);
  EXPECT_EQ(per_sample.G, m.G);
}

TEST(Discretise, EqualsTheIntegralsByQuadrature) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto n = static_cast<Index>(1 + seed % 4);
    const StateSpace m = random_continuous(seed, n);
    const double h = 0.3;
    const StateSpace d = discretise(m, ProcessNoise::density, h);
    // Simpson's rule.
    const int steps = 400;
    MatrixXd Gamma = MatrixXd::Zero(n, 1), Qd = MatrixXd::Zero(n, n);
    for (int i = 0; i <= steps; ++i) {
      const double s = h * i / steps;
      const double weight = (i == 0 || i == steps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * h / steps / 3.0;
      const MatrixXd e = (s * m.A).exp();
      Gamma += weight * e * m.B;
      Qd += weight * e * m.G * m.Q * m.G.transpose() * e.transpose();
    }
    EXPECT_TRUE(d.B.isApprox(Gamma, 1e-10));
    EXPECT_TRUE(d.Q.isApprox(Qd, 1e-10));
  }
}

TEST(Discretise, FastPolesKeepTheirDigits) {
  // A = T diag(p) T^-1: Qd_ij = V_ij (1 - e^((p_i + p_j) h)) / -(p_i + p_j) in those coordinates.
  double worst = 0.0;
  for (const double fast : {20.0, 40.0, 60.0, 800.0}) {
    StateSpace m = random_continuous(3, 2);
    const Eigen::Matrix2d T = (Eigen::Matrix2d() << 1, 0.4, -0.3, 1).finished();
    const Eigen::Vector2d p(-fast, -1.0);
    m.A = T * p.asDiagonal() * T.inverse();
    m.B = m.B.topRows(2).eval(), m.C = m.C.leftCols(2).eval();
    m.G.setIdentity(2, 2);
    m.Q.setIdentity(2, 2);
    m.S = MatrixXd::Zero(2, 1);
    Eigen::Matrix2d V = T.inverse() * T.inverse().transpose();
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) V(i, j) *= std::expm1(p[i] + p[j]) / (p[i] + p[j]);
    }
    const MatrixXd expected = T * V * T.transpose();
    const MatrixXd Q = discretise(m, ProcessNoise::density, 1.0).Q;
    worst = std::max(worst, (Q - expected).norm() / expected.norm());
    // The derivative in the direction of Q is the integral itself.
    StateSpace by = m;
    by.A.setZero(), by.B.setZero(), by.C.setZero(), by.D.setZero(), by.G.setZero(), by.R.setZero();
    const MatrixXd dQ = discretise_derivative(m, by, ProcessNoise::density, 1.0).Q;
    worst = std::max(worst, (dQ - expected).norm() / expected.norm());
  }
  EXPECT_LT(worst, 1e-12);
}

TEST(Discretise, InputsHeldLinearly) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto n = static_cast<Index>(1 + seed % 4);
    const StateSpace m = random_continuous(seed, n);
    const double h = 0.3;
    const StateSpace d = discretise(m, ProcessNoise::density, h, InputHold::linear);
    // x(h) of dx/dt = A x + B (u0 + (u1 - u0) s / h) in many exact steps with u constant, each at
    // its middle: of second order in the step.
    const double u0 = 0.7, u1 = -1.3;
    const int steps = 20000;
    const StateSpace small = discretise(m, ProcessNoise::density, h / steps);
    VectorXd x = VectorXd::LinSpaced(n, 1.0, 2.0);
    const VectorXd expected = d.A * x + d.B * Eigen::Vector2d(u0, u1);
    for (int i = 0; i < steps; ++i) {
      x = small.A * x + small.B * (u0 + (u1 - u0) * (i + 0.5) / steps);
    }
    EXPECT_LT((x - expected).norm(), 1e-9);
    EXPECT_EQ(d.D.rightCols(1), MatrixXd::Zero(1, 1));
  }
}

TEST(Discretise, DerivativesMatchDifferences) {
  for (const auto& way : {std::pair{ProcessNoise::density, InputHold::constant},
                          std::pair{ProcessNoise::per_sample, InputHold::linear}}) {
    const ProcessNoise noise = way.first;
    const InputHold hold = way.second;
    const StateSpace m = random_continuous(7, 3);
    Random random(9);
    StateSpace by = random_direction(random, m);
    by.S.setZero();
    const double h = 1e-5;
    const auto moved = [&](double by_how_much) {
      StateSpace out = m;
      out.A += by_how_much * by.A, out.B += by_how_much * by.B, out.G += by_how_much * by.G;
      out.Q += by_how_much * by.Q, out.D += by_how_much * by.D;
      return discretise(out, noise, 0.1, hold);
    };
    const StateSpace up = moved(h), down = moved(-h);
    const StateSpace d = discretise_derivative(m, by, noise, 0.1, hold);
    EXPECT_LT(((up.A - down.A) / (2 * h) - d.A).norm(), 1e-8);
    EXPECT_LT(((up.B - down.B) / (2 * h) - d.B).norm(), 1e-8);
    EXPECT_LT(((up.D - down.D) / (2 * h) - d.D).norm(), 1e-8);
    EXPECT_LT(((up.G - down.G) / (2 * h) - d.G).norm(), 1e-8);
    EXPECT_LT(((up.Q - down.Q) / (2 * h) - d.Q).norm(), 1e-7);
  }
}

TEST(Discretise, RefusesWhatHasNoMeaning) {
  StateSpace m = random_continuous(1, 2);
  EXPECT_THROW(discretise(m, ProcessNoise::density, 0.0), std::invalid_argument);
  m.S.setOnes();
  EXPECT_THROW(discretise(m, ProcessNoise::density, 0.1), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
