// Does the vehicle fit reach the statistical limit? Monte Carlo on the manoeuvre of Sladká (2010),
// chapter 8: severe lane change at 60 km/h, the car of table 8.1, noise of 0.01 rad/s on r and 0.03
// m/s on vy; Cf, Cr and Iz free. Fixed seeds; the figures are printed. The truth comes from a fine
// integration of the continuous steering, so that what happens between the samples is an error like
// any other; a second pass takes the tool's own path.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>

#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/sladka2010_car.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

constexpr int kNames = 3;
constexpr const char* kName[kNames] = {"Cf", "Cr", "Iz"};
constexpr double kTruth[kNames] = {88107.7, 88107.7, 2319.0};

struct Tally {
  int runs = 0, ok = 0, agree = 0, coloured = 0, saturation = 0, serious = 0;
  double bias[kNames] = {}, sd[kNames] = {}, bound[kNames] = {}, coverage[kNames] = {};
  double milliseconds = 0.0;
};

/// Statistics of fits to `clean` with fresh noise, in shares of the truth.
Tally study(const char* title, const Dataset& clean, int runs) {
  const Model model = sladka2010_model();
  Tally tally;
  tally.runs = runs;
  double sum[kNames] = {}, squares[kNames] = {};
  for (int run = 0; run < runs; ++run) {
    const Dataset data = with_noise(clean, {0.01, 0.03}, static_cast<std::uint64_t>(run) + 1);
    const auto begin = std::chrono::steady_clock::now();
    const VehicleEstimate fit = fit_vehicle(model, data, without_second_opinion());
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    tally.milliseconds += took.count() / runs;
    tally.ok += fit.status == Status::ok ? 1 : 0;
    tally.agree += fit.objective.starts == fit.objective.starts_at_optimum ? 1 : 0;
    tally.coloured += finding(fit, FindingCode::coloured_residuals) != nullptr ? 1 : 0;
    if (const Finding* w = finding(fit, FindingCode::tyre_saturation)) {
      ++tally.saturation;
      tally.serious += w->severity == Severity::serious ? 1 : 0;
    }
    for (int i = 0; i < kNames; ++i) {
      const EstimatedParameter& p = parameter(fit, kName[i]);
      const double error = p.value / kTruth[i] - 1.0;
      sum[i] += error;
      squares[i] += error * error;
      tally.bound[i] += p.crb_se / kTruth[i] / runs;
      const bool covered = p.ci95[0] < kTruth[i] && kTruth[i] < p.ci95[1];
      tally.coverage[i] += covered ? 1.0 / runs : 0.0;
    }
  }
  std::printf("%s, %d runs, %.1f ms a fit\n", title, runs, tally.milliseconds);
  for (int i = 0; i < kNames; ++i) {
    tally.bias[i] = sum[i] / runs;
    tally.sd[i] = std::sqrt((squares[i] - sum[i] * sum[i] / runs) / (runs - 1));
    std::printf("  %s  bias %+.3f %%  sd %.3f %%  bound %.3f %%  sd/bound %.3f  coverage %.1f %%\n",
                kName[i], 100.0 * tally.bias[i], 100.0 * tally.sd[i], 100.0 * tally.bound[i],
                tally.sd[i] / tally.bound[i], 100.0 * tally.coverage[i]);
  }
  std::printf("  ok %d, all starts agree %d, coloured %d, saturation noted %d, serious %d\n",
              tally.ok, tally.agree, tally.coloured, tally.saturation, tally.serious);
  return tally;
}

void expect_at_the_limit(const Tally& tally) {
  for (int i = 0; i < kNames; ++i) {
    EXPECT_LE(std::abs(tally.bias[i]), 0.005) << kName[i];
    EXPECT_NEAR(tally.sd[i] / tally.bound[i], 1.0, 0.08) << kName[i];
  }
  for (int i = 0; i < kNames; ++i) {
    EXPECT_GE(tally.coverage[i], 0.93) << kName[i];
    EXPECT_LE(tally.coverage[i], 0.97) << kName[i];
  }
  EXPECT_LE(tally.serious, 0.05 * tally.runs);
  EXPECT_LE(tally.saturation, 0.05 * tally.runs);
}

TEST(VehicleFitStudy, LaneChangeAtTenHertz) {
  expect_at_the_limit(study("10 Hz, 7 s", lane_change({}, 10.0), 1000));
}

TEST(VehicleFitStudy, LaneChangeAtAHundredHertz) {
  expect_at_the_limit(study("100 Hz, 7 s", lane_change({}, 100.0), 1000));
}

// The same noise on what the tool itself simulates from the samples: the difference to the first
// study is what the interpolation between 10 Hz samples costs.
TEST(VehicleFitStudy, LaneChangeOnTheToolsOwnPath) {
  Dataset data = lane_change({}, 10.0);
  VehicleParameters<double> p = sladka2010_car();
  const SingleTrack<> car = linear_car(p);
  const DrivenSegment segment =
      drive(data.time, data.u.row(0), data.u.row(1), {decay_rate_times_speed(car)});
  simulate(car, segment, 0.0, 0.0, [&](Eigen::Index t, const Motion& motion, double) {
    data.y.col(t) << motion.r, motion.vy;
  });
  expect_at_the_limit(study("10 Hz, own path", data, 500));
}

// A linear car must not be said to saturate; one whose rear axle has lost a quarter of its linear
// force must.
TEST(VehicleFitStudy, TyreSaturationAlarm) {
  constexpr int kRuns = 200;
  const Model model = sladka2010_model();
  TrueCar soft;
  soft.inverse_saturation_f = 1.0 / std::pow(8000.0, 2);
  soft.inverse_saturation_r = 1.0 / std::pow(5000.0, 2);
  int false_notes = 0, false_alarms = 0, coloured_alarms = 0, alarms = 0;
  const Dataset linear = lane_change({}, 50.0), saturating = lane_change(soft, 50.0);
  const auto severity = [&](const Dataset& data) {
    const VehicleEstimate fit = fit_vehicle(model, data, without_second_opinion());
    const Finding* w = finding(fit, FindingCode::tyre_saturation);
    return w == nullptr ? std::optional<Severity>() : w->severity;
  };
  for (int run = 0; run < kRuns; ++run) {
    const auto seed = static_cast<std::uint64_t>(run) + 5001;
    const std::optional<Severity> on_linear = severity(with_noise(linear, {0.01, 0.03}, seed));
    false_notes += on_linear ? 1 : 0;
    false_alarms += on_linear == Severity::serious ? 1 : 0;
    alarms += severity(with_noise(saturating, {0.01, 0.03}, seed)) == Severity::serious ? 1 : 0;
    // Noise with a memory of 0.2 s instead of white noise.
    Dataset drifting = linear;
    Random random(seed);
    const double memory = std::exp(-0.02 / 0.2);
    Eigen::Vector2d drift = random.normal(2);
    for (Eigen::Index t = 0; t < drifting.size(); ++t) {
      drifting.y.col(t) += drift.cwiseProduct(Eigen::Vector2d(0.01, 0.03));
      drift = memory * drift + std::sqrt(1.0 - memory * memory) * random.normal(2);
    }
    coloured_alarms += severity(drifting) == Severity::serious ? 1 : 0;
  }
  std::printf(
      "tyre saturation, %d runs: linear car noted %d, serious %d; with coloured noise serious %d; "
      "saturating car serious %d\n",
      kRuns, false_notes, false_alarms, coloured_alarms, alarms);
  EXPECT_LE(false_notes, 0.05 * kRuns);
  EXPECT_LE(false_alarms, 0.05 * kRuns);
  EXPECT_LE(coloured_alarms, 0.05 * kRuns);
  EXPECT_GE(alarms, 0.95 * kRuns);
}

}  // namespace
}  // namespace identikal
