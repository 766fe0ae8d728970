#include "lib/whiteness.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/random.h"

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

}  // namespace
}  // namespace identikal
