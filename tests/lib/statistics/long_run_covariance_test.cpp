#include "lib/statistics/long_run_covariance.h"

#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

Eigen::MatrixXd noise(Eigen::Index k, Eigen::Index N, double memory, std::uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd x(k, N);
  Eigen::VectorXd now = Eigen::VectorXd::Zero(k);
  for (Eigen::Index t = 0; t < N; ++t) {
    now = memory * now + random.normal(k);
    x.col(t) = now;
  }
  return x;
}

TEST(LongRunCovariance, IsTheBartlettSum) {
  const Eigen::MatrixXd x = noise(3, 50, 0.5, 1);
  for (const Eigen::Index bandwidth : {1, 2, 7, 60}) {
    Eigen::MatrixXd expected = x * x.transpose();
    for (Eigen::Index lag = 1; lag < std::min<Eigen::Index>(bandwidth, 50); ++lag) {
      const Eigen::MatrixXd gamma = x.leftCols(50 - lag) * x.rightCols(50 - lag).transpose();
      const double weight = 1.0 - static_cast<double>(lag) / static_cast<double>(bandwidth);
      expected += weight * (gamma + gamma.transpose());
    }
    EXPECT_TRUE(long_run_covariance(x, bandwidth).isApprox(expected, 1e-12)) << bandwidth;
  }
}

TEST(LongRunCovariance, IsNeverIndefinite) {
  const Eigen::MatrixXd x = noise(4, 30, -0.9, 2);
  for (Eigen::Index bandwidth = 1; bandwidth < 40; ++bandwidth) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(long_run_covariance(x, bandwidth));
    EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-10);
  }
}

// Variance of a sum of N terms of an AR(1) sequence: N / (1 - memory)^2 for unit innovations.
// Bartlett's window of length L leaves out the share 2 memory / (1 - memory^2) / L of it: 11 % at
// the bandwidth of 88 for this memory.
TEST(LongRunCovariance, FindsTheScatterOfACorrelatedSum) {
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Eigen::MatrixXd x = noise(1, 5000, 0.9, seed);
    sum += long_run_covariance(x, andrews_bandwidth(x, 1000))(0, 0);
  }
  EXPECT_NEAR(sum / 40.0 / (5000.0 * 100.0), 0.89, 0.06);
}

TEST(LongRunCovariance, BandwidthFollowsTheMemory) {
  EXPECT_LE(andrews_bandwidth(noise(2, 2000, 0.0, 3), 500), 5);
  EXPECT_GT(andrews_bandwidth(noise(2, 2000, 0.95, 3), 500), 30);
  EXPECT_EQ(andrews_bandwidth(noise(2, 2000, 0.99, 3), 20), 20);
  EXPECT_EQ(andrews_bandwidth(Eigen::MatrixXd::Zero(2, 100), 50), 1);
  EXPECT_THROW(long_run_covariance(Eigen::MatrixXd::Zero(1, 3), 0), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
