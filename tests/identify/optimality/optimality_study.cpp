// False alarms, power and speed of the optimality tests.
#include <cstdio>
#include <ctime>
#include <map>

#include <gtest/gtest.h>

#include "identify/estimate/distribution.h"
#include "identify/optimality/optimality.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/whiteness.h"
#include "studies/optimality.h"
#include "tests/support/matisko_example_1.h"
#include "tests/support/optimality_case.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// A rate of 5 % has a standard error of 0.49 % with 2000 seeds. That some of sixty rates then leave
// 4 to 6 % by chance is certain; with 8000 it is 0.24 %, and chance does not decide.
constexpr int kPowerSeeds = 2000, kAlarmSeeds = 8000;

StateSpace three_outputs() {
  Random random(7);
  return random_model(random, 4, 1, 3, 3);
}

// % of seeds in which each test has p < 5 %, per channel where there are several; "default" is the
// verdict, the others in quotes are as published.
std::map<std::string, double> alarms(const StateSpace& truth, const StateSpace& tuned, Index N,
                                     int seeds) {
  const Model model = fixed_model(tuned);
  std::map<std::string, double> out, count;
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(seeds); ++seed) {
    Random random(seed);
    const Dataset data = recording_of(truth, N, random);
    const FilterResult filter = innovations_of(model, data);
    const Optimality found = test_optimality(model, {data}, {filter});
    out["default"] += !found.optimal;
    count["default"] += 1.0;
    for (const TestResult& t : found.tests) {
      if (std::isnan(t.p)) continue;
      out[t.id] += t.p < 0.05;
      count[t.id] += 1.0;
    }
    const Autocovariances Y = sample_autocovariances(filter.e, 21, Divisor::equal_variance);
    const Autocovariances gamma = autocorrelations(Y);
    out["'Test 1'"] += (mehra_share(gamma, N, 1.959964).array() <= 0.95).any();
    out["'Test 2'"] +=
        (published_chi_square(gamma, N).array() > chi_square_quantile(0.95, 20)).any();
    out["'Test 3'"] +=
        autoregressive_order(yule_walker({Y.begin(), Y.begin() + 11}), N, Penalty::bic).order > 0;
    for (const char* id : {"'Test 1'", "'Test 2'", "'Test 3'"}) count[id] += 1.0;
  }
  for (auto& [id, rate] : out) rate *= 100.0 / count[id];
  std::printf("N %4ld:", static_cast<long>(N));
  for (const auto& [id, rate] : out) std::printf("  %s %.1f", id.c_str(), rate);
  std::printf(" %%\n");
  return out;
}

// Each calibrated test between 4 and 6 %; all together at most 6 %, as Bonferroni is an upper
// bound.
TEST(OptimalityStudy, FalseAlarms) {
  for (const bool several : {false, true}) {
    const StateSpace truth = several ? three_outputs() : matisko_example_1();
    std::printf("%s, false alarms at 5 %%\n", several ? "3 outputs" : "Example 1");
    for (const Index N : {200, 500, 1000}) {
      for (const auto& [id, rate] : alarms(truth, truth, N, kAlarmSeeds)) {
        if (id[0] == '\'') continue;
        if (id != "default" && id != "score_entry") {
          EXPECT_GE(rate, 4.0) << id << " " << N;
        }
        EXPECT_LE(rate, 6.0) << id << " " << N;
      }
    }
  }
}

// Wanted at 5 % false alarms: 50 88 99 % and 41 76 97 %.
TEST(OptimalityStudy, Power) {
  const double wanted[2][3] = {{50, 88, 99}, {41, 76, 97}};
  for (int tuning = 1; tuning <= 2; ++tuning) {
    std::printf("Example 1, tuning %d, detected\n", tuning);
    const Index lengths[] = {200, 500, 1000};
    for (int n = 0; n < 3; ++n) {
      auto rate =
          alarms(matisko_example_1(), matisko_example_1_tuning(tuning), lengths[n], kPowerSeeds);
      EXPECT_GE(rate["default"], wanted[tuning - 1][n]);
      EXPECT_GT(rate["score"], rate["portmanteau"] - 0.1);
    }
  }
}

TEST(OptimalityStudy, Speed) {
  const StateSpace truth = three_outputs();
  Random random(1);
  const Model model = fixed_model(truth);
  const Dataset data = recording_of(truth, 1000000, random);
  const FilterResult filter = innovations_of(model, data);
  const std::clock_t begin = std::clock();  // of this process: one core, whoever else uses it
  const Optimality found = test_optimality(model, {data}, {filter});
  const double spent = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf("3 outputs, N = 1e6, all tests: %.2f s of one core, %s\n", spent,
              found.optimal ? "optimal" : "not optimal");
  EXPECT_LT(spent, 1.0);
}

TEST(OptimalityStudy, Tables) {
  StudyOptions options;
  options.runs = 200;
  for (const Study& table : optimality_studies()) {
    std::printf("%s\n", table.run(options).text.c_str());
  }
}

}  // namespace
}  // namespace identikal
