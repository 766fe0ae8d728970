#include "lib/vehicle/late_sensor.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/vehicle/secondary_effects.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

VectorXd late_raster(Index rows, double step) {
  return VectorXd::LinSpaced(rows, 0.0, step * static_cast<double>(rows - 1));
}

// A ramp behind a first-order lag: y = t - T + T exp(-t/T); a signal that is even from sample to
// sample is filtered without error however long the steps are.
TEST(LateSensor, TheLagIsExactForStraightLines) {
  const double T = 0.13;
  VectorXd time(5);
  time << 0.0, 0.05, 0.4, 0.41, 2.0;
  SignalRows x = time;
  filter_by_lag(time, T, x);
  for (Index k = 0; k < time.size(); ++k) {
    EXPECT_NEAR(x(k, 0), time[k] - T + T * std::exp(-time[k] / T), 1e-14);
  }
}

TEST(LateSensor, TheLagIsThatOfTheSecondaryEffects) {
  const VectorXd time = late_raster(50, 0.02);
  const VectorXd x = time.unaryExpr([](double t) { return std::sin(7.0 * t); });
  SignalRows filtered = x;
  filter_by_lag(time, 0.03, filtered);
  double y = x[0];
  for (Index k = 1; k < x.size(); ++k) {
    y = lagged(y, x[k - 1], x[k], 0.02, 0.03);
    EXPECT_NEAR(filtered(k, 0), y, 1e-14);
  }
}

TEST(LateSensor, TheDelayIsExactForCubicsAndStandsStillOutside) {
  const VectorXd time = late_raster(21, 0.1);
  const auto cubic = [](double t) { return 1.0 - 2.0 * t + 0.5 * t * t - 0.3 * t * t * t; };
  const SignalRows y = time.unaryExpr(cubic);
  for (const double delay : {0.0, 0.034, 0.25, -0.17}) {
    const SignalRows shown = late(time, y, time, delay);
    for (Index k = 0; k < time.size(); ++k) {
      EXPECT_NEAR(shown(k, 0), cubic(std::clamp(time[k] - delay, 0.0, 2.0)), 1e-13);
    }
  }
}

TEST(LateSensor, CarriesExactDerivatives) {
  const VectorXd time = late_raster(40, 0.03);
  const auto series = [&](double amplitude) {
    SignalRows out = SignalRows::Zero(time.size(), 4);  // value, by amplitude, lag, delay
    for (Index k = 0; k < time.size(); ++k) {
      out(k, 1) = std::sin(5.0 * time[k]) + std::cos(2.0 * time[k]);
      out(k, 0) = amplitude * out(k, 1);
    }
    return out;
  };
  const auto shown = [&](double amplitude, double lag, double delay) {
    SignalRows x = series(amplitude);
    filter_by_lag(time, lag, x, 2);
    return late(time, x, time, delay, 3);
  };
  constexpr double kAmplitude = 1.3, kLag = 0.05, kDelay = 0.041, h = 1e-6;
  const SignalRows exact = shown(kAmplitude, kLag, kDelay);
  const SignalRows up[] = {shown(kAmplitude + h, kLag, kDelay), shown(kAmplitude, kLag + h, kDelay),
                           shown(kAmplitude, kLag, kDelay + h)};
  const SignalRows down[] = {shown(kAmplitude - h, kLag, kDelay),
                             shown(kAmplitude, kLag - h, kDelay),
                             shown(kAmplitude, kLag, kDelay - h)};
  for (int i = 0; i < 3; ++i) {
    const VectorXd difference = (up[i].col(0) - down[i].col(0)) / (2.0 * h);
    EXPECT_LT((exact.col(i + 1) - difference).cwiseAbs().maxCoeff(), 1e-7) << i;
  }
  // The search may stand at no lag at all.
  const VectorXd at_zero =
      (shown(kAmplitude, 1e-7, kDelay) - shown(kAmplitude, 0.0, kDelay)).col(0);
  EXPECT_LT((shown(kAmplitude, 0.0, kDelay).col(2) - at_zero / 1e-7).cwiseAbs().maxCoeff(), 1e-5);
}

}  // namespace
}  // namespace identikal
