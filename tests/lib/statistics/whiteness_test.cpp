#include "lib/statistics/whiteness.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

TEST(Whiteness, LjungBoxByHand) {
  // e = 1, -1, 2, -2, 0: power 10, r_1 = -7/10 n/(n-1) pairwise; Q = n (n+2) (0.7^2)/(n-1) =
  // 5*7*.49/4.
  const Eigen::VectorXd e = (Eigen::VectorXd(5) << 1, -1, 2, -2, 0).finished();
  const ChiSquareStatistic q = ljung_box(e, 1);
  EXPECT_NEAR(q.value, 5.0 * 7.0 * 0.49 / 4.0, 1e-12);
  EXPECT_EQ(q.dof, 1.0);
}

TEST(Whiteness, MissingSamplesLeaveOutTheirPairs) {
  Eigen::VectorXd e(6);
  e << 1, std::nan(""), -1, 2, -2, 0;
  Eigen::VectorXd pairs;
  autocorrelation(e, 2, &pairs);
  EXPECT_EQ(pairs[0], 3.0);
  EXPECT_EQ(pairs[1], 3.0);
}

// Of sensors that take turns, each has the lags of its own samples: the same numbers as without the
// rows of the others. Samples missing here and there stay missing.
TEST(Whiteness, LagsAreThoseOfTheChannelsOwnSamples) {
  Random random(4);
  Eigen::VectorXd own = random.normal(200);
  for (int t = 1; t < 200; ++t) own[t] += 0.6 * own[t - 1];
  for (const int period : {2, 3, 7}) {
    Eigen::VectorXd e = Eigen::VectorXd::Constant(200 * period, std::nan(""));
    for (int t = 0; t < 200; ++t) e[t * period + 1] = own[t];
    EXPECT_EQ(own_period(e), period);
    Eigen::VectorXd pairs;
    const Eigen::VectorXd r = autocorrelation(e, 20, &pairs), wanted = autocorrelation(own, 20);
    EXPECT_LT((r - wanted).norm(), 1e-12);
    EXPECT_EQ(pairs[4], 195.0);
    EXPECT_NEAR(ljung_box(e, 20).value, ljung_box(own, 20).value, 1e-9);
    EXPECT_EQ(ljung_box(e, 20).dof, 20.0);
  }
  for (int t = 0; t < 200; ++t) {
    if (random.uniform() < 0.5) own[t] = std::nan("");
  }
  EXPECT_EQ(own_period(own), 1);
  EXPECT_EQ(own_period(Eigen::VectorXd(0)), 1);
}

TEST(Whiteness, NothingComesFromNothing) {
  EXPECT_TRUE(std::isnan(ljung_box(Eigen::VectorXd::Constant(50, 0.1), 5).value));
  EXPECT_TRUE(std::isnan(ljung_box(Eigen::VectorXd::Constant(50, std::nan("")), 5).value));
  EXPECT_TRUE(std::isnan(ljung_box(Eigen::VectorXd(0), 5).value));
}

// False alarms at 5 % nominal, 4000 seeds: the rate has a standard error of 0.34 %, so 3.6 to 6.4 %
// are four of them. 31.41 and 11.07 are the 95 % points of chi-square with 20 and 5 degrees of
// freedom.
TEST(Whiteness, FalseAlarmRateOfLjungBoxIsNominal) {
  for (const bool gaps : {false, true}) {
    int alarms_20 = 0, alarms_5 = 0;
    const int runs = 4000;
    for (int run = 0; run < runs; ++run) {
      Random random(static_cast<std::uint64_t>(run) + 1);
      Eigen::VectorXd e = random.normal(500);
      for (int t = 0; gaps && t < 500; ++t) {
        if (random.uniform() < 0.2) e[t] = std::nan("");
      }
      alarms_20 += ljung_box(e, 20).value > 31.4104;
      alarms_5 += ljung_box(e, 5).value > 11.0705;
    }
    std::printf("false alarms, %s: %.2f %% (5 lags) %.2f %% (20 lags)\n",
                gaps ? "gaps" : "complete", 100.0 * alarms_5 / runs, 100.0 * alarms_20 / runs);
    EXPECT_NEAR(alarms_20 / static_cast<double>(runs), 0.05, 0.014);
    EXPECT_NEAR(alarms_5 / static_cast<double>(runs), 0.05, 0.014);
  }
}

// Every lag has expectation ny^2: by 20 000 records of 8 samples, where it matters most.
TEST(Whiteness, PortmanteauHasItsExactMean) {
  for (const Eigen::Index ny : {1, 2, 3}) {
    double sum = 0.0, squares = 0.0;
    const int runs = 20000, lags = 6;
    for (int run = 0; run < runs; ++run) {
      Random random(static_cast<std::uint64_t>(run) + 1);
      const ChiSquareStatistic q = portmanteau(random_matrix(random, ny, 8), lags);
      ASSERT_EQ(q.dof, static_cast<double>(lags * ny * ny));
      sum += q.value / runs;
      squares += q.value * q.value / runs;
    }
    const double error = std::sqrt((squares - sum * sum) / runs);
    EXPECT_NEAR(sum, static_cast<double>(lags * ny * ny), 4.0 * error) << ny;
  }
}

TEST(Whiteness, PortmanteauDoesNotDependOnUnitsOrMixture) {
  Random random(1);
  const Eigen::MatrixXd e = random_matrix(random, 3, 100);
  Eigen::Matrix3d T;
  T << 1e3, 2, 0, -5, 1, 0.1, 0, 7, 1;
  const double a = portmanteau(e, 5).value, b = portmanteau(T * e, 5).value;
  EXPECT_NEAR(a, b, 1e-8 * a);
}

// e = 1, -1, 2, -2: sum of squares 10, of products -1 - 2 - 4.
TEST(Whiteness, PortmanteauOfOneChannelIsLjungAndBox) {
  EXPECT_NEAR(portmanteau(Eigen::RowVector4d(1, -1, 2, -2), 1).value, 4.0 * 6.0 * 0.49 / 3.0,
              1e-12);
}

TEST(Whiteness, PortmanteauOfNothing) {
  Random random(1);
  Eigen::MatrixXd e = random_matrix(random, 2, 50);
  e.row(1) = 3.0 * e.row(0);
  EXPECT_TRUE(std::isnan(portmanteau(e, 5).value));
  EXPECT_TRUE(std::isnan(portmanteau(Eigen::MatrixXd::Zero(2, 50), 5).value));
  EXPECT_TRUE(std::isnan(portmanteau(Eigen::MatrixXd(2, 0), 5).value));
  EXPECT_TRUE(std::isnan(portmanteau(random_matrix(random, 2, 3), 1).value));
}

// As published: Mehra's count and the chi-square per channel, by hand.
TEST(Whiteness, PublishedForms) {
  Autocovariances gamma(3, Eigen::MatrixXd::Identity(2, 2));
  gamma[1] << 0.1, 9, 9, -0.3;
  gamma[2] << -0.25, 9, 9, 0.01;
  EXPECT_EQ(mehra_share(gamma, 100, 1.96), Eigen::Vector2d(0.5, 0.5));
  EXPECT_NEAR(published_chi_square(gamma, 100)[0], 100 * (0.01 + 0.0625), 1e-12);
  EXPECT_NEAR(published_chi_square(gamma, 100)[1], 100 * (0.09 + 0.0001), 1e-12);
}

// 2000 seeds: 5 % has a standard error of 0.49 %. 61.656: chi-square 95 %, 45 degrees of freedom.
TEST(Whiteness, FalseAlarmRateOfThePortmanteauIsNominal) {
  for (const bool gaps : {false, true}) {
    int alarms = 0;
    for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
      Random random(seed);
      Eigen::MatrixXd e = random_matrix(random, 3, 200);
      for (Eigen::Index t = 0; gaps && t < 200; ++t) {
        if (random.uniform() < 0.2) e(t % 3, t) = std::nan("");
      }
      alarms += portmanteau(e, 5).value > 61.656;
    }
    std::printf("portmanteau, 3 channels%s: false alarms %.2f %%\n", gaps ? ", gaps" : "",
                alarms / 20.0);
    EXPECT_NEAR(alarms / 2000.0, 0.05, 0.015);
  }
}

}  // namespace
}  // namespace identikal
