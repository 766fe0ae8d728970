// How often do the intervals of variances hold the truth? Simulated recordings, profile and Wald.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;

const char* const kTrend = R"(identikal: 1
name: local linear trend
time: {step: 1 s}
parameters:
  level: {value: 0.5, min: 0}
  slope: {value: 0.1, min: 0}
  r: {value: 0.5, min: 0}
A: [[1, 1], [0, 1]]
C: [[1, 0]]
Q: [[level, 0], [0, slope]]
R: [[r]]
initial: diffuse
outputs: [{name: y1, column: y1}]
)";

MatrixXd simulate_trend(double level_variance, double slope_variance, double r, int samples,
                        Random& random) {
  MatrixXd y(1, samples);
  double level = 0.0, slope = 0.0;
  for (double& value : y.reshaped()) {
    value = level + std::sqrt(r) * random.normal();
    level += slope + std::sqrt(level_variance) * random.normal();
    slope += std::sqrt(slope_variance) * random.normal();
  }
  return y;
}

// 500 recordings of 250 samples. A coverage of 95 % is found within 92.1 and 97.9 % by three
// standard errors of 1 %; asked is 93 to 97 %, which a right method misses by chance in 4 % of all
// seeds, and this one is fixed. An interval of a variance at zero is one-sided. Wald's stands
// beside it.
TEST(ProfileCoverageStudy, LocalLinearTrend) {
  constexpr int kRuns = 500, kSamples = 250;
  const double truth[] = {1.0, 0.02, 1.0};
  const Model model = parse_model_file(kTrend, "trend.yaml");
  int held[3] = {}, held_by_wald[3] = {}, at_zero[3] = {}, unconverged = 0;
  Random random(17);
  for (int run = 0; run < kRuns; ++run) {
    const NoiseEstimate e = tune_ml(
        model, {dataset_of(simulate_trend(truth[0], truth[1], truth[2], kSamples, random))});
    unconverged += exit_code(e, false) == 3;
    for (int i = 0; i < 3; ++i) {
      const EstimatedParameter& p = e.parameters[static_cast<std::size_t>(i)];
      held[i] += p.ci95[0] <= truth[i] && truth[i] <= p.ci95[1];
      at_zero[i] += p.verdict == Verdict::at_bound;
      held_by_wald[i] += std::abs(p.value - truth[i]) < 1.96 * p.se;
    }
  }
  for (int i = 0; i < 3; ++i) {
    const auto share = [&](int of) { return 100.0 * of / kRuns; };
    std::printf("%-6s coverage %.1f %%, Wald %.1f %%, at zero %.1f %%\n",
                model.parameters[static_cast<std::size_t>(i)].name.c_str(), share(held[i]),
                share(held_by_wald[i]), share(at_zero[i]));
    EXPECT_GE(share(held[i]), 93.0);
    EXPECT_LE(share(held[i]), 97.0);
  }
  EXPECT_EQ(unconverged, 0);
}

}  // namespace
}  // namespace identikal
