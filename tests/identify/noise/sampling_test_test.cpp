#include "identify/noise/internal/sampling_test.h"

#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "identify/estimate/distribution.h"
#include "identify/noise/ml.h"
#include "lib/filter/kalman.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

NoiseMlOptions one_start() {
  NoiseMlOptions options;
  options.starts = 1;
  options.profiles = false;
  return options;
}

// Where it passes: p is evenly distributed. 300 recordings know a share of 10 % to 1.7 %; the
// bounds are four of that wide.
TEST(SamplingTest, HasItsLevelWhereTheModelIsRight) {
  constexpr int kRuns = 300;
  for (const int every : {2, 3}) {
    int below_tenth = 0, below_half = 0, tests = 0;
    for (int run = 0; run < kRuns; ++run) {
      const Dataset data =
          dataset_of(simulate_scalar(0.9, 1.0, 2.0, 1000, static_cast<std::uint64_t>(run)));
      const Model model = scalar_model(0.9, 1.0, 2.0);
      const NoiseEstimate e = tune_ml(model, {data}, one_start());
      Eigen::VectorXd at(2);
      at << e.parameters[0].value, e.parameters[1].value;
      if (at.minCoeff() <= 0.0) continue;
      const SamplingTest test =
          sampling_test(model, with_entries(model.parameters, at), {data}, {0, 1}, every);
      ASSERT_EQ(test.dof, 2);
      const double p = chi_square_upper_tail(test.value, test.dof);
      ++tests;
      below_tenth += p < 0.1;
      below_half += p < 0.5;
    }
    std::printf("every %d: %d tests, p below 0.1 in %.1f %%, below 0.5 in %.1f %%\n", every, tests,
                100.0 * below_tenth / tests, 100.0 * below_half / tests);
    EXPECT_NEAR(below_tenth, 0.1 * tests, 4.0 * std::sqrt(0.09 * tests));
    EXPECT_NEAR(below_half, 0.5 * tests, 4.0 * std::sqrt(0.25 * tests));
  }
}

// The log-likelihood of every third sample is that of all with the others missing; so is its
// gradient, and one step of scoring says where its maximum lies.
TEST(SamplingTest, ShiftLeadsToTheMaximumOfTheThinnedRecording) {
  const Dataset data = dataset_of(simulate_scalar(0.8, 1.0, 1.0, 6000, 3));
  const Model model = scalar_model(0.8, 1.0, 1.0);
  const NoiseEstimate all = tune_ml(model, {data}, one_start());
  Dataset thinned = data;
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (t % 3 != 0) thinned.y.col(t).setConstant(std::nan(""));
  }
  const NoiseEstimate some = tune_ml(model, {thinned}, one_start());
  VectorXd at(2);
  at << all.parameters[0].value, all.parameters[1].value;
  const SamplingTest test =
      sampling_test(model, with_entries(model.parameters, at), {data}, {0, 1}, 3);
  for (Eigen::Index i = 0; i < 2; ++i) {
    const EstimatedParameter& p = some.parameters[static_cast<std::size_t>(i)];
    EXPECT_NEAR(at[i] + test.shift[i], p.value, 0.15 * p.se) << p.name;
  }
}

// Measurement noise that follows its own past, as much of it as the innovations hardly show.
TEST(SamplingTest, SeesColour) {
  Random random(5);
  MatrixXd y(1, 4000);
  double x = 0.0, v = 0.0;
  for (Eigen::Index t = 0; t < y.cols(); ++t) {
    v = 0.6 * v + 0.8 * random.normal();
    y(0, t) = x + v;
    x = 0.98 * x + random.normal();
  }
  const NoiseEstimate e = tune_ml(scalar_model(0.98, 1.0, 1.0), {dataset_of(y)}, one_start());
  EXPECT_EQ(e.status, Status::untrusted) << e.message;
  const bool said = std::any_of(e.findings.begin(), e.findings.end(), [](const Finding& f) {
    return f.code == FindingCode::depends_on_sampling;
  });
  EXPECT_TRUE(said);
}

TEST(SamplingTest, NoneFarFromTheMaximum) {
  const Dataset data = dataset_of(simulate_scalar(0.9, 1.0, 1.0, 1000, 1));
  const Model model = scalar_model(0.9, 9.0, 9.0);
  EXPECT_EQ(sampling_test(model, model.parameters, {data}, {0, 1}, 2).dof, 0);
}

}  // namespace
}  // namespace identikal
