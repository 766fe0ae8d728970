// Noise covariances from sample to sample: the recursive posterior is the posterior, a change is
// found and followed, and nothing else is taken for one.
#include "identify/noise/track.h"

#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/noise_change.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(NoiseTrack, ConstantNoiseGivesThePosteriorOfAllSamples) {
  const MatiskoSystem system = matisko_system(1);
  Random random(1);
  const Dataset data = dataset_of(simulate_matisko(system, random));
  NoiseTrackOptions options;
  options.draws = 1000;
  const NoiseTrack track = track_noise(system.model, data, options);
  const PosteriorPoints grid = posterior(system.model, {data});
  const VectorXd mean = grid.entries * grid.weight;
  const VectorXd sd = ((grid.entries.colwise() - mean).cwiseAbs2() * grid.weight).cwiseSqrt();
  for (Index i = 0; i < 2; ++i) {
    std::printf("recursive %.4f +- %.4f, grid %.4f +- %.4f\n", track.mean(i, data.size() - 1),
                track.sd(i, data.size() - 1), mean[i], sd[i]);
    // Standard errors of 500 effective draws: sd / 22 of the mean, 3.2 % of sd.
    EXPECT_NEAR(track.mean(i, data.size() - 1), mean[i], 4.0 / 22.0 * sd[i]);
    EXPECT_NEAR(track.sd(i, data.size() - 1), sd[i], 4.0 * 0.032 * sd[i]);
  }
  // What the samples ahead of it make of each sample adds up to the evidence.
  std::printf("log evidence: recursive %.3f, grid %.3f\n", track.filter.log_likelihood,
              grid.log_evidence);
  EXPECT_NEAR(track.filter.log_likelihood, grid.log_evidence, 0.5);
  EXPECT_TRUE(track.changes.empty());
}

TEST(NoiseTrack, AChangeIsFoundAndFollowed) {
  const NoiseChangeCase c = system_with_change(matisko_system(1), 0, 10.0, 1000, 1500, 1);
  NoiseTrackOptions options;
  options.adaptive = true;
  const NoiseTrack track = track_noise(c.model, c.data, options);
  ASSERT_EQ(track.changes.size(), 1u);
  EXPECT_NEAR(static_cast<double>(track.changes[0].since), 1000.0, 10.0);
  EXPECT_LT(track.changes[0].found, 1050);
  EXPECT_TRUE(track.sd.leftCols(1000).array().isNaN().all());
  for (Index i = 0; i < 2; ++i) {
    EXPECT_LT(std::abs(track.mean(i, 2499) - c.after[i]), 3.5 * track.sd(i, 2499));
  }
}

// Up to where it was stopped, all is as without stopping.
TEST(NoiseTrack, StopsWhenTold) {
  const NoiseChangeCase c = system_with_change(matisko_system(1), 0, 10.0, 300, 300, 5);
  NoiseTrackOptions options;
  options.adaptive = true;
  const TrackedNoise whole = track(c.model, c.data, options);
  for (const Index last : {100, 450}) {
    options.progress = [&](Index sample, Index of) {
      EXPECT_EQ(of, 600);
      return sample < last;
    };
    const TrackedNoise e = track(c.model, c.data, options);
    EXPECT_EQ(e.status, Status::not_converged);
    EXPECT_EQ(e.message, "stopped by the caller after " + std::to_string(last) + " of 600 samples");
    ASSERT_EQ(e.time_history.mean.cols(), last);
    EXPECT_EQ(e.series.time.size(), last);
    EXPECT_EQ(e.time_history.mean, whole.time_history.mean.leftCols(last));
    EXPECT_EQ(e.time_history.changes.size(), last > 300 ? 1u : 0u);
  }
}

TEST(NoiseTrack, AnOutlierIsNoChange) {
  MatiskoSystem system = matisko_system(1);
  Random random(3);
  MatrixXd y = simulate_matisko(system, random);
  y(0, 500) += 100.0;
  system.model.parameters = with_entries(system.model.parameters, system.truth);
  NoiseTrackOptions options;
  options.adaptive = true;
  const NoiseTrack track = track_noise(system.model, dataset_of(y), options);
  EXPECT_TRUE(track.changes.empty());
  EXPECT_LT(track.log_alarm.maxCoeff(), track.log_threshold);
}

TEST(NoiseTrack, DiffuseStartAndMissingSamples) {
  Model model = scalar_model(1.0, 1.0, 1.0);
  as_linear(model).initial = InitialState::diffuse;
  for (Parameter& p : model.parameters) p.prior = {Prior::Kind::log_uniform, 1e-3, 1e3};
  Random random(4);
  MatrixXd y(1, 400);
  double level = 1e4;
  for (Index t = 0; t < 400; ++t) {
    y(0, t) = level + 2.0 * random.normal();
    level += random.normal();
  }
  y.middleCols(100, 30).setConstant(std::nan(""));
  y(0, 0) = std::nan("");
  NoiseTrackOptions options;
  options.draws = 1000;
  const Dataset data = dataset_of(y);
  const NoiseTrack track = track_noise(model, data, options);
  const PosteriorPoints grid = posterior(model, {data});
  const VectorXd mean = grid.entries * grid.weight;
  const VectorXd sd = ((grid.entries.colwise() - mean).cwiseAbs2() * grid.weight).cwiseSqrt();
  for (Index i = 0; i < 2; ++i) {
    EXPECT_NEAR(track.mean(i, 399), mean[i], 4.0 / 22.0 * sd[i]);
    EXPECT_NEAR(track.sd(i, 399), sd[i], 4.0 * 0.032 * sd[i]);
  }
  EXPECT_TRUE(track.filter.e.middleCols(100, 30).array().isNaN().all());
}

TEST(NoiseTrack, TheResultSaysWhatHappened) {
  const NoiseChangeCase c = system_with_change(matisko_system(1), 0, 10.0, 300, 300, 5);
  NoiseTrackOptions options;
  options.adaptive = true;
  const TrackedNoise e = track(c.model, c.data, options);
  EXPECT_EQ(e.status, Status::ok);
  ASSERT_EQ(e.time_history.changes.size(), 1u);
  EXPECT_GT(e.time_history.changes[0].after[0], 5.0 * e.time_history.changes[0].before[0]);
  EXPECT_EQ(e.time_history.mean.cols(), 600);
  // Nothing changes: the file's noise stands.
  Dataset quiet = c.data;
  quiet.y.conservativeResize(Eigen::NoChange, 300);
  quiet.time.conservativeResize(300);
  const TrackedNoise same = track(c.model, quiet, options);
  EXPECT_EQ(same.status, Status::ok);
  EXPECT_TRUE(same.time_history.changes.empty());
  EXPECT_TRUE(std::isnan(same.parameters[0].se));
  EXPECT_NE(same.message.find("stands after 300 samples"), std::string::npos);
}

TEST(NoiseTrack, RefusesWhatIsNotNoise) {
  MatiskoSystem system = matisko_system(1);
  Random random(5);
  const Dataset data = dataset_of(simulate_matisko(system, random));
  Parameter a;
  a.name = "a";
  a.value = MatrixXd::Constant(1, 1, 0.5);
  a.min = 0.0;
  a.max = 0.9;
  system.model.parameters.push_back(a);
  as_linear(system.model).A.constant.setZero();
  as_linear(system.model).A.entries = {{0, 0, 2, 1.0}};
  EXPECT_THROW(track(system.model, data), InputError);
}

}  // namespace
}  // namespace identikal
