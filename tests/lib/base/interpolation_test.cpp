#include "lib/base/interpolation.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::VectorXd;

TEST(Pchip, GoesThroughTheSamples) {
  const VectorXd x = (VectorXd(5) << 0.0, 0.5, 2.0, 2.1, 4.0).finished();
  const VectorXd y = (VectorXd(5) << 1.0, -2.0, 3.0, 3.5, 0.0).finished();
  const Pchip pchip(x, y);
  for (Eigen::Index k = 0; k < 4; ++k) {
    EXPECT_DOUBLE_EQ(pchip.in_interval(k, x[k]), y[k]);
    EXPECT_NEAR(pchip.in_interval(k, x[k + 1]), y[k + 1], 1e-14);
  }
}

// Worked by hand from the formulas of Fritsch & Butland: slopes 0, 1.5, 3.75 and 6.
TEST(Pchip, HasTheSlopesOfTheSource) {
  const Pchip squares(VectorXd::LinSpaced(4, 0.0, 3.0),
                      (VectorXd(4) << 0.0, 1.0, 4.0, 9.0).finished());
  EXPECT_NEAR(squares.in_interval(0, 0.5), 0.5 + (0.0 - 1.5) / 8.0, 1e-14);
  EXPECT_NEAR(squares.in_interval(1, 1.5), 2.5 + (1.5 - 3.75) / 8.0, 1e-14);
  EXPECT_NEAR(squares.in_interval(2, 2.5), 6.5 + (3.75 - 6.0) / 8.0, 1e-14);
}

TEST(Pchip, IsExactForStraightLinesAtAnySpacing) {
  const VectorXd x = (VectorXd(4) << -1.0, 0.3, 0.4, 7.0).finished();
  const Pchip pchip(x, (3.0 * x.array() - 2.0).matrix());
  for (Eigen::Index k = 0; k < 3; ++k) {
    const double at = 0.3 * x[k] + 0.7 * x[k + 1];
    EXPECT_NEAR(pchip.in_interval(k, at), 3.0 * at - 2.0, 1e-13);
  }
}

TEST(Pchip, NeverOvershoots) {
  VectorXd x(9), y(9);
  x << 0, 1, 2, 3, 3.2, 5, 6, 7, 8;
  y << 0, 0, 0, 10, 10.5, 10.5, -4, -4.1, 8;
  const Pchip pchip(x, y);
  for (Eigen::Index k = 0; k < 8; ++k) {
    const double low = std::min(y[k], y[k + 1]), high = std::max(y[k], y[k + 1]);
    for (double s = 0.0; s <= 1.0; s += 0.01) {
      const double value = pchip.in_interval(k, x[k] + s * (x[k + 1] - x[k]));
      EXPECT_GE(value, low - 1e-12);
      EXPECT_LE(value, high + 1e-12);
    }
  }
}

TEST(Pchip, HasAContinuousSlope) {
  const VectorXd x = VectorXd::LinSpaced(20, 0.0, 4.0);
  const Pchip pchip(x, x.array().sin().matrix());
  constexpr double h = 1e-6;
  for (Eigen::Index k = 1; k < 19; ++k) {
    const double before = (pchip.in_interval(k - 1, x[k]) - pchip.in_interval(k - 1, x[k] - h)) / h;
    const double after = (pchip.in_interval(k, x[k] + h) - pchip.in_interval(k, x[k])) / h;
    EXPECT_NEAR(before, after, 1e-5);
  }
}

TEST(Pchip, TakesOneOrTwoSamples) {
  const Pchip constant(VectorXd::Constant(1, 2.0), VectorXd::Constant(1, 5.0));
  EXPECT_EQ(constant.in_interval(0, 100.0), 5.0);
  const Pchip line(VectorXd::LinSpaced(2, 0.0, 2.0), VectorXd::LinSpaced(2, 1.0, 5.0));
  EXPECT_DOUBLE_EQ(line.in_interval(0, 0.5), 2.0);
}

TEST(Pchip, RefusesWhatIsNoFunction) {
  EXPECT_THROW(Pchip(VectorXd(), VectorXd()), std::invalid_argument);
  EXPECT_THROW(Pchip(VectorXd::LinSpaced(3, 0, 1), VectorXd::Zero(2)), std::invalid_argument);
  EXPECT_THROW(Pchip((VectorXd(3) << 0, 1, 1).finished(), VectorXd::Zero(3)),
               std::invalid_argument);
  EXPECT_THROW(Pchip((VectorXd(3) << 0, std::nan(""), 1).finished(), VectorXd::Zero(3)),
               std::invalid_argument);
}

TEST(InterpolateLinearly, BridgesNarrowGapsOnlyAndNeverExtrapolates) {
  const VectorXd t = (VectorXd(6) << 0, 1, 2, 3, 7, 8).finished();
  VectorXd x = (VectorXd(6) << 0, 10, 20, 30, 70, 80).finished();
  x[2] = std::nan("");
  const VectorXd at = (VectorXd(8) << -0.5, 0, 0.25, 1.5, 3, 5, 7.5, 8.1).finished();
  const VectorXd y = interpolate_linearly(t, x, at, 2.0);
  EXPECT_TRUE(std::isnan(y[0]));
  EXPECT_EQ(y[1], 0.0);
  EXPECT_DOUBLE_EQ(y[2], 2.5);
  EXPECT_DOUBLE_EQ(y[3], 15.0) << "across the missing sample";
  EXPECT_EQ(y[4], 30.0);
  EXPECT_TRUE(std::isnan(y[5])) << "a gap of 4 is too wide";
  EXPECT_DOUBLE_EQ(y[6], 75.0);
  EXPECT_TRUE(std::isnan(y[7]));
  EXPECT_TRUE(
      interpolate_linearly(t, VectorXd::Constant(6, std::nan("")), at, 2.0).array().isNaN().all());
  EXPECT_THROW(interpolate_linearly(t, at, at, 1.0), std::invalid_argument);
}

TEST(OwnPeriod, IsThatOfTheSamplesThatAreThere) {
  const VectorXd t = VectorXd::LinSpaced(100, 0.0, 0.99);
  VectorXd x = VectorXd::Constant(100, std::nan(""));
  for (Eigen::Index i = 0; i < 100; i += 10) x[i] = 1.0;
  EXPECT_NEAR(own_period(t, x), 0.1, 1e-12);
  EXPECT_NEAR(own_period(t, t), 0.01, 1e-12);
  EXPECT_TRUE(std::isnan(own_period(t.head(1), t.head(1))));
}

}  // namespace
}  // namespace identikal
