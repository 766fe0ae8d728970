#include "lib/statistics/autoregression.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/statistics/autocorrelation.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

Autocovariances sample(Random& random, Index ny, Index N, Index lags) {
  const MatrixXd mix = random_matrix(random, ny, ny);
  return sample_autocovariances(mix * random_matrix(random, ny, N), lags, Divisor::samples);
}

// The block Toeplitz system (3.19), written out and solved at once.
TEST(Autoregression, RecursionSolvesTheYuleWalkerEquations) {
  Random random(1);
  for (const Index ny : {1, 2, 3}) {
    const Autocovariances Y = sample(random, ny, 60, 5);
    const Autoregressions models = yule_walker(Y);
    ASSERT_EQ(models.S.size(), 5u);
    const auto at = [&](Index k) -> MatrixXd {
      return k >= 0 ? Y[static_cast<std::size_t>(k)]
                    : MatrixXd(Y[static_cast<std::size_t>(-k)].transpose());
    };
    for (Index m = 1; m <= 4; ++m) {
      // [A_1 .. A_m] T = [Y_1 .. Y_m], T block (k, l) = E e(t-k) e(t-l)' = Y_(l-k).
      MatrixXd T(ny * m, ny * m), right(ny, ny * m);
      for (Index k = 0; k < m; ++k) {
        right.middleCols(k * ny, ny) = at(k + 1);
        for (Index l = 0; l < m; ++l) T.block(k * ny, l * ny, ny, ny) = at(l - k);
      }
      const MatrixXd A = T.transpose().fullPivLu().solve(right.transpose()).transpose();
      const MatrixXd S = Y[0] - A * right.transpose();
      const auto order = static_cast<std::size_t>(m);
      EXPECT_LT((models.S[order] - S).norm(), 1e-11 * Y[0].norm()) << ny << " " << m;
      for (Index k = 0; k < m; ++k) {
        EXPECT_LT((models.A[order][static_cast<std::size_t>(k)] - A.middleCols(k * ny, ny)).norm(),
                  1e-10);
      }
    }
  }
}

TEST(Autoregression, CriteriaOfAFirstOrderByHand) {
  Autocovariances Y(3, MatrixXd::Constant(1, 1, 4.0));
  Y[1] *= 0.5;
  Y[2] *= 0.25;
  const Autoregressions models = yule_walker(Y);
  EXPECT_NEAR(models.S[1](0, 0), 3.0, 1e-14);
  EXPECT_NEAR(models.A[2][0](0, 0), 0.5, 1e-14);
  EXPECT_NEAR(models.A[2][1](0, 0), 0.0, 1e-14);
  const OrderChoice bic = autoregressive_order(models, 100, Penalty::bic);
  EXPECT_EQ(bic.order, 1);
  EXPECT_EQ(bic.criterion[0], 0.0);
  EXPECT_NEAR(bic.criterion[1], 100.0 * std::log(0.75) + std::log(100.0), 1e-12);
  EXPECT_NEAR(bic.least, bic.criterion[1], 0.0);
  const double g[] = {2.0, 2.0 * std::log(std::log(100.0)), 10.0};
  int i = 0;
  for (const Penalty penalty : {Penalty::aic, Penalty::hq, Penalty::edc}) {
    EXPECT_NEAR(autoregressive_order(models, 100, penalty).criterion[2],
                100.0 * std::log(0.75) + 2.0 * g[i++], 1e-12);
  }
}

TEST(Autoregression, NothingComesFromNothing) {
  EXPECT_TRUE(yule_walker({}).S.empty());
  EXPECT_TRUE(yule_walker({MatrixXd::Zero(2, 2)}).S.empty());
  EXPECT_TRUE(yule_walker({MatrixXd::Constant(1, 1, std::nan(""))}).S.empty());
  EXPECT_THROW(autoregressive_order({}, 100, Penalty::bic), std::invalid_argument);
  // A sinusoid: predictable without error from two samples; the orders end there.
  Autocovariances Y;
  for (int k = 0; k < 6; ++k) Y.emplace_back(MatrixXd::Constant(1, 1, std::cos(0.3 * k)));
  EXPECT_LE(yule_walker(Y).S.size(), 3u);
}

// e(t) = 0.5 e(t-1) + w: the past explains 0.25 of the variance; of white noise nothing. 40,000
// samples know it to 0.004, the bounds are four of that wide.
TEST(Autoregression, ShareThatThePastExplains) {
  constexpr Index kSamples = 40'000;
  Random random(4);
  MatrixXd e = random_matrix(random, 2, kSamples);
  for (Index t = 1; t < kSamples; ++t) e(0, t) += 0.5 * e(0, t - 1);
  const Autocovariances Y = sample_autocovariances(e, 6, Divisor::samples);
  const Eigen::VectorXd share = share_explained_by_past(yule_walker(Y), kSamples);
  ASSERT_EQ(share.size(), 2);
  EXPECT_NEAR(share[0], 0.25, 0.016);
  EXPECT_NEAR(share[1], 0.0, 0.001);
  EXPECT_EQ(share_explained_by_past({}, kSamples).size(), 0);
}

// Of x(t+1) = a x(t) + w: 1 + 2 a^2 / (1 - a^2) samples to one, 9.5 with a = 0.9. Over 20,000 samples the
// estimate scatters by some 3 %; of white noise nothing is lost but chance.
TEST(IndependentSamples, AreThoseOfAFirstOrderAutoregression) {
  Random random(3);
  Eigen::VectorXd white(20000), slow(20000);
  double x = 0.0;
  for (Eigen::Index t = 0; t < white.size(); ++t) {
    x = 0.9 * x + random.normal();
    white[t] = random.normal();
    slow[t] = x;
  }
  EXPECT_NEAR(independent_samples(white), 20000.0, 200.0);
  EXPECT_NEAR(independent_samples(slow), 20000.0 / (1.0 + 2.0 * 0.81 / 0.19), 300.0);
  EXPECT_EQ(independent_samples(Eigen::VectorXd::Zero(50)), 0.0);
}

}  // namespace
}  // namespace identikal
