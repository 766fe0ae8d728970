// What experiments ask of a model of formulas besides its equations: logarithms of what was
// measured, rows in a steady state, doses that depend on the state, numbers by recording.

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "identify/simulation/simulate.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

// x' = -k x from x0, seen as it is, or by its logarithm.
std::string fading(const std::string& output, const std::string& more_time = "",
                   const std::string& dynamics = "-k*x") {
  return R"(identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular)" +
         more_time + R"(}
parameters:
  k: {value: 0.7 1/s, min: 0.01, max: 10}
  x0: {value: 3, min: 0.1, max: 100}
  s: {value: 0.1, min: 0.001, max: 10}
states: {x: 1}
inputs: {u: {column: u, unit: 1}}
dynamics: {x: ")" +
         dynamics + R"("}
outputs: {y: {column: y, unit: 1, )" +
         output + R"(}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {x: x0}}
)";
}

Dataset seen(const Model& model, VectorXd time, std::uint64_t seed = 1) {
  Random random(seed);
  MatrixXd y(1, time.size());
  for (Index k = 0; k < time.size(); ++k) {
    const double t = std::isfinite(time[k]) ? time[k] : 1e3;
    y(0, k) = (2.8 * std::exp(-0.65 * t) + 0.5) * std::exp(0.1 * random.normal());
  }
  return recording(model, y, SampleTimes(time), MatrixXd::Constant(1, time.size(), 0.4));
}

double log_normal_density(double y, double median, double s) {
  const double e = (std::log(y) - std::log(median)) / s;
  return -0.5 * e * e - std::log(s * y) - 0.5 * std::log(2.0 * M_PI);
}

void expect_slopes_of_differences(const Model& model, const std::vector<Dataset>& all,
                                  double tolerance) {
  RecordingsLikelihood likelihood(model, all);
  const Likelihood exact = *likelihood.evaluate(model.parameters, true);
  const VectorXd at = coordinates(model.parameters);
  for (Index i = 0; i < at.size(); ++i) {
    VectorXd moved = at;
    const double h = 1e-5 * at[i];
    moved[i] = at[i] + h;
    const double above =
        likelihood.evaluate(with_coordinates(model.parameters, moved), false)->value;
    moved[i] = at[i] - h;
    const double below =
        likelihood.evaluate(with_coordinates(model.parameters, moved), false)->value;
    const double slope = (above - below) / (2.0 * h);
    EXPECT_NEAR(exact.gradient[i], slope, tolerance * (1.0 + std::abs(slope))) << i;
  }
}

void expect_refused(const std::string& text, const std::string& expected) {
  try {
    parse_model_file(text, "a.yaml");
    ADD_FAILURE() << "not refused: " << text;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(expected));
  }
}

TEST(Conditions, LogarithmsHaveTheDensityOfWhatWasMeasured) {
  const VectorXd time = VectorXd::LinSpaced(12, 0.0, 3.3);
  for (const std::string& word : {std::string("log"), std::string("log10")}) {
    const Model model = parse_model_file(fading("equals: x, transform: " + word), "a.yaml");
    const Dataset data = seen(model, time);
    const double base = word == "log" ? 1.0 : std::log(10.0);
    double expected = 0.0;
    for (Index k = 0; k < time.size(); ++k) {
      const double y = std::exp(base * data.y(0, k));
      expected += log_normal_density(y, 3.0 * std::exp(-0.7 * time[k]), 0.1 * base);
    }
    const std::vector<Dataset> all{data};
    RecordingsLikelihood likelihood(model, all);
    const double allowed = 1e-6 * std::abs(expected);
    EXPECT_NEAR(likelihood.evaluate(model.parameters, true)->value, expected, allowed) << word;
    EXPECT_NEAR(run_filter(model, model.parameters, data).log_likelihood, expected, allowed)
        << word;
  }
}

TEST(Conditions, NaturalAndCommonLogarithmsAreOneModel) {
  const VectorXd time = VectorXd::LinSpaced(20, 0.0, 3.0);
  const Model natural = parse_model_file(fading("equals: x, transform: log"), "a.yaml");
  const Model common = parse_model_file(fading("equals: x, transform: log10"), "a.yaml");
  const NoiseEstimate a = tune_ml(natural, {seen(natural, time)});
  const NoiseEstimate b = tune_ml(common, {seen(common, time)});
  EXPECT_NEAR(a.objective.log_likelihood, b.objective.log_likelihood, 1e-5);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(a.parameters[i].value, b.parameters[i].value, 1e-5 * a.parameters[i].value);
    EXPECT_NEAR(a.parameters[i].se, b.parameters[i].se, 1e-3 * a.parameters[i].se);
  }
}

TEST(Conditions, WhatHasNoLogarithmIsRefused) {
  const Model model = parse_model_file(fading("equals: x, transform: log"), "a.yaml");
  EXPECT_THROW(recording(model, MatrixXd::Zero(1, 3), SampleTimes(VectorXd{{0.0, 1.0, 2.0}}),
                         MatrixXd::Zero(1, 3)),
               std::invalid_argument);
  expect_refused(fading("equals: x, transform: root"), "transform");
  expect_refused(fading("equals: x, transform: log, scale: 2"), "scale");
  expect_refused(fading("equals: 'atan2(x, 1)', wrap: true, transform: log"), "wraps");
}

// x' = k (u - x) has the steady state u.
TEST(Conditions, RowsAtInfinityAreInTheSteadyState) {
  const Model model =
      parse_model_file(fading("equals: x", ", infinity: steady-state", "k*(u - x)"), "a.yaml");
  const VectorXd time{{0.0, 0.5, 1.0, 2.0, kInfinity, kInfinity}};
  const Dataset data = seen(model, time);
  double expected = 0.0;
  for (Index k = 0; k < time.size(); ++k) {
    const double x = 0.4 + (std::isfinite(time[k]) ? 2.6 * std::exp(-0.7 * time[k]) : 0.0);
    const double e = (data.y(0, k) - x) / 0.1;
    expected += -0.5 * e * e - std::log(0.1) - 0.5 * std::log(2.0 * M_PI);
  }
  const std::vector<Dataset> all{data};
  RecordingsLikelihood likelihood(model, all);
  const Likelihood exact = *likelihood.evaluate(model.parameters, true);
  EXPECT_NEAR(exact.value, expected, 1e-6 * std::abs(expected));
  expect_slopes_of_differences(model, all, 1e-5);
}

TEST(Conditions, InfinityIsSaidByTheModelFile) {
  expect_refused(fading("equals: x", ", infinity: steady-state", "-k*x + sin(t)/1000"), "time");
  expect_refused(fading("equals: x + t/1000", ", infinity: steady-state"), "at infinity");
  std::string noisy = fading("equals: x", ", infinity: steady-state");
  noisy.replace(noisy.find("noise: {"), 8, "noise: {process: {kind: density, sd: {x: 0.1}}, ");
  expect_refused(noisy, "noise");
}

// What is in a tank is poured away at a row: x+ = x - x.
TEST(Conditions, DosesMayDependOnTheState) {
  std::string text = fading("equals: x", "", "k*(1 - x)");
  text.replace(text.find("inputs:"), 7, "doses: {x: \"-share*x*u\"}\ninputs:");
  text.replace(text.find("  s: {"), 6, "  share: {value: 0.8, min: 0.1, max: 2}\n  s: {");
  const Model model = parse_model_file(text, "a.yaml");
  const VectorXd time = VectorXd::LinSpaced(9, 0.0, 4.0);
  MatrixXd u = MatrixXd::Zero(1, 9), y(1, 9);
  u(0, 3) = 1.0;
  u(0, 6) = 0.5;
  double x = 3.0;
  Random random(2);
  double expected = 0.0;
  for (Index k = 0; k < 9; ++k) {
    y(0, k) = x + 0.05 * random.normal();
    const double e = (y(0, k) - x) / 0.1;
    expected += -0.5 * e * e - std::log(0.1) - 0.5 * std::log(2.0 * M_PI);
    x -= 0.8 * x * u(0, k);
    x = 1.0 + (x - 1.0) * std::exp(-0.7 * 0.5);
  }
  const std::vector<Dataset> all{recording(model, y, SampleTimes(time), u)};
  RecordingsLikelihood likelihood(model, all);
  const Likelihood exact = *likelihood.evaluate(model.parameters, true);
  EXPECT_NEAR(exact.value, expected, 1e-6);
  expect_slopes_of_differences(model, all, 2e-5);
}

TEST(Conditions, ScaleSaysByWhatASearchMoves) {
  const auto scale_of = [](const std::string& word) {
    std::string text = fading("equals: x");
    text.replace(text.find("max: 10}"), 8, "max: 10, scale: " + word + "}");
    return parse_model_file(text, "a.yaml").parameters[0];
  };
  EXPECT_TRUE(moves_by_logarithm(scale_of("log")));
  EXPECT_FALSE(moves_by_logarithm(scale_of("linear")));
  EXPECT_TRUE(moves_by_logarithm(parse_model_file(fading("equals: x"), "a.yaml").parameters[0]));
}

}  // namespace
}  // namespace identikal
