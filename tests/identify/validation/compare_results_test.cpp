// Which results may be ranked, which are nested, and how likely a likelihood ratio is.
#include "identify/validation/compare_results.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

StoredResult stored_result(const std::string& name, double log_likelihood,
                           std::vector<EstimatedParameter> parameters) {
  StoredResult out;
  out.path = name + "/result.json";
  StoredEstimate& e = out.estimate;
  e.verb = "tune";
  e.status = Status::ok;
  e.inputs = {{"data.csv", "abc", 100, 100}};
  e.one_step = {{"y", "m", 50.0, 1.0}};
  e.objective.method = "ml";
  e.objective.initial = "stationary";
  e.objective.log_likelihood = log_likelihood;
  double k = 0.0;
  for (const EstimatedParameter& p : parameters) k += p.fixed ? 0.0 : 1.0;
  e.objective.aic = 2.0 * (k - log_likelihood);
  e.objective.samples = 100;
  e.objective.bic = k * std::log(100.0) - 2.0 * log_likelihood;
  e.parameters = std::move(parameters);
  return out;
}

EstimatedParameter seen_parameter(const std::string& name, double value, bool fixed) {
  EstimatedParameter p;
  p.name = name;
  p.value = value;
  p.fixed = fixed;
  p.bounds[0] = 0.0;
  return p;
}

const TestResult* find_test(const Comparison& e, const std::string& id) {
  for (const TestResult& test : e.tests) {
    if (test.id == id) return &test;
  }
  return nullptr;
}

// Quantiles of Self & Liang's mixtures: 2.706 is the 10 % point of chi2(1), 5.138 that of
// 1/2 chi2(1) + 1/2 chi2(2) at 5 % (Kodde & Palm 1986, table 1: 2.706, 5.138, 7.045).
TEST(CompareResults, MixturesOfChiSquares) {
  EXPECT_NEAR(likelihood_ratio_p(3.841458821, 1, 0), 0.05, 1e-9);
  EXPECT_NEAR(likelihood_ratio_p(2.705543454, 1, 1), 0.05, 1e-9);
  EXPECT_NEAR(likelihood_ratio_p(5.138, 2, 1), 0.05, 2e-5);
  EXPECT_NEAR(likelihood_ratio_p(7.045, 3, 1), 0.05, 2e-5);
  EXPECT_EQ(likelihood_ratio_p(0.0, 1, 1), 1.0);
}

TEST(CompareResults, NestedModels) {
  const auto small =
      stored_result("a", -105.0, {seen_parameter("q", 0.0, true), seen_parameter("r", 2.0, false)});
  const auto large = stored_result(
      "b", -103.0, {seen_parameter("q", 0.3, false), seen_parameter("r", 1.8, false)});
  const Comparison out = compare_results({small, large});
  const TestResult* ratio = find_test(out, "likelihood_ratio");
  ASSERT_NE(ratio, nullptr);
  EXPECT_EQ(ratio->channel, "a in b");
  EXPECT_DOUBLE_EQ(ratio->value, 4.0);
  EXPECT_NEAR(ratio->p, 0.5 * 0.04550026389635842, 1e-12);  // half of P(chi2(1) > 4)
  EXPECT_NEAR(ratio->interval[1], 2.705543454095404, 1e-6);
  EXPECT_FALSE(ratio->pass);
  EXPECT_THAT(out.message, HasSubstr("b has the lowest AIC"));

  // Known inside the bounds: no mixture.
  auto inside = small;
  inside.estimate.parameters[0].value = 1.0;
  EXPECT_NEAR(find_test(compare_results({large, inside}), "likelihood_ratio")->p,
              0.04550026389635842, 1e-12);
  // Another known value of what both know: not nested.
  auto known = large, other = small;
  known.estimate.parameters.push_back(seen_parameter("m", 1.0, true));
  other.estimate.parameters.push_back(seen_parameter("m", 2.0, true));
  EXPECT_EQ(find_test(compare_results({known, other}), "likelihood_ratio"), nullptr);
  // A larger model that is less likely was not found.
  const auto missed = stored_result("c", -106.0, large.estimate.parameters);
  const Comparison odd = compare_results({small, missed});
  EXPECT_EQ(find_test(odd, "likelihood_ratio"), nullptr);
  EXPECT_THAT(odd.notes.back(), HasSubstr("missed the maximum"));
}

TEST(CompareResults, WhatCannotBeRanked) {
  const auto a = stored_result("a", -105.0, {seen_parameter("r", 2.0, false)});
  const auto refusal = [&](auto change) -> std::string {
    StoredResult b = stored_result("b", -103.0, {seen_parameter("r", 2.0, false)});
    change(b.estimate);
    try {
      compare_results({a, b});
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_EQ(text.find('\n'), std::string::npos);
      EXPECT_THAT(text, HasSubstr("b/result.json"));
      return text;
    }
    return "ranked";
  };
  EXPECT_EQ(refusal([](StoredEstimate&) {}), "ranked");
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.inputs[0].sha256 = "abd"; }),
              HasSubstr("other data"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.inputs[0].used = 99; }), HasSubstr("other rows"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.one_step[0].channel = "z"; }),
              HasSubstr("other outputs"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.objective.method = "output_error"; }),
              HasSubstr("another kind"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.objective.method = "als-weighted"; }),
              HasSubstr("maximises no likelihood"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.objective.initial = "diffuse"; }),
              HasSubstr("does not say how likely its first samples are"));
  EXPECT_THAT(refusal([](StoredEstimate& e) { e.objective.samples = 98; }),
              HasSubstr("98 measured values"));
  EXPECT_THROW(compare_results({a}), InputError);
}

}  // namespace
}  // namespace identikal
