#include "lib/vehicle/yaw_change.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"

namespace identikal::yaw_change_test {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

VectorXd times(double seconds, double rate) {
  const auto n = static_cast<Index>(std::lround(seconds * rate));
  return VectorXd::LinSpaced(n, 0.0, static_cast<double>(n - 1) / rate);
}

VectorXd sampled(const VectorXd& time, const std::function<double(double)>& r) {
  VectorXd out(time.size());
  for (Index k = 0; k < time.size(); ++k) out[k] = r(time[k]);
  return out;
}

double swing(double t, double f) { return std::sin(2.0 * std::numbers::pi * f * t); }

// Means over T of a swing at f change by 2 sin(pi f T) of their size.
TEST(YawChange, OfASwingIsItsFrequency) {
  for (const double f : {0.02, 0.1, 0.3, 0.6}) {
    for (const double rate : {20.0, 100.0, 1000.0}) {
      const VectorXd t = times(200.0, rate);
      const VectorXd r = sampled(t, [&](double at) { return 0.3 * swing(at, f); });
      EXPECT_NEAR(yaw_change(t, r, 0.5), 2.0 * std::sin(std::numbers::pi * f * 0.5), 0.02)
          << f << " Hz at " << rate << " Hz";
      EXPECT_NEAR(yaw_change(t, 57.3 * r, 0.5), yaw_change(t, r, 0.5), 1e-12);
    }
  }
}

// Noise, single wild rows and the steps of a sensor are no motion.
TEST(YawChange, LeavesOutWhatIsNoMotion) {
  const VectorXd t = times(60.0, 100.0);
  const VectorXd circle = VectorXd::Constant(t.size(), 0.2);
  EXPECT_EQ(yaw_change(t, circle, 0.5), 0.0);
  VectorXd noisy = circle, wild = circle, stepped(t.size());
  Random random(3);
  for (Index k = 0; k < t.size(); ++k) {
    noisy[k] += 0.05 * random.normal();
    if (k % 700 == 350) wild[k] = 5.0;
    // 2 deg/s a step, on a circle that gets slowly narrower.
    const double step = 2.0 / 57.3;
    stepped[k] = step * std::round((0.2 + 0.001 * t[k]) / step);
  }
  EXPECT_LT(yaw_change(t, noisy, 0.5), 0.03);
  EXPECT_LT(yaw_change(t, wild, 0.5), 0.07);
  EXPECT_LT(yaw_change(t, stepped, 0.5), 0.03);
  for (const VectorXd& r : {circle, noisy, wild, stepped}) EXPECT_TRUE(turns_steadily(t, r));
}

// Quick steering that half a second averages out is no steady turn, nor is a step that is held.
TEST(YawChange, ManoeuvresOnACircleAreSeen) {
  const VectorXd t = times(40.0, 100.0);
  EXPECT_FALSE(
      turns_steadily(t, sampled(t, [](double at) { return 0.2 + 0.05 * swing(at, 2.0); })));
  EXPECT_FALSE(turns_steadily(
      t, sampled(t, [](double at) { return std::fmod(at, 10.0) < 5.0 ? 0.0 : 0.2; })));
  EXPECT_TRUE(
      turns_steadily(t, sampled(t, [](double at) { return 0.2 + 0.002 * swing(at, 2.0); })));
}

// What was not measured, and the border of two recordings, is no change.
TEST(YawChange, GoesNotAcrossGaps) {
  VectorXd t = times(40.0, 100.0);
  VectorXd r = sampled(t, [](double at) { return at < 20.0 ? 0.2 : -0.2; });
  const double across = yaw_change(t, r, 0.5);
  EXPECT_GT(across, 0.2);
  VectorXd missing = r;
  missing.segment(1995, 10).setConstant(kNaN);
  EXPECT_EQ(yaw_change(t, missing, 0.5), 0.0);
  t.tail(2000).array() -= 19.0;
  EXPECT_EQ(yaw_change(t, r, 0.5), 0.0);
  EXPECT_TRUE(std::isnan(yaw_change(t.head(100), r.head(100), 0.5)));
  EXPECT_TRUE(std::isnan(yaw_change(VectorXd(), VectorXd(), 0.5)));
  EXPECT_TRUE(std::isnan(yaw_change(t, VectorXd::Constant(t.size(), kNaN), 0.5)));
}

}  // namespace
}  // namespace identikal::yaw_change_test
