// Do credible intervals hold what they say?
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "identify/noise/bayes.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;

TEST(NoiseBayesStudy, IntervalsCoverUnderThePrior) {
  // 400 truths drawn from the prior. The coverage of 95 % intervals has a standard error of 1.1 %.
  constexpr int kRuns = 400;
  const Prior prior{Prior::Kind::log_uniform, 0.1, 10.0};
  MatiskoSystem system = matisko_system(1);
  for (Parameter& p : system.model.parameters) p.prior = prior;
  system.samples = 200;
  Random random(7);
  int covered[2] = {0, 0};
  for (int run = 0; run < kRuns; ++run) {
    for (Index i = 0; i < 2; ++i) {
      system.truth[i] = 0.1 * std::pow(100.0, random.uniform());
    }
    const NoiseEstimate e =
        tune_bayes(system.model, {dataset_of(simulate_matisko(system, random))});
    for (std::size_t i = 0; i < 2; ++i) {
      const double truth = system.truth[static_cast<Index>(i)];
      covered[i] += e.parameters[i].ci95[0] <= truth && truth <= e.parameters[i].ci95[1];
    }
  }
  std::printf("coverage of 95 %% credible intervals: Q %.1f %%, R %.1f %%\n",
              100.0 * covered[0] / kRuns, 100.0 * covered[1] / kRuns);
  for (const int count : covered) {
    EXPECT_GE(count, 0.93 * kRuns);
    EXPECT_LE(count, 0.97 * kRuns + 2);
  }
}

}  // namespace
}  // namespace identikal
