// Draws of the state's path have the smoother's mean and covariance.
#include "lib/filter/simulation_smoother.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/filter/simulation.h"
#include "lib/filter/smoother.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

StateSpace with_input() {
  StateSpace m;
  m.A = (MatrixXd(2, 2) << 0.9, 0.3, 0, 0.7).finished();
  m.B = Eigen::Vector2d(0.5, 0.1);
  m.C = (MatrixXd(1, 2) << 1, 0.2).finished();
  m.D = MatrixXd::Constant(1, 1, 0.3);
  m.G = MatrixXd::Identity(2, 2);
  m.Q = Eigen::Vector2d(0.4, 0.2).asDiagonal();
  m.R = MatrixXd::Constant(1, 1, 0.5);
  m.S = Eigen::Vector2d(0.1, 0.05);
  m.x0 = Eigen::Vector2d(3, -1);
  m.P0 = Eigen::Vector2d(1, 2).asDiagonal();
  return m;
}

// 1500 draws: a mean is off by more than 4.5 standard errors once in 150,000 times, and there are 120
// of them; variances likewise.
void expect_moments_of_the_smoother(InitialState initial) {
  const StateSpace m = with_input();
  constexpr Index N = 20, kDraws = 1500;
  Random random(11);
  MatrixXd u(1, N);
  for (Index t = 0; t < N; ++t) u(0, t) = std::sin(0.5 * static_cast<double>(t));
  MatrixXd y = simulate_outputs(m, initial, u, N, random);
  y(0, 9) = std::nan("");
  const SmootherResult smoothed = smooth(m, initial, y, u);
  ASSERT_EQ(smoothed.status, FilterStatus::ok);
  MatrixXd sum = MatrixXd::Zero(2, N), squares = sum;
  double next = 0.0;
  for (Index k = 0; k < kDraws; ++k) {
    const SimulatedPath path = simulate_path(m, initial, y, u, random);
    ASSERT_EQ(path.status, FilterStatus::ok);
    const MatrixXd off = path.x - smoothed.x;
    sum += off;
    squares += off.cwiseAbs2();
    next += off(0, 5) * off(0, 6);
  }
  for (Index t = 0; t < N; ++t) {
    for (Index i = 0; i < 2; ++i) {
      const double sd = smoothed.sd(i, t);
      EXPECT_LT(std::abs(sum(i, t) / kDraws) / sd * std::sqrt(1.0 * kDraws), 4.5);
      EXPECT_LT(std::abs(squares(i, t) / kDraws / (sd * sd) - 1.0) * std::sqrt(0.5 * kDraws), 4.5);
    }
  }
  // Neighbours belong together: a path is no set of independent draws.
  EXPECT_GT(next / kDraws / (smoothed.sd(0, 5) * smoothed.sd(0, 6)), 0.2);
}

TEST(SimulationSmoother, HasTheSmoothersMomentsFromAGivenStart) {
  expect_moments_of_the_smoother(InitialState::given);
}
TEST(SimulationSmoother, HasTheSmoothersMomentsFromAStationaryStart) {
  expect_moments_of_the_smoother(InitialState::stationary);
}
TEST(SimulationSmoother, HasTheSmoothersMomentsFromADiffuseStart) {
  expect_moments_of_the_smoother(InitialState::diffuse);
}

}  // namespace
}  // namespace identikal
