// Inputs that are late by an unknown time: their course, derivatives by the delay against differences,
// and a delay that is found again.
#include "identify/model/late_inputs.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/model/row_selection.h"
#include "identify/noise/ml.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

std::string actuator(const std::string& noise, const std::string& time = "foh",
                     const std::string& more = "") {
  return R"(identikal: 1
time: {kind: continuous, step: 0.02 s, inputs: )" +
         time + R"(}
parameters:
  tau: {value: 0.1037 s, min: 0 s, max: 0.4 s}
  lag: {value: 0.2 s, min: 0.02, max: 2}
  s: {value: 0.02, min: 0.001}
states: {angle: rad}
inputs: {command: {column: command, unit: rad, delay: tau}}
dynamics: {angle: (command - angle - angle^3/3)/lag}
outputs: {angle: {column: angle, unit: rad}}
noise: {)" +
         noise + R"(measurement: {sd: {angle: s}}}
initial: {mean: {angle: 0}, sd: {angle: 0.3}}
)" + more;
}

double command_at(double t) {
  return 0.8 * std::sin(2.0 * t + 0.5 * std::sin(0.9 * t)) + 0.1 * std::sin(9.0 * t);
}

// The truth by steps of 0.1 ms.
std::vector<Dataset> recorded(const Model& model, double delay, double lag, double seconds = 20.0) {
  Random random(5);
  const auto N = static_cast<Index>(seconds / 0.02);
  VectorXd u(N), y(N);
  double angle = 0.0;
  for (Index k = 0; k < N; ++k) {
    u[k] = command_at(0.02 * static_cast<double>(k));
    y[k] = angle + 0.01 * random.normal();
    for (int i = 0; i < 200; ++i) {
      const double at = 0.02 * static_cast<double>(k) + 1e-4 * (i + 0.5);
      angle += 1e-4 * (command_at(at - delay) - angle - angle * angle * angle / 3.0) / lag;
    }
  }
  return {recording(model, y, 0.02, u)};
}

TEST(LateInputs, AreTheInputAndItsSlope) {
  const Model model = parse_model_file(actuator(""), "actuator.yaml");
  const FormulaModel& formulas = as_formulas(model);
  ASSERT_EQ(formulas.late.size(), 1U);
  EXPECT_EQ(formulas.equations.inputs, 2);
  const Dataset data = recorded(model, 0.1, 0.2)[0];
  // Rows in which some delay from 0 to 0.4 s reaches beyond the recording are not there.
  EXPECT_EQ(data.size(), 980);
  EXPECT_NEAR(data.time[0], 0.4, 1e-12);
  ParameterSet at = model.parameters;
  at[0].value(0, 0) = 0.1234;
  const MatrixXd u = inputs_at(formulas, at, data);
  ASSERT_EQ(u.rows(), 2);
  for (Index t = 100; t < 900; ++t) {
    const double when = data.time[t] - 0.1234;
    EXPECT_NEAR(u(0, t) - 0.1234 * u(1, t), command_at(when), 4e-3);
    EXPECT_NEAR(u(1, t), (command_at(when + 1e-6) - command_at(when - 1e-6)) / 2e-6, 0.25);
  }
}

TEST(LateInputs, DerivativesByTheDelayAreExact) {
  for (const char* noise : {"", "process: {kind: density, sd: {angle: 0.05}}, "}) {
    for (const char* path : {"foh", "zoh"}) {
      const Model model = parse_model_file(actuator(noise, path), "actuator.yaml");
      const std::vector<Dataset> data = recorded(model, 0.13, 0.25, 6.0);
      RecordingsLikelihood likelihood(model, data);
      const VectorXd x = coordinates(model.parameters);
      const Likelihood* at = likelihood.evaluate(model.parameters, true);
      ASSERT_NE(at, nullptr);
      const VectorXd gradient = at->gradient;
      for (Index i = 0; i < x.size(); ++i) {
        const double h = 1e-6;
        VectorXd up = x, down = x;
        up[i] += h;
        down[i] -= h;
        const double high =
            likelihood.evaluate(with_coordinates(model.parameters, up), false)->value;
        const double low =
            likelihood.evaluate(with_coordinates(model.parameters, down), false)->value;
        EXPECT_NEAR(gradient[i], (high - low) / (2.0 * h), 2e-5 * std::abs(gradient[i]) + 1e-3)
            << noise << path << i;
      }
    }
  }
}

TEST(LateInputs, ADelayIsFoundFromBothSides) {
  for (const FitObjective objective : {FitObjective::one_step, FitObjective::simulation}) {
    for (const double start : {0.02, 0.36}) {
      Model model = parse_model_file(actuator(""), "actuator.yaml");
      model.parameters[0].value(0, 0) = start;
      const std::vector<Dataset> data = recorded(model, 0.137, 0.25);
      NoiseMlOptions options;
      options.objective = objective;
      const NoiseEstimate found = tune_ml(model, data, options);
      const EstimatedParameter& tau = found.parameters[0];
      EXPECT_NEAR(tau.value, 0.137, 4.0 * tau.se) << start;
      EXPECT_LT(tau.se, 0.01);
      EXPECT_NEAR(found.parameters[1].value, 0.25, 4.0 * found.parameters[1].se);
      EXPECT_EQ(found.status, Status::ok) << start;
    }
  }
}

TEST(LateInputs, AGapCostsTheRowsThatReachIt) {
  const Model model = parse_model_file(actuator(""), "actuator.yaml");
  Dataset whole = recorded(model, 0.1, 0.2)[0];
  Dataset raw = whole;
  raw.late.clear();
  raw.u(0, 500) = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Dataset> parts = usable_segments(model, raw);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].size(), 480);  // from 0.4 s behind the first sample to the one before the gap
  EXPECT_NEAR(parts[1].time[0], raw.time[501] + 0.4, 1e-9);
  EXPECT_THROW(recording(model, raw.y, 0.02, raw.u), std::invalid_argument);
}

std::string delay_refusal(const std::string& text) {
  try {
    parse_model_file(text, "m.yaml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string put_in_place(std::string text, const std::string& what, const std::string& by) {
  return text.replace(text.find(what), what.size(), by);
}

TEST(LateInputs, MistakesHaveTheirPlace) {
  EXPECT_THAT(
      delay_refusal(put_in_place(actuator(""), "delay: tau", "delay: tua")),
      HasSubstr("m.yaml:8:55: delay is 'tua'; expected a time such as 0.1 s, or the name of "
                "a parameter; did you mean 'tau'?"));
  EXPECT_THAT(delay_refusal(put_in_place(actuator(""), ", min: 0 s, max: 0.4 s", "")),
              HasSubstr("'tau' may be anything"));
  EXPECT_THAT(delay_refusal(put_in_place(actuator(""), "value: 0.1037 s, min: 0 s, max: 0.4 s",
                                         "value: 0.1 m, min: 0 m, max: 0.4 m")),
              HasSubstr("expected a time"));
  EXPECT_THAT(delay_refusal(actuator("", "pchip")),
              HasSubstr("inputs: pchip beside an input with an unknown delay"));
  EXPECT_THAT(
      delay_refusal(actuator("", "foh", "reference: {angle: {column: true_angle, unit: rad}}\n")),
      HasSubstr("a reference beside"));
  EXPECT_EQ(delay_refusal(put_in_place(actuator(""), "delay: tau", "delay: 0.1 s") + "\n"),
            "m.yaml:4:3: parameter 'tau' is not used anywhere");
}

}  // namespace
}  // namespace identikal
