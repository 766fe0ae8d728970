#include "lib/statistics/clock_offset.h"

#include <cmath>
#include <cstdio>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// A sum of sines without common period: never the same twice.
double wander(double t) {
  return std::sin(1.3 * t) + 0.7 * std::sin(2.9 * t + 1.0) + 0.5 * std::sin(0.37 * t + 2.0);
}

VectorXd at_rate(double seconds, double rate, double begin = 0.0) {
  const auto n = static_cast<Index>(seconds * rate);
  return VectorXd::LinSpaced(n, begin, begin + static_cast<double>(n - 1) / rate);
}

VectorXd of(const VectorXd& t, double lag, double scale = 1.0) {
  VectorXd out(t.size());
  for (Index i = 0; i < t.size(); ++i) out[i] = 5.0 + scale * wander(t[i] - lag);
  return out;
}

TEST(ClockOffset, FindsALagFarFromZeroBetweenDifferentRates) {
  for (const double lag : {-3.21, -0.74, 0.0, 0.033, 2.5}) {
    const VectorXd tx = at_rate(60, 100), ty = at_rate(60, 37, 0.011);
    const ClockOffset c = clock_offset(tx, of(tx, 0.0), ty, of(ty, lag, -40.0), 5.0);
    EXPECT_NEAR(c.lag, lag, 2e-3);
    EXPECT_LT(c.correlation, -0.999);
    EXPECT_FALSE(c.at_edge);
    EXPECT_GT(c.shared, 55.0);
  }
}

TEST(ClockOffset, StampsMayBeIrregularAndSamplesMissing) {
  Random random(3);
  VectorXd tx = at_rate(40, 50), ty = at_rate(40, 80);
  for (double& t : tx) t += 0.008 * (random.uniform() - 0.5);
  VectorXd x = of(tx, 0.0), y = of(ty, 0.4);
  for (Index i = 300; i < 600; ++i) y[i] = kNaN;
  x[17] = kNaN;
  const ClockOffset c = clock_offset(tx, x, ty, y, 3.0);
  EXPECT_NEAR(c.lag, 0.4, 3e-3);
}

TEST(ClockOffset, ALongRecordIsSearchedCoarselyFirst) {
  const VectorXd t = at_rate(600, 100);
  const ClockOffset c = clock_offset(t, of(t, 0.0), t, of(t, 1.2345), 5.0);
  EXPECT_NEAR(c.lag, 1.2345, 1e-3);
}

TEST(ClockOffset, APeriodicSignalHasASecondPeakAsHigh) {
  const VectorXd t = at_rate(60, 50);
  VectorXd x(t.size()), y(t.size());
  for (Index i = 0; i < t.size(); ++i) {
    x[i] = std::sin(2.0 * std::numbers::pi * 0.5 * t[i]);
    y[i] = std::sin(2.0 * std::numbers::pi * 0.5 * (t[i] - 0.3));
  }
  const ClockOffset c = clock_offset(t, x, t, y, 3.0, Relation::same_sign);
  EXPECT_NEAR(std::remainder(c.lag - 0.3, 2.0), 0.0, 1e-3);
  EXPECT_NEAR(std::remainder(c.other_lag - c.lag, 2.0), 0.0, 0.05);
  EXPECT_GT(std::abs(c.other_lag - c.lag), 1.9);
  EXPECT_GT(c.other_correlation, 0.99);
  // With either sign half a period is as good.
  const ClockOffset either = clock_offset(t, x, t, y, 3.0);
  EXPECT_NEAR(std::remainder(either.lag - 0.3, 1.0), 0.0, 1e-3);
  EXPECT_LT(clock_offset(t, x, t, y, 3.0, Relation::opposite_sign).correlation, -0.99);
}

// 300 records with coloured noise in y: the scatter of the lags is what the standard error says.
TEST(ClockOffset, ItsStandardErrorIsTheScatterUnderColouredNoise) {
  const VectorXd t = at_rate(40, 50);
  const VectorXd x = of(t, 0.0), clean = of(t, 0.25);
  double sum = 0.0, squares = 0.0, errors = 0.0;
  constexpr int kRuns = 300;
  for (int run = 0; run < kRuns; ++run) {
    Random random(static_cast<std::uint64_t>(run) + 1);
    VectorXd y = clean;
    double e = 0.0;
    for (double& v : y) {
      e = 0.9 * e + 0.15 * random.normal();
      v += e;
    }
    const ClockOffset c = clock_offset(t, x, t, y, 2.0);
    sum += c.lag;
    squares += (c.lag - 0.25) * (c.lag - 0.25);
    errors += c.se;
  }
  EXPECT_NEAR(sum / kRuns, 0.25, 0.003);
  const double ratio = errors / kRuns / std::sqrt(squares / kRuns);
  std::printf("clock offset: mean standard error over scatter %.3f\n", ratio);
  EXPECT_GT(ratio, 0.75);
  EXPECT_LT(ratio, 1.25);
}

TEST(ClockOffset, SaysWhenItCannotTell) {
  const VectorXd t = at_rate(20, 50);
  EXPECT_TRUE(std::isnan(clock_offset(t, VectorXd::Ones(t.size()), t, of(t, 0.0), 2.0).lag));
  EXPECT_TRUE(
      std::isnan(clock_offset(t, VectorXd::Constant(t.size(), kNaN), t, of(t, 0.0), 2.0).lag));
  EXPECT_TRUE(std::isnan(clock_offset(t.head(1), t.head(1), t, of(t, 0.0), 2.0).lag));
  EXPECT_TRUE(clock_offset(t, of(t, 0.0), t, of(t, 3.0), 1.0).at_edge ||
              std::abs(clock_offset(t, of(t, 0.0), t, of(t, 3.0), 1.0).correlation) < 0.99);
  EXPECT_THROW(clock_offset(t, t.head(3), t, t, 1.0), std::invalid_argument);
  EXPECT_THROW(clock_offset(t, t, t, t, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
