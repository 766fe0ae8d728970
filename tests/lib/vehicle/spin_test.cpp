#include "lib/vehicle/spin.h"

#include <cmath>

#include <gtest/gtest.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A slalom at 25 m/s for 20 s; from 10 s on the car turns on to the left while the driver steers to
/// the right, its sideslip grows to 90 deg within 2 s, and it comes to rest.
SpinSignals drive(bool spins, bool with_sideslip) {
  SpinSignals out;
  out.time = VectorXd::LinSpaced(2001, 0.0, 20.0);
  out.steering.resize(2001);
  out.vx = out.r = out.vy = out.steering;
  for (Index k = 0; k < 2001; ++k) {
    const double t = out.time[k], swing = std::sin(2.0 * t);
    out.steering[k] = 0.4 * swing;
    out.r[k] = 0.25 * std::sin(2.0 * t - 0.2);
    out.vx[k] = 25.0;
    out.vy[k] = 0.5 * swing;
    if (!spins || t < 10.0) continue;
    const double beta = std::min(1.57, 0.785 * (t - 10.0)),
                 speed = std::max(0.0, 25.0 - 3.0 * (t - 10.0));
    out.steering[k] = -0.9;
    out.r[k] = 0.6;
    out.vx[k] = speed * std::cos(beta);
    out.vy[k] = -speed * std::sin(beta);
  }
  if (!with_sideslip) out.vy.resize(0);
  return out;
}

TEST(Spin, IsFoundWhereItBegins) {
  for (const bool with_sideslip : {true, false}) {
    const SpinSignals signals = drive(true, with_sideslip);
    const std::vector<Spin> spins = find_spins(signals);
    ASSERT_EQ(spins.size(), 1u) << with_sideslip;
    EXPECT_NEAR(signals.time[spins[0].first], 10.0, 0.1) << with_sideslip;
    EXPECT_EQ(std::isnan(spins[0].sideslip), !with_sideslip);
    if (with_sideslip) {
      EXPECT_NEAR(spins[0].sideslip, 1.57, 0.01);
    }
  }
}

TEST(Spin, OfACarThatHoldsThereIsNone) {
  for (const bool with_sideslip : {true, false}) {
    EXPECT_TRUE(find_spins(drive(false, with_sideslip)).empty());
  }
}

// Signs that are wrong from the first turn on are a matter of wiring.
TEST(Spin, ReversedSteeringIsNone) {
  for (const bool with_sideslip : {true, false}) {
    SpinSignals signals = drive(false, with_sideslip);
    signals.steering = -signals.steering;
    EXPECT_TRUE(find_spins(signals).empty());
  }
}

// Quantities of the other side: a spin to the right is a spin.
TEST(Spin, IsTheSameToTheRight) {
  SpinSignals signals = drive(true, true);
  const std::vector<Spin> left = find_spins(signals);
  signals.steering = -signals.steering;
  signals.r = -signals.r;
  signals.vy = -signals.vy;
  const std::vector<Spin> right = find_spins(signals);
  ASSERT_EQ(left.size(), right.size());
  EXPECT_EQ(left[0].first, right[0].first);
  EXPECT_EQ(left[0].rows, right[0].rows);
}

/// The slalom, and from 10 s on for 3 s the car is held in a slide to the left, 15 deg sideways.
SpinSignals drift(bool with_sideslip) {
  SpinSignals out = drive(false, with_sideslip);
  for (Index k = 1000; k < 1300; ++k) {
    out.steering[k] = -0.3;
    out.r[k] = 0.4;
    if (with_sideslip) out.vy[k] = -25.0 * std::tan(0.26);
  }
  return out;
}

TEST(Countersteering, IsFoundWhereItBegins) {
  for (const bool with_sideslip : {true, false}) {
    const SpinSignals signals = drift(with_sideslip);
    const std::vector<Spin> spins = find_spins(signals),
                            slides = find_countersteering(signals, spins);
    // Without sideslip turning so hard against the steering cannot be told from a spin.
    ASSERT_EQ(spins.size() + slides.size(), 1u) << with_sideslip;
    const Spin& found = slides.empty() ? spins[0] : slides[0];
    EXPECT_EQ(slides.size(), with_sideslip ? 1u : 0u);
    EXPECT_NEAR(signals.time[found.first], 10.0, 0.02) << with_sideslip;
    if (with_sideslip) {
      EXPECT_EQ(found.rows, 300);
      EXPECT_NEAR(found.sideslip, 0.26, 1e-3);
    }
  }
}

// A car answers late, more so the faster it is, and a clock may be off: neither is a drift.
TEST(Countersteering, LateAnswersAreNone) {
  for (const bool with_sideslip : {true, false}) {
    for (const double late : {0.1, 0.2, 0.4, 0.8}) {
      SpinSignals signals = drive(false, with_sideslip);
      for (Index k = 0; k < signals.time.size(); ++k) {
        signals.r[k] = 0.25 * std::sin(2.0 * (signals.time[k] - late));
      }
      EXPECT_TRUE(find_countersteering(signals, find_spins(signals)).empty()) << late;
    }
    SpinSignals reversed = drive(false, with_sideslip);
    reversed.steering *= -1.0;
    EXPECT_TRUE(find_countersteering(reversed, find_spins(reversed)).empty());
  }
}

}  // namespace
}  // namespace identikal
