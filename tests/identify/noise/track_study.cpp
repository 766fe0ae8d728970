// How well does the recursive estimate do over many recordings: against the bound, after changes,
// and without any?
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "identify/noise/track.h"
#include "lib/filter/filter_bank.h"
#include "lib/filter/steady_state.h"
#include "tests/support/noise_change.h"
#include "tests/support/noise_study.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of 95 % intervals over 50 runs at least 43 hold the truth, but for one set in 200. System 1,
// whose R is known to 71 % only, says more of the prior than of the method.
TEST(NoiseTrackStudy, RecursiveReachesTheBound) {
  for (const int number : {6, 7}) {
    const MatiskoSystem system = matisko_system(number);
    const NoiseStudy s =
        study("recursive, System " + std::to_string(number), system,
              simulated_recordings(system, 50, 11), [&](const std::vector<Dataset>& data) {
                return NoiseEstimate{track(system.model, data.front()), {}, {}, {}};
              });
    EXPECT_EQ(s.indefinite, 0);
    EXPECT_GE(s.coverage.minCoeff(), 43.0 / 50.0);
    // The standard deviation of 50 runs is off by 10 %: 1.3 is three of that.
    EXPECT_LE(s.ratio.maxCoeff(), 1.3);
  }
}

struct Following {
  int found = 0, close = 0, again = 0;
  double delay = 0.0;
};
Following follow(const MatiskoSystem& system, int runs) {
  Following out;
  for (int run = 0; run < runs; ++run) {
    const NoiseChangeCase c =
        system_with_change(system, 0, 10.0, 1000, 3000, static_cast<std::uint64_t>(100 + run));
    NoiseTrackOptions options;
    options.adaptive = true;
    const NoiseTrack track = track_noise(c.model, c.data, options);
    if (track.changes.empty()) continue;
    out.found += track.changes[0].found >= 1000 && track.changes[0].found < 1500;
    out.delay += static_cast<double>(track.changes[0].found - 1000);
    out.again += track.changes.size() > 1;
    // 500 samples later: within the interval, and the error is no more than 30 %.
    const double error = std::abs(track.mean(0, 1500) - c.after[0]);
    out.close += error < 2.6 * track.sd(0, 1500) && error < 0.3 * c.after[0];
  }
  out.delay /= static_cast<double>(runs);
  return out;
}

TEST(NoiseTrackStudy, AChangeOfQIsFollowedWithin500Samples) {
  constexpr int kRuns = 40;
  for (const int number : {1, 6, 7}) {
    const Following f = follow(matisko_system(number), kRuns);
    std::printf(
        "System %d, Q x 10: found within 500 samples in %d of %d (mean delay %.1f), estimate "
        "within "
        "30 %% and its 99 %% interval 500 samples later in %d, another alarm in the next 3000 in "
        "%d\n",
        number, f.found, kRuns, f.delay, f.close, f.again);
    EXPECT_EQ(f.found, kRuns);
    EXPECT_GE(f.close, kRuns * 9 / 10);
    EXPECT_LE(f.again, 2);
  }
}

TEST(NoiseTrackStudy, FalseAlarmsAreRarerThanStated) {
  MatiskoSystem system = matisko_system(6);
  system.samples = 20000;
  system.model.parameters = with_entries(system.model.parameters, system.truth);
  Random random(7);
  NoiseTrackOptions options;
  options.adaptive = true;
  options.samples_per_false_alarm = 1e4;
  std::size_t alarms = 0;
  for (int run = 0; run < 10; ++run) {
    alarms += track_noise(system.model, dataset_of(simulate_matisko(system, random)), options)
                  .changes.size();
  }
  std::printf("%zu false alarms in 2e5 samples, at most 20 on average\n", alarms);
  EXPECT_LE(alarms, 20u);
}

// Example 2 of the source, section 3.4: from Q = 0.01 I, R = 100.
TEST(NoiseTrackStudy, AdaptiveFilterConvergesFromAPoorStart) {
  const MatiskoSystem system = matisko_adaptive();
  const MatrixXd optimal = steady_state(true_system(system))->K;
  const MatrixXd start =
      steady_state(instantiate(as_linear(system.model), system.model.parameters))->K;
  constexpr int kRuns = 20;
  double at[4] = {0, 0, 0, 0};
  double ml_like = 0.0;
  Random random(21);
  NoiseTrackOptions options;
  options.adaptive = true;
  for (int run = 0; run < kRuns; ++run) {
    const NoiseTrack track =
        track_noise(system.model, dataset_of(simulate_matisko(system, random)), options);
    const Index times[] = {49, 199, 499, 1999};
    for (int i = 0; i < 4; ++i) {
      const auto steady = steady_state(
          instantiate(as_linear(system.model),
                      with_entries(system.model.parameters, track.mean.col(times[i]))));
      ASSERT_TRUE(steady.has_value());
      at[i] += (steady->K - optimal).norm() / kRuns;
    }
    ml_like += static_cast<double>(track.changes.size()) / kRuns;
  }
  std::printf(
      "|K - K_opt|: start %.3f, after 50 %.3f, 200 %.3f, 500 %.3f, 2000 %.3f samples; %.2f "
      "changes\n",
      (start - optimal).norm(), at[0], at[1], at[2], at[3], ml_like);
  EXPECT_LT(at[3], 0.1 * (start - optimal).norm());
}

TEST(NoiseTrackStudy, Speed) {
  const MatiskoSystem system = matisko_system(7);
  Random random(1);
  const Dataset data = dataset_of(simulate_matisko(system, random));
  const StateSpace truth = true_system(system);
  constexpr Index kMembers = 4096;
  FilterBank bank = filter_bank(truth, kMembers);
  for (Index i = 0; i < kMembers; ++i) {
    set_noise(bank, i, truth);
    set_state(bank, i, VectorXd::Zero(4), MatrixXd::Identity(4, 4));
  }
  VectorXd density(kMembers);
  auto begin = std::chrono::steady_clock::now();
  for (Index t = 0; t < 300; ++t) step(bank, data.y.col(t), data.u.col(t), density);
  const std::chrono::duration<double> bank_time = std::chrono::steady_clock::now() - begin;
  begin = std::chrono::steady_clock::now();
  const NoiseTrack t = track_noise(system.model, data);
  const std::chrono::duration<double> track_time = std::chrono::steady_clock::now() - begin;
  std::printf(
      "bank of %d filters, n 4, r 2: %.1f ns a filter and sample; recursive posterior of System 7, "
      "3000 samples, 400 draws: %.2f s, %d renewals\n",
      static_cast<int>(kMembers), 1e9 * bank_time.count() / (300.0 * kMembers), track_time.count(),
      t.posterior.summary.iterations);
  EXPECT_LT(track_time.count(), 5.0);
}

}  // namespace
}  // namespace identikal
