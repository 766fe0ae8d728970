#include "lib/statistics/autocorrelation.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/autocovariance_sums.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd noise(Random& random, Index ny, Index N) {
  MatrixXd e(ny, N);
  for (Index t = 0; t < N; ++t) e.col(t) = random.normal(ny);
  return e;
}

TEST(Autocorrelation, DivisorsByHand) {
  const MatrixXd e = (MatrixXd(1, 4) << 1, 2, -1, 3).finished();
  const auto at = [&](Divisor divisor, std::size_t k) {
    return sample_autocovariances(e, 3, divisor)[k](0, 0);
  };
  const double lag_1 = 2 - 2 - 3, lag_2 = -1 + 6;
  EXPECT_DOUBLE_EQ(at(Divisor::pairs, 1), lag_1 / 3);
  EXPECT_DOUBLE_EQ(at(Divisor::samples, 1), lag_1 / 4);
  EXPECT_DOUBLE_EQ(at(Divisor::equal_variance, 1), lag_1 / std::sqrt(12.0));
  EXPECT_DOUBLE_EQ(at(Divisor::equal_variance, 2), lag_2 / std::sqrt(8.0));
  EXPECT_DOUBLE_EQ(at(Divisor::truncated, 0), (1 + 4) / 2.0);
  EXPECT_DOUBLE_EQ(at(Divisor::truncated, 1), (2 - 2) / 2.0);
  EXPECT_DOUBLE_EQ(at(Divisor::truncated, 2), (-1 + 6) / 2.0);
  for (const Divisor d : {Divisor::pairs, Divisor::samples, Divisor::equal_variance}) {
    EXPECT_DOUBLE_EQ(at(d, 0), 15.0 / 4.0);
  }
  EXPECT_THROW(sample_autocovariances(e, 5, Divisor::truncated), std::invalid_argument);
  EXPECT_THROW(sample_autocovariances(e, 0, Divisor::pairs), std::invalid_argument);
}

TEST(Autocorrelation, NormalisedByBothChannels) {
  Random random(1);
  MatrixXd e = noise(random, 2, 50);
  e.row(1) *= 1000.0;
  const Autocovariances Y = sample_autocovariances(e, 4, Divisor::equal_variance);
  const Autocovariances gamma = autocorrelations(Y);
  EXPECT_DOUBLE_EQ(gamma[0](0, 0), 1.0);
  EXPECT_DOUBLE_EQ(gamma[3](0, 1), Y[3](0, 1) / std::sqrt(Y[0](0, 0) * Y[0](1, 1)));
  e.row(0).setZero();
  EXPECT_TRUE(std::isnan(autocorrelations(sample_autocovariances(e, 2).value)[1](0, 0)));
}

// The variance of white noise is 1 / N at every lag: the reason for the square root. 4000 seeds,
// a variance is known to 2.2 %, four standard errors are 9 %.
TEST(Autocorrelation, EqualVarianceIsEqual) {
  VectorXd squares = VectorXd::Zero(4), unbiased = squares;
  const Index N = 40, lags[] = {1, 10, 20, 35};
  for (std::uint64_t seed = 1; seed <= 4000; ++seed) {
    Random random(seed);
    const MatrixXd e = noise(random, 1, N);
    const Autocovariances Y = sample_autocovariances(e, 36, Divisor::equal_variance);
    const Autocovariances Z = sample_autocovariances(e, 36, Divisor::pairs);
    for (Index i = 0; i < 4; ++i) {
      const auto k = static_cast<std::size_t>(lags[i]);
      squares[i] += Y[k].squaredNorm() * 40.0 / 4000.0;
      unbiased[i] += Z[k].squaredNorm() * 40.0 / 4000.0;
    }
  }
  for (Index i = 0; i < 4; ++i) EXPECT_NEAR(squares[i], 1.0, 0.09) << lags[i];
  EXPECT_GT(unbiased[3], 6.0);
}

// Lag by lag, product by product.
MatrixXd brute_force(const MatrixXd& z, Index m) {
  MatrixXd sum = MatrixXd::Zero(z.rows(), z.rows());
  for (Index t = 0; t + m < z.cols(); ++t) sum += z.col(t + m) * z.col(t).transpose();
  return sum;
}

TEST(Autocorrelation, SumsAndTransformAgreeWithBruteForce) {
  Random random(2);
  for (const Index N : {Index{1}, Index{7}, Index{300}, Index{5000}}) {
    for (const Index lags : {Index{1}, Index{5}, kTransformLags, Index{600}}) {
      const MatrixXd z = noise(random, 3, N);
      const auto sums = autocovariance_sums(z, lags);
      ASSERT_EQ(sums.size(), static_cast<std::size_t>(lags));
      for (Index m = 0; m < lags; m = 2 * m + 1) {
        EXPECT_LT((sums[static_cast<std::size_t>(m)] - brute_force(z, m)).norm(),
                  1e-13 * z.squaredNorm())
            << N << " " << m;
      }
    }
  }
}

TEST(Autocorrelation, MissingSamplesCountWholePairsByTransformToo) {
  Random random(3);
  MatrixXd e = noise(random, 2, 1000);
  for (Index t = 0; t < 1000; ++t) {
    if (random.uniform() < 0.3) e(static_cast<Index>(2.0 * random.uniform()), t) = std::nan("");
  }
  const SampleAutocovariances few = sample_autocovariances(e, 3),
                              many = sample_autocovariances(e, 1000);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(few.pairs[k], many.pairs[k]);
    EXPECT_LT((few.value[k] - many.value[k]).norm(), 1e-13);
  }
}

}  // namespace
}  // namespace identikal
