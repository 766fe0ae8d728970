// Two methods must agree where the model describes the data, and a word is said where they do not.
#include "identify/noise/auto.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/noise/als.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

bool disagrees(const Estimate& estimate) {
  return std::any_of(estimate.findings.begin(), estimate.findings.end(),
                     [](const Finding& f) { return f.code == FindingCode::methods_disagree; });
}

// The maximum is that of tune_ml() from the model's own start, far from it.
TEST(NoiseAuto, FindsTheMaximumOfTheLikelihood) {
  const Dataset data = dataset_of(simulate_scalar(0.8, 1.0, 2.0, 2000, 5));
  const Model model = scalar_model(0.8, 0.05, 20.0);
  const NoiseEstimate both = tune_auto(model, {data}), alone = tune_ml(model, {data});
  ASSERT_EQ(both.status, Status::ok) << both.message;
  EXPECT_EQ(both.objective.method, "auto");
  EXPECT_NEAR(both.objective.log_likelihood, alone.objective.log_likelihood, 1e-6);
  for (std::size_t i = 0; i < both.parameters.size(); ++i) {
    const EstimatedParameter& p = both.parameters[i];
    EXPECT_NEAR(p.value, alone.parameters[i].value, 1e-3 * p.se) << p.name;
  }
  EXPECT_FALSE(disagrees(both));
}

// Where autocovariance least squares has no answer, the result is that of the likelihood alone.
TEST(NoiseAuto, SaysWhyThereIsNoSecondOpinion) {
  Model model = scalar_model(0.8, 1.0, 1.0);
  Parameter a = model.parameters.front();
  a.name = "a";
  a.value(0, 0) = 0.8;
  a.min = 0.0;
  a.max = 0.99;
  model.parameters.push_back(a);
  as_linear(model).A.entries = {{0, 0, 2, 1.0}};
  as_linear(model).A.constant.setZero();
  const NoiseEstimate out = tune_auto(model, {dataset_of(simulate_scalar(0.8, 1.0, 2.0, 1000, 6))});
  EXPECT_THAT(out.notes, testing::Contains(testing::HasSubstr("no second opinion")));
  EXPECT_FALSE(disagrees(out));
}

}  // namespace
}  // namespace identikal
