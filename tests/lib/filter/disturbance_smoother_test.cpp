// Smoothed disturbances and auxiliary residuals against statsmodels; shocks that were put in are found.
#include "lib/filter/disturbance_smoother.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/simulation.h"
#include "tests/support/structural_series.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Trend and season of four samples.
StateSpace trend_and_season() {
  StateSpace m;
  m.A = (MatrixXd(5, 5) << 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, -1, -1, -1, 0, 0, 1, 0, 0, 0, 0, 0,
         1, 0)
            .finished();
  m.C = (MatrixXd(1, 5) << 1, 0, 1, 0, 0).finished();
  m.G = MatrixXd::Zero(5, 3);
  m.G.topRows(3).setIdentity();
  m.Q = Eigen::Vector3d(0.09, 0.0025, 0.02).asDiagonal();
  m.R = MatrixXd::Constant(1, 1, 0.15);
  m.S = MatrixXd::Zero(3, 1);
  m.B = MatrixXd(5, 0);
  m.D = MatrixXd(1, 0);
  m.x0 = VectorXd::Zero(5);
  m.P0 = MatrixXd::Zero(5, 5);
  return m;
}

TEST(DisturbanceSmoother, AgreesWithStatsmodels) {
  const std::vector<double>& series = structural_series::y;
  const MatrixXd y =
      Eigen::Map<const VectorXd>(series.data(), static_cast<Index>(series.size())).transpose();
  const DisturbanceResult out =
      smooth_disturbances(trend_and_season(), InitialState::diffuse, y, MatrixXd(0, y.cols()));
  ASSERT_EQ(out.status, FilterStatus::ok);
  EXPECT_NEAR(out.v(0, 30), -0.01569969039381826, 1e-6);
  EXPECT_NEAR(std::pow(out.v_sd(0, 30), 2), 0.15 - 0.07912999841534142, 1e-6);
  const double w[] = {0.11766882888855486, -0.0011115857203852994, -0.04705243643386178};
  const double left[] = {0.06662461837724187, 0.0023247700676616596, 0.01629527877809348};
  for (Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(out.w(i, 30), w[i], 1e-6);
    EXPECT_NEAR(std::pow(out.w_sd(i, 30), 2), trend_and_season().Q(i, i) - left[i], 1e-6);
  }
  EXPECT_TRUE(std::isnan(out.v(0, 21)));
  EXPECT_TRUE(std::isnan(out.w(0, 59)));
}

// Four false alarms above 4 in 4 x 300 t-values would be 60 times as many as a Gaussian has.
TEST(DisturbanceSmoother, FindsAnOutlierAndAJumpWhereTheyAre) {
  StateSpace level;
  level.A = level.C = level.G = MatrixXd::Identity(1, 1);
  level.Q = MatrixXd::Constant(1, 1, 0.04);
  level.R = MatrixXd::Constant(1, 1, 1.0);
  level.S = MatrixXd::Zero(1, 1);
  level.B = level.D = MatrixXd(1, 0);
  level.x0 = VectorXd::Zero(1);
  level.P0 = MatrixXd::Zero(1, 1);
  Random random(4);
  const MatrixXd u(0, 300);
  MatrixXd y = simulate_outputs(level, InitialState::diffuse, u, 300, random);
  y(0, 100) += 8.0;
  y.rightCols(100).array() += 5.0;
  const DisturbanceResult out = smooth_disturbances(level, InitialState::diffuse, y, u);
  ASSERT_EQ(out.status, FilterStatus::ok);
  Index row = 0, outlier = 0, jump = 0;
  out.output_t.array().isNaN().select(0.0, out.output_t).cwiseAbs().maxCoeff(&row, &outlier);
  out.state_t.array().isNaN().select(0.0, out.state_t).cwiseAbs().maxCoeff(&row, &jump);
  EXPECT_EQ(outlier, 100);
  EXPECT_EQ(jump, 199);
  EXPECT_GT(out.output_t(0, 100), 6.0);
  EXPECT_GT(out.state_t(0, 199), 4.0);
}

// Where the model holds, t-values are standard normal: mean square of 20 x 400, within 5 %, which is
// three of its standard errors (neighbours are correlated).
TEST(DisturbanceSmoother, TValuesAreStandardNormal) {
  const StateSpace m = trend_and_season();
  Random random(8);
  double outputs = 0.0, states = 0.0, count = 0.0, count_states = 0.0;
  for (int run = 0; run < 20; ++run) {
    const MatrixXd u(0, 400), y = simulate_outputs(m, InitialState::diffuse, u, 400, random);
    const DisturbanceResult out = smooth_disturbances(m, InitialState::diffuse, y, u);
    for (Index t = 5; t + 5 < 400; ++t) {
      outputs += std::pow(out.output_t(0, t), 2);
      states += std::pow(out.state_t(0, t), 2);
      count += 1.0;
      count_states += 1.0;
    }
  }
  EXPECT_NEAR(outputs / count, 1.0, 0.05);
  EXPECT_NEAR(states / count_states, 1.0, 0.05);
}

}  // namespace
}  // namespace identikal
