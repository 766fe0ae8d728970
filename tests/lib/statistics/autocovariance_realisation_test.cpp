// The innovation model that autocovariances give back is the steady-state filter of the model that
// they come from.
#include "lib/statistics/autocovariance_realisation.h"

#include <gtest/gtest.h>

#include "lib/filter/steady_state.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

TEST(AutocovarianceRealisation, IsTheSteadyFilter) {
  Random random(21);
  for (const auto& [n, ny] : {std::pair<Index, Index>{1, 1}, {2, 1}, {3, 2}, {4, 2}}) {
    const StateSpace m = random_model(random, n, 0, ny, n);
    const auto P = solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
    ASSERT_TRUE(P.has_value());
    Autocovariances Y{m.C * *P * m.C.transpose() + m.R};
    MatrixXd across = m.A * *P * m.C.transpose() + m.G * m.S;
    for (Index l = 1; l <= 2 * n; ++l) {
      Y.push_back(m.C * across);
      across = (m.A * across).eval();
    }
    const AutocovarianceFit fit = fit_autocovariances(m.A, m.C, Y);
    EXPECT_LT(fit.left, 1e-20);
    ASSERT_TRUE(fit.innovation.has_value());
    const auto steady = steady_state(m);
    ASSERT_TRUE(steady.has_value());
    EXPECT_LT((fit.innovation->K - steady->K).norm(), 1e-7 * steady->K.norm());
    EXPECT_LT((fit.innovation->Sigma - steady->Sigma).norm(), 1e-8 * steady->Sigma.norm());
  }
}

TEST(AutocovarianceRealisation, OfWhatNoNoiseMakesIsNothing) {
  const MatrixXd A = MatrixXd::Constant(1, 1, 0.5), C = MatrixXd::Ones(1, 1);
  Autocovariances Y;
  for (const double y : {1.0, 2.0, 1.0}) Y.push_back(MatrixXd::Constant(1, 1, y));
  const AutocovarianceFit fit = fit_autocovariances(A, C, Y);
  EXPECT_NEAR(fit.h(0, 0), 2.0, 1e-12);
  EXPECT_FALSE(fit.innovation.has_value());
  EXPECT_THROW(fit_autocovariances(A, C, {Y[0]}), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
