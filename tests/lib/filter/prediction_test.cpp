// Predictions several steps ahead are the conditional means of the joint normal density of all
// outputs.
#include "lib/filter/prediction.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/filter/steady_state.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(Prediction, IsTheConditionalMean) {
  constexpr Index N = 9, n = 2, ny = 2;
  StateSpace m;
  m.A = (MatrixXd(n, n) << 0.8, 0.3, -0.2, 0.7).finished();
  m.B = Eigen::Vector2d(0.5, -1.0);
  m.C = (MatrixXd(ny, n) << 1.0, 0.0, 0.4, 1.0).finished();
  m.D = Eigen::Vector2d(0.1, 0.3);
  m.G = MatrixXd::Identity(n, n);
  m.Q = (MatrixXd(n, n) << 1.0, 0.2, 0.2, 0.5).finished();
  m.R = (MatrixXd(ny, ny) << 0.4, 0.1, 0.1, 0.3).finished();
  m.S = (MatrixXd(n, ny) << 0.1, 0.0, -0.05, 0.1).finished();
  MatrixXd u(1, N), y(ny, N);
  for (Index t = 0; t < N; ++t) {
    u(0, t) = std::cos(0.9 * static_cast<double>(t));
    for (Index i = 0; i < ny; ++i) y(i, t) = 3.0 * std::sin(1.3 * static_cast<double>(t + 4 * i));
  }
  y(1, 3) = y(0, 5) = std::numeric_limits<double>::quiet_NaN();

  // All outputs together: mean, covariance.
  const auto P = solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
  ASSERT_TRUE(P.has_value());
  VectorXd mean(ny * N), x = VectorXd::Zero(n);
  MatrixXd covariance(ny * N, ny * N);
  for (Index t = 0; t < N; ++t) {
    mean.segment(ny * t, ny) = m.C * x + m.D * u.col(t);
    x = (m.A * x + m.B * u.col(t)).eval();
    // cov(y(t), y(s)), t >= s: C A^(t-s-1) (A P C' + G S).
    covariance.block(ny * t, ny * t, ny, ny) = m.C * *P * m.C.transpose() + m.R;
    MatrixXd across = m.A * *P * m.C.transpose() + m.G * m.S;
    for (Index later = t + 1; later < N; ++later) {
      covariance.block(ny * later, ny * t, ny, ny) = m.C * across;
      covariance.block(ny * t, ny * later, ny, ny) = (m.C * across).transpose();
      across = (m.A * across).eval();
    }
  }
  const std::vector<int> horizons{1, 3, 4};
  constexpr Index from = 2;
  MatrixXd squares = MatrixXd::Zero(ny, 3), count = squares;
  for (Index t = from; t < N; ++t) {
    std::vector<Index> known;
    for (Index k = 0; k < ny * t; ++k) {
      if (!std::isnan(y.reshaped()[k])) known.push_back(k);
    }
    const VectorXd seen = VectorXd(y.reshaped())(known) - mean(known);
    const MatrixXd inverse = MatrixXd(covariance(known, known)).inverse();
    for (std::size_t h = 0; h < horizons.size(); ++h) {
      const Index then = t + horizons[h] - 1;
      for (Index i = 0; then < N && i < ny; ++i) {
        if (std::isnan(y(i, then))) continue;
        const Index k = ny * then + i;
        const double predicted = mean[k] + covariance(k, known).dot(inverse * seen);
        squares(i, static_cast<Index>(h)) += std::pow(y(i, then) - predicted, 2);
        count(i, static_cast<Index>(h)) += 1.0;
      }
    }
  }
  const PredictionErrors ours =
      prediction_errors(m, InitialState::stationary, y, u, horizons, from);
  EXPECT_LT((ours.squares - squares).norm(), 1e-10 * squares.norm());
  EXPECT_EQ(ours.count, count);
}

TEST(Prediction, OfAFilterThatDoesNotRunIsNothing) {
  StateSpace m;
  m.A = m.C = m.G = MatrixXd::Identity(1, 1);
  m.B.resize(1, 0);
  m.D.resize(1, 0);
  m.Q = m.R = m.S = MatrixXd::Zero(1, 1);
  m.x0 = VectorXd::Zero(1);
  m.P0 = MatrixXd::Zero(1, 1);
  const PredictionErrors ours =
      prediction_errors(m, InitialState::given, MatrixXd::Ones(1, 5), MatrixXd(0, 5), {1, 2}, 0);
  EXPECT_EQ(ours.count, MatrixXd::Zero(1, 2));
}

}  // namespace
}  // namespace identikal
