// Doses and steady states as a model file says them.

#include "identify/model/starting_state.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::StartsWith;

// Of a gene: its message m follows the signal, its protein a the message.
std::string gene(const std::string& initial, const std::string& noise = "") {
  return R"(identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters:
  k: {value: 0.7, min: 0}
  d: {value: 0.3, min: 0}
  s: {value: 0.1, min: 0}
states: [m, a]
inputs: {signal: {column: signal}, amount: {column: amount}}
doses: {a: d*amount}
dynamics: {m: k*signal/(1 + signal) - m, a: m^2 - d*a}
outputs: {light: {column: light, equals: a}}
noise: {)" +
         noise + R"(measurement: {sd: {light: s}}}
initial: )" +
         initial + "\n";
}

Dataset seen_gene(const Model& model) {
  Random random(3);
  MatrixXd y(1, 30), u(2, 30);
  VectorXd time(30);
  for (Index t = 0; t < 30; ++t) {
    time[t] = 0.7 * static_cast<double>(t);
    y(0, t) = 0.8 + 0.05 * static_cast<double>(t) + 0.05 * random.normal();
    u.col(t) << (t < 10 ? 2.0 : 4.0), (t == 12 ? 1.5 : std::nan(""));
  }
  return recording(model, y, SampleTimes(time), u);
}

Model parsed_gene(const std::string& text) { return parse_model_file(text, "gene.yaml"); }

double gene_value(const Model& model, const Dataset& data, const VectorXd& at) {
  const std::vector<Dataset> all{data};
  RecordingsLikelihood likelihood(model, all);
  return likelihood.evaluate(with_coordinates(model.parameters, at), false)->value;
}

TEST(StartingState, IsWhereTheMotionRestsBeforeTheRecording) {
  // At signal 2: m = k 2/3, a = m^2/d.
  const double m = 0.7 * 2.0 / 3.0, a = m * m / 0.3;
  const Model resting = parsed_gene(gene("steady-state"));
  const Model given =
      parsed_gene(gene("{mean: {m: " + std::to_string(m) + ", a: " + std::to_string(a) + "}}"));
  const VectorXd at = coordinates(resting.parameters);
  EXPECT_NEAR(gene_value(resting, seen_gene(resting), at), gene_value(given, seen_gene(given), at),
              1e-3);
  // Without the signal nothing is there.
  const Model empty = parsed_gene(gene("{kind: steady-state, inputs: {signal: 0}}"));
  const Model zero = parsed_gene(gene("{mean: {m: 0, a: 0}}"));
  EXPECT_NEAR(gene_value(empty, seen_gene(empty), at), gene_value(zero, seen_gene(zero), at), 1e-6);
}

TEST(StartingState, HasTheDerivativesOfDifferencesWithAndWithoutNoise) {
  for (const std::string& noise :
       {std::string(), std::string("process: {kind: density, sd: {m: 0.05, a: 0.02}}, ")}) {
    for (const std::string& initial :
         {std::string("steady-state"), std::string("{kind: steady-state, sd: {m: 0.1, a: 0.2}}")}) {
      const Model model = parsed_gene(gene(initial, noise));
      const std::vector<Dataset> all{seen_gene(model)};
      RecordingsLikelihood likelihood(model, all);
      const Likelihood exact = *likelihood.evaluate(model.parameters, true);
      ASSERT_EQ(exact.status, FilterStatus::ok);
      const VectorXd at = coordinates(model.parameters);
      for (Index i = 0; i < at.size(); ++i) {
        const double h = 1e-5;
        VectorXd up = at, down = at;
        up[i] += h;
        down[i] -= h;
        const double difference =
            (likelihood.evaluate(with_coordinates(model.parameters, up), false)->value -
             likelihood.evaluate(with_coordinates(model.parameters, down), false)->value) /
            (2.0 * h);
        EXPECT_NEAR(exact.gradient[i], difference, 1e-5 * (1.0 + std::abs(difference)))
            << i << noise;
      }
    }
  }
}

TEST(StartingState, SmootherFilterAndSimulationBeginThere) {
  const Model model = parsed_gene(gene("steady-state"));
  const Dataset data = seen_gene(model);
  const double m = 0.7 * 2.0 / 3.0, a = m * m / 0.3;
  const FilterResult filter = run_filter(model, model.parameters, data);
  EXPECT_NEAR(filter.x_pred(1, 0), a, 1e-7);
  const SmootherResult smoothed = run_smoother(model, model.parameters, data, std::nullopt);
  EXPECT_NEAR(smoothed.x(1, 0), a, 1e-7);
  Random random(1);
  EXPECT_NEAR(simulate_nonlinear_outputs(model, data, random).x(1, 0), a, 1e-7);
  // Nothing moves until the signal does.
  EXPECT_NEAR(filter.x_pred(1, 9), a, 1e-7);
}

TEST(StartingState, WhereThereIsNoneTheRecordingIsNamed) {
  std::string text = gene("{kind: steady-state, mean: {m: 1, a: 1}}");
  text.replace(text.find("m^2 - d*a"), 9, "m^2 + d*a");
  const Model model = parsed_gene(text);
  const Dataset data = seen_gene(model);
  EXPECT_FALSE(starting_state(model, data).found);
  try {
    refuse_filter(model, {data}, FilterStatus::not_finite);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                StartsWith("recording: before the recording the model comes to no steady state"));
  }
}

std::string gene_refusal(const std::string& text) {
  try {
    parsed_gene(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(StartingState, AnEmptyCellIsNoDoseUnlessTheInputStandsElsewhereToo) {
  std::string text = gene("steady-state");
  EXPECT_TRUE(parsed_gene(text).inputs[1].empty_is_zero);
  EXPECT_FALSE(parsed_gene(text).inputs[0].empty_is_zero);
  text.replace(text.find("equals: a"), 9, "equals: a + amount");
  EXPECT_FALSE(parsed_gene(text).inputs[1].empty_is_zero);
}

TEST(StartingState, MistakesAreShownWhereTheyStand) {
  EXPECT_THAT(gene_refusal(gene("{kind: steady-state, inputs: {sound: 0}}")),
              StartsWith("gene.yaml:13:40: unknown key 'sound' in inputs"));
  EXPECT_THAT(gene_refusal(gene("{kind: steady-state, input: {signal: 0}}")),
              StartsWith("gene.yaml:13:31: unknown key 'input' in initial; expected one of kind, "
                         "inputs, mean, sd, covariance"));
  EXPECT_THAT(gene_refusal(gene("{kind: steady-state, mean: {m: 0}}")),
              StartsWith("gene.yaml:13:37: mean of 'a' is missing"));
  std::string text = gene("steady-state");
  text.replace(text.find("- m, a:"), 3, "- sin(t)*m");
  EXPECT_THAT(gene_refusal(text), StartsWith("gene.yaml:10:"));
  EXPECT_THAT(gene_refusal(text),
              ::testing::HasSubstr("a steady state of dynamics that move with the time"));
  text = gene("steady-state", "process: {kind: density, sd: {m: 0.05}}, ");
  text.replace(text.find("a: d*amount"), 11, "a: m*amount");
  EXPECT_THAT(gene_refusal(text),
              StartsWith("gene.yaml:12:18: noise that moves states beside a dose that holds a "
                         "state; expected states that follow from their start alone"));
}

// By states or by moments, an initial value is the same formula of parameters.
TEST(StartingState, OfEachStateMayBeAFormula) {
  const Model by_state = parsed_gene(gene("{m: {mean: 2*k, sd: 0.3}, a: d}"));
  const Model by_moments = parsed_gene(gene("{mean: {m: 2*k, a: d}, sd: {m: 0.3}}"));
  const Dataset data = seen_gene(by_moments);
  const VectorXd at = VectorXd{{0.6, 0.2, 0.15}};
  EXPECT_EQ(gene_value(by_state, data, at), gene_value(by_moments, data, at));
  EXPECT_THAT(gene_refusal(gene("{m: 1, a: difuse}")),
              ::testing::HasSubstr("a parameter or a formula"));
  EXPECT_THAT(gene_refusal(gene("{m: diffuse, a: d}")),
              ::testing::HasSubstr("of every state a mean"));
}

}  // namespace
}  // namespace identikal
