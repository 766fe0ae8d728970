#include "lib/filter/internal/common_factor.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/likelihood.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A level with a slope and a season of twelve; four variances, one of them zero where asked.
StateSpace structural(bool still) {
  StateSpace m;
  m.A = MatrixXd::Zero(13, 13);
  m.A(0, 0) = m.A(0, 1) = m.A(1, 1) = 1.0;
  m.A.row(2).tail(11).setConstant(-1.0);
  for (Index i = 3; i < 13; ++i) m.A(i, i - 1) = 1.0;
  m.C = MatrixXd::Zero(1, 13);
  m.C(0, 0) = m.C(0, 2) = 1.0;
  m.G = MatrixXd::Identity(13, 3);
  m.Q = VectorXd{{0.02, still ? 0.0 : 1e-7, 3e-4}}.asDiagonal();
  m.R = MatrixXd::Constant(1, 1, 0.5);
  m.S = MatrixXd::Zero(3, 1);
  m.B = MatrixXd(13, 0), m.D = MatrixXd(1, 0);
  m.x0 = VectorXd::Zero(13), m.P0 = MatrixXd::Zero(13, 13);
  return m;
}

StateSpace nothing(StateSpace m) {
  for (MatrixXd* M : {&m.A, &m.B, &m.C, &m.D, &m.G, &m.Q, &m.R, &m.S, &m.P0}) M->setZero();
  m.x0.setZero();
  return m;
}

std::vector<StateSpace> by_variances(const StateSpace& m) {
  std::vector<StateSpace> out(4, nothing(m));
  for (Index i = 0; i < 3; ++i) out[static_cast<std::size_t>(i)].Q(i, i) = 1.0;
  out[3].R(0, 0) = 1.0;
  return out;
}

TEST(CommonFactor, IsFoundWhereAllNoiseIsFree) {
  const StateSpace m = structural(false);
  std::vector<StateSpace> by = by_variances(m);
  const auto factor = common_factor(m, by);
  ASSERT_TRUE(factor.has_value());
  EXPECT_NEAR(factor->weights[1], 1e-7, 1e-20);
  EXPECT_NEAR(factor->weights[3], 0.5, 1e-14);
  EXPECT_EQ(factor->left_out, 3u);
  // As standard deviations they weigh half of them.
  for (StateSpace& d : by) d.Q *= 2.0 * 0.1, d.R *= 2.0 * 0.1;
  EXPECT_NEAR(common_factor(m, by)->weights[3], 2.5, 1e-13);
  by = by_variances(m);
  StateSpace silent = m;
  silent.Q.setZero(), silent.R.setZero();
  EXPECT_FALSE(common_factor(silent, by).has_value());  // there is no noise to grow
  by.pop_back();
  EXPECT_FALSE(common_factor(m, by).has_value());  // R is known
  by = by_variances(m);
  by[0].A(0, 0) = 1.0;
  EXPECT_FALSE(common_factor(m, by).has_value());
}

// Against the full recursion, with a gap and a variance that is zero.
TEST(CommonFactor, WhatFollowsIsWhatTheRecursionFinds) {
  for (const bool still : {false, true}) {
    const StateSpace m = structural(still);
    const std::vector<StateSpace> by = by_variances(m);
    Random random(still ? 2 : 1);
    const MatrixXd u(0, 300);
    MatrixXd y = simulate_outputs(random, m, u, 300);
    y.middleCols(100, 7).setConstant(kNaN);
    LikelihoodEngine engine, whole;
    engine.add_recording(y, u), whole.add_recording(y, u);
    const Likelihood a = engine.evaluate(m, InitialState::diffuse, by);
    const Likelihood b =
        whole.evaluate(m, InitialState::diffuse, by, EvaluationMethod::time_varying);
    ASSERT_EQ(a.status, FilterStatus::ok);
    EXPECT_NEAR(a.value, b.value, 1e-9 * std::abs(b.value));
    for (Index i = 0; i < 4; ++i) {
      const double se = 1.0 / std::sqrt(b.information(i, i));
      EXPECT_NEAR(a.gradient[i] * se, b.gradient[i] * se, 1e-8) << i;
      for (Index j = 0; j < 4; ++j) {
        const double size = std::sqrt(b.information(i, i) * b.information(j, j));
        EXPECT_NEAR(a.information(i, j) / size, b.information(i, j) / size, 1e-7) << i << j;
      }
    }
  }
}

}  // namespace
}  // namespace identikal
