// Other values that are as likely as the estimates: what is said of them.

#include "identify/noise/internal/equal_maxima.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

// A tablet of 1 is absorbed at ka and eliminated at ke: with the rates exchanged, and the volume
// times their ratio, the blood holds the same (Gibaldi & Perrier 1982, flip-flop kinetics).
Model absorption(const std::string& bounds_of_ka) {
  return parse_model_file(R"(identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters:
  ka: {value: 0.9, )" + bounds_of_ka +
                              R"(}
  ke: {value: 0.4, min: 0.01, max: 10}
  V: {value: 1, min: 0.01, max: 100}
  s: {value: 0.1, min: 1e-4, max: 10}
states: [gut, blood]
dynamics: {gut: -ka*gut, blood: ka*gut - ke*blood}
outputs: {level: {column: level, equals: blood/V}}
noise: {measurement: {sd: {level: s}}}
initial: {mean: {gut: 1, blood: 0}}
)",
                          "absorption.yaml");
}

Dataset absorbed(const Model& model) {
  Random random(2);
  MatrixXd y(1, 30);
  VectorXd time(30);
  for (Index t = 0; t < 30; ++t) {
    time[t] = 0.5 * static_cast<double>(t);
    y(0, t) = 1.5 / (1.5 - 0.3) * (std::exp(-0.3 * time[t]) - std::exp(-1.5 * time[t])) / 2.0 +
              0.005 * random.normal();
  }
  return recording(model, y, SampleTimes(time));
}

const Finding* several_of(const NoiseEstimate& estimate) {
  const auto at =
      std::find_if(estimate.findings.begin(), estimate.findings.end(),
                   [](const Finding& f) { return f.code == FindingCode::several_maxima; });
  return at == estimate.findings.end() ? nullptr : &*at;
}

TEST(EqualMaxima, AreUntrustedByNameAndTheRestIsOk) {
  const Model model = absorption("min: 0.01, max: 10");
  NoiseMlOptions options;
  options.starts = 10;
  const NoiseEstimate estimate = tune_ml(model, {absorbed(model)}, options);
  const Finding* const found = several_of(estimate);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->severity, Severity::serious);
  EXPECT_THAT(found->about, ::testing::ElementsAre("ka", "ke", "V"));
  EXPECT_THAT(found->text, HasSubstr("other values are as likely as the estimates: ka = "));
  EXPECT_EQ(estimate.status, Status::untrusted);
  EXPECT_EQ(estimate.parameters[0].verdict, Verdict::untrusted);
  EXPECT_EQ(estimate.parameters[3].verdict, Verdict::ok);  // s
}

TEST(EqualMaxima, ABoundThatOnlyOneIsWithinTellsThem) {
  const Model model = absorption("min: 0.7, max: 10");
  NoiseMlOptions options;
  options.starts = 10;
  const NoiseEstimate estimate = tune_ml(model, {absorbed(model)}, options);
  EXPECT_EQ(several_of(estimate), nullptr);
  EXPECT_EQ(estimate.status, Status::ok);
  EXPECT_NEAR(estimate.parameters[0].value, 1.5, 4.0 * estimate.parameters[0].se);
}

// Of two exponentials either may be the first: the curve is one, and this is a note.
TEST(EqualMaxima, TermsOfASumMayExchange) {
  const Model model = parse_model_file(R"(identikal: 1
model: static
parameters:
  a1: {value: 1, min: 0, max: 10}
  b1: {value: 0.5, min: 0.01, max: 10}
  a2: {value: 1, min: 0, max: 10}
  b2: {value: 0.6, min: 0.01, max: 10}
  s: {value: 0.1, min: 1e-4, max: 10}
inputs: {x: {column: x}}
outputs: {y: {column: y, equals: a1*exp(-b1*x) + a2*exp(-b2*x)}}
noise: {measurement: {sd: {y: s}}}
)",
                                       "sum.yaml");
  Random random(4);
  MatrixXd y(1, 60), x(1, 60);
  for (Index t = 0; t < 60; ++t) {
    x(0, t) = 0.25 * static_cast<double>(t);
    y(0, t) =
        2.0 * std::exp(-0.2 * x(0, t)) + 3.0 * std::exp(-1.5 * x(0, t)) + 0.002 * random.normal();
  }
  NoiseMlOptions options;
  options.starts = 10;
  const NoiseEstimate estimate = tune_ml(model, {recording(model, y, 1.0, x)}, options);
  const Finding* const found = several_of(estimate);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->severity, Severity::note);
  EXPECT_THAT(found->text, HasSubstr("the parameters may exchange their values"));
  EXPECT_EQ(estimate.status, Status::ok);
}

}  // namespace
}  // namespace identikal
