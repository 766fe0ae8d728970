// Autocovariances of innovations against the joint covariance of a short record, filtered by brute
// force, and the covariance of sample autocovariances against Isserlis' theorem written out.
#include "lib/statistics/autocovariance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/steady_state.h"
#include "tests/support/joint_density.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct AutocovarianceCase {
  StateSpace model;
  MatrixXd L;
};
// A gain that is stable, and not the optimal one.
AutocovarianceCase random_case(std::uint64_t seed) {
  Random random(seed);
  const auto n = static_cast<Index>(1 + seed % 3), ny = static_cast<Index>(1 + seed % 2);
  AutocovarianceCase out{random_model(random, n, 0, ny, 2), {}};
  StateSpace other = out.model;
  other.Q *= 7.0;
  other.S *= 0.0;
  out.L = steady_state(other)->K;
  return out;
}

// cov of the innovations stacked over time: the filter is linear in y, so its response to one unit
// of each sample is a column of the map.
MatrixXd joint_covariance(const AutocovarianceCase& c, const MatrixXd& pattern) {
  const StateSpace& m = c.model;
  const Index ny = m.outputs(), N = pattern.cols(), n = m.states();
  const MatrixXd P = *solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
  const Stacked joint = stack(m, MatrixXd(0, N), N, VectorXd::Zero(n), P);
  MatrixXd map(N * ny, N * ny);
  for (Index s = 0; s < N * ny; ++s) {
    MatrixXd y = MatrixXd::Zero(ny, N);
    y(s % ny, s / ny) = 1.0;
    y += pattern;  // NaN where missing
    const MatrixXd e = constant_gain_innovations(m, c.L, VectorXd::Zero(n), y, MatrixXd(0, N));
    map.col(s) = e.reshaped().array().isNaN().select(0.0, e.reshaped());
  }
  return map * joint.covariance * map.transpose();
}

TEST(Autocovariance, OfInnovationsEqualTheJointCovariance) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const AutocovarianceCase c = random_case(seed);
    const Index ny = c.model.outputs(), N = 60, lags = 5;
    const MatrixXd V = joint_covariance(c, MatrixXd::Zero(ny, N));
    const Autocovariances Y = innovation_autocovariances(c.model, c.L, lags);
    for (Index k = 0; k < lags; ++k) {
      const MatrixXd expected = V.block((N - 1) * ny, (N - 1 - k) * ny, ny, ny);
      const MatrixXd& actual = Y[static_cast<std::size_t>(k)];
      EXPECT_LT((actual - expected).norm(), 1e-6 * Y[0].norm()) << seed << " lag " << k;
    }
  }
}

TEST(Autocovariance, FollowsGaps) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const AutocovarianceCase c = random_case(seed);
    const Index ny = c.model.outputs(), N = 70, first = 40, lags = 4;
    MatrixXd pattern = MatrixXd::Zero(ny, N);
    Random random(100 + seed);
    for (Index i = 0; i < pattern.size(); ++i) {
      if (i / ny >= 30 && random.uniform() < 0.3) pattern(i % ny, i / ny) = std::nan("");
    }
    const MatrixXd V = joint_covariance(c, pattern);
    const Autocovariances Y = innovation_autocovariances(c.model, c.L, pattern, first, lags);
    for (Index k = 0; k < lags; ++k) {
      MatrixXd sum = MatrixXd::Zero(ny, ny), pairs = sum;
      for (Index t = first; t + k < N; ++t) {
        for (Index i = 0; i < ny; ++i) {
          for (Index j = 0; j < ny; ++j) {
            if (std::isnan(pattern(i, t + k)) || std::isnan(pattern(j, t))) continue;
            sum(i, j) += V((t + k) * ny + i, t * ny + j);
            pairs(i, j) += 1.0;
          }
        }
      }
      const MatrixXd expected = sum.cwiseQuotient(pairs);
      EXPECT_LT((Y[static_cast<std::size_t>(k)] - expected).norm(), 1e-6 * Y[0].norm())
          << seed << " lag " << k;
    }
  }
}

TEST(Autocovariance, SampleValuesCountTheirPairs) {
  const double nan = std::nan("");
  MatrixXd e(1, 6);
  e << 1, 2, nan, 4, 5, 6;
  const SampleAutocovariances out = sample_autocovariances(e, 3);
  EXPECT_EQ(out.pairs[0](0, 0), 5.0);
  EXPECT_DOUBLE_EQ(out.value[0](0, 0), (1 + 4 + 16 + 25 + 36) / 5.0);
  EXPECT_DOUBLE_EQ(out.value[1](0, 0), (2 + 20 + 30) / 3.0);
  EXPECT_DOUBLE_EQ(out.value[2](0, 0), (8 + 24) / 2.0);
  EXPECT_TRUE(std::isnan(sample_autocovariances(e.leftCols(2), 4).value[3](0, 0)));
  // Y_k = E e(t+k) e(t)', not its transpose.
  MatrixXd two(2, 3);
  two << 1, 0, 0, 0, 5, 0;
  EXPECT_DOUBLE_EQ(sample_autocovariances(two, 2).value[1](1, 0), 2.5);
  EXPECT_DOUBLE_EQ(sample_autocovariances(two, 2).value[1](0, 1), 0.0);
}

TEST(Autocovariance, CovarianceOfSampleValuesIsThatOfIsserlis) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const AutocovarianceCase c = random_case(seed);
    const Index ny = c.model.outputs(), lags = 3, N = 400;
    const Autocovariances Y = innovation_autocovariances(c.model, c.L, N);
    const MatrixXd V = covariance_of_autocovariances(Y, lags);
    const auto at = [&](Index tau, Index i, Index j) {
      return tau >= 0 ? Y[static_cast<std::size_t>(tau)](i, j)
                      : Y[static_cast<std::size_t>(-tau)](j, i);
    };
    struct Entry {
      Index k, i, j;
    };
    std::vector<Entry> entries;
    for (Index k = 0; k < lags; ++k) {
      for (Index j = 0; j < ny; ++j) {
        for (Index i = k == 0 ? j : 0; i < ny; ++i) entries.push_back({k, i, j});
      }
    }
    ASSERT_EQ(V.rows(), static_cast<Index>(entries.size()));
    for (std::size_t a = 0; a < entries.size(); ++a) {
      for (std::size_t b = 0; b < entries.size(); ++b) {
        const auto [k, i, j] = entries[a];
        const auto [l, p, q] = entries[b];
        // One sum over the distance d = t - s of the two pairs; it vanishes long before N.
        double sum = 0.0;
        for (Index d = -(N - 3); d <= N - 3; ++d) {
          if (std::abs(d + k - l) >= N || std::abs(d + k) >= N || std::abs(d - l) >= N) continue;
          sum += at(d + k - l, i, p) * at(d, j, q) + at(d + k, i, q) * at(d - l, j, p);
        }
        const auto row = static_cast<Index>(a), col = static_cast<Index>(b);
        const double scale = std::sqrt(V(row, row) * V(col, col));
        worst = std::max(worst, std::abs(V(row, col) - sum) / scale);
      }
    }
  }
  std::printf("covariance of sample autocovariances: %.1e of Isserlis' sum\n", worst);
  EXPECT_LT(worst, 1e-9);
}

TEST(Autocovariance, RefusesWhatDoesNotFit) {
  const AutocovarianceCase c = random_case(2);
  EXPECT_THROW(innovation_autocovariances(c.model, MatrixXd::Zero(9, 9), 3), std::invalid_argument);
  EXPECT_THROW(sample_autocovariances(MatrixXd::Zero(1, 5), 0), std::invalid_argument);
  StateSpace unstable = c.model;
  unstable.A *= 3.0;
  EXPECT_TRUE(
      innovation_autocovariances(unstable, MatrixXd::Zero(c.L.rows(), c.L.cols()), 3).empty());
}

}  // namespace
}  // namespace identikal
