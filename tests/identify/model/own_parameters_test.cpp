// Parameters with values of their own in each recording, against models of one recording each whose
// numbers stand in the file, and finite differences.
#include "identify/model/own_parameters.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct CoolingForm {
  const char* name;
  std::string text;  // with TAU, START, AMBIENT, SD for what differs
};

std::string put_in(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at)) {
    text.replace(at, what.size(), by);
  }
  return text;
}

// Cooling: nonlinear (radiation), linear without changes, and linear by matrices.
const std::vector<CoolingForm>& cooling_forms() {
  static const std::vector<CoolingForm> all = {{"formulas", R"(identikal: 1
time: {kind: continuous, step: 1 s}
parameters:
PARAMETERS
  slow: {value: 9, min: 1}
states: [T]
dynamics: {T: -(T - ambient)*(1 + 0.01*(T - ambient))/tau}
outputs: {y: {column: y, equals: T}}
noise: {process: {kind: density, sd: {T: 0.05}}, measurement: {sd: {y: s}}}
initial: {mean: {T: T0}, sd: {T: 0.3}}
)"},
                                               {"linear", R"(identikal: 1
time: {kind: continuous, step: 1 s}
parameters:
PARAMETERS
  slow: {value: 9, min: 1}
states: [T]
inputs: {u: {column: u}}
dynamics: {T: -(T - ambient*u)/tau}
outputs: {y: {column: y, equals: T}}
noise: {process: {kind: density, sd: {T: 0.05}}, measurement: {sd: {y: s}}}
initial: {mean: {T: T0}, sd: {T: 0.3}}
)"},
                                               {"matrices", R"(identikal: 1
time: {step: 1 s}
parameters:
PARAMETERS
  slow: {value: 9, min: 1}
inputs: [{name: u, column: u}]
A: [[1 - 1/tau]]
B: [[ambient/tau]]
C: [[1]]
Q: [[0.0025]]
R: [[s^2]]
initial: {mean: [T0], sd: [0.3]}
outputs: [{name: y, column: y}]
)"}};
  return all;
}

constexpr const char* kOwnUnknowns = R"(  tau: {value: 5, min: 0.5}
  T0: {value: 20, per: recording}
  ambient: {value: 1}
  s: {value: 0.2, min: 0.01, per: sensor})";
constexpr const char* kOwnTable = R"(recordings:
  warm: {ambient: 3, sensor: new}
  cold: {ambient: -2, sensor: old, tau: slow}
  third: {sensor: old}
)";

Model joint_file(const CoolingForm& form) {
  return parse_model_file(put_in(form.text, "PARAMETERS", kOwnUnknowns) + kOwnTable, "joint.yaml");
}

// One recording's numbers, in the file.
Model single_file(const CoolingForm& form, double tau, double T0, double ambient, double s) {
  const std::string numbers = "  tau: " + std::to_string(tau) + "\n  T0: " + std::to_string(T0) +
                              "\n  ambient: " + std::to_string(ambient) +
                              "\n  s: " + std::to_string(s);
  return parse_model_file(
      put_in(put_in(form.text, "PARAMETERS", numbers), "  slow: {value: 9, min: 1}\n", ""),
      "single.yaml");
}

std::vector<Dataset> three_recordings(const CoolingForm& form, int length) {
  Random random(7);
  const bool input = form.text.find("inputs") != std::string::npos;
  std::vector<Dataset> out;
  for (const char* name : {"warm.csv", "cold.csv", "third.csv"}) {
    VectorXd y(length);
    for (Index k = 0; k < length; ++k) {
      y[k] = 20.0 * std::exp(-0.2 * static_cast<double>(k)) + 0.3 * random.normal();
    }
    const Model model = single_file(form, 5.0, 20.0, 1.0, 0.2);
    const MatrixXd u = MatrixXd::Ones(1, length);
    out.push_back(input ? recording(model, Samples(y), 1.0, Samples(u))
                        : recording(model, Samples(y), 1.0));
    out.back().name = name;
    length += 5;
  }
  return out;
}

class OwnParameters : public testing::TestWithParam<std::size_t> {
 protected:
  const CoolingForm& cooling_form() const { return cooling_forms()[GetParam()]; }
};

TEST_P(OwnParameters, AreAddedOnceAndKnownWhereTheTableHasNumbers) {
  std::vector<Dataset> recordings = three_recordings(cooling_form(), 20);
  const Model joint = for_recordings(joint_file(cooling_form()), recordings);
  std::vector<std::string> names;
  for (const std::string& name : reported_entries(joint.parameters).names) names.push_back(name);
  EXPECT_EQ(names,
            (std::vector<std::string>{"tau", "ambient", "slow", "T0_warm", "ambient_warm", "s_new",
                                      "T0_cold", "ambient_cold", "s_old", "T0_third"}));
  EXPECT_EQ(free_entries(joint.parameters).size(), 8);
}

TEST_P(OwnParameters, LikelihoodIsTheSumOfThatOfEachRecordingWithItsNumbers) {
  std::vector<Dataset> recordings = three_recordings(cooling_form(), 20);
  const std::vector<Dataset> alone = recordings;
  Model joint = for_recordings(joint_file(cooling_form()), recordings);
  // tau, ambient, slow, T0_warm, s_new, T0_cold, s_old, T0_third
  joint.parameters =
      with_entries(joint.parameters, VectorXd{{4.5, 0.7, 8.0, 20.5, 0.25, 19.5, 0.4, 21.0}});
  RecordingsLikelihood likelihood(joint, recordings);
  const Likelihood* all = likelihood.evaluate(joint.parameters, false);
  ASSERT_NE(all, nullptr);
  double sum = 0.0;
  const double numbers[3][4] = {
      {4.5, 20.5, 3.0, 0.25}, {8.0, 19.5, -2.0, 0.4}, {4.5, 21.0, 0.7, 0.4}};
  for (std::size_t i = 0; i < 3; ++i) {
    const Model single =
        single_file(cooling_form(), numbers[i][0], numbers[i][1], numbers[i][2], numbers[i][3]);
    const FilterResult filter = run_filter(single, single.parameters, alone[i]);
    const FilterResult in_joint = run_filter(joint, joint.parameters, recordings[i]);
    sum += filter.log_likelihood;
    EXPECT_NEAR(in_joint.log_likelihood, filter.log_likelihood,
                1e-9 * std::abs(filter.log_likelihood));
  }
  EXPECT_NEAR(all->value, sum, 1e-9 * std::abs(sum));
}

TEST_P(OwnParameters, GradientIsThatOfDifferences) {
  std::vector<Dataset> recordings = three_recordings(cooling_form(), 20);
  const Model joint = for_recordings(joint_file(cooling_form()), recordings);
  RecordingsLikelihood likelihood(joint, recordings);
  const Likelihood* at = likelihood.evaluate(joint.parameters, true);
  ASSERT_NE(at, nullptr);
  const VectorXd gradient = at->gradient, x = free_entries(joint.parameters);
  const MatrixXd information = at->information;
  for (Index i = 0; i < x.size(); ++i) {
    const double step = 1e-5 * std::max(1.0, std::abs(x[i]));
    VectorXd moved = x;
    moved[i] += step;
    const double above = likelihood.evaluate(with_entries(joint.parameters, moved), false)->value;
    moved[i] -= 2.0 * step;
    const double below = likelihood.evaluate(with_entries(joint.parameters, moved), false)->value;
    EXPECT_NEAR(gradient[i], (above - below) / (2.0 * step),
                1e-5 * std::max(1.0, std::abs(gradient[i])))
        << i;
  }
  EXPECT_TRUE(information.isApprox(information.transpose(), 1e-12));
  EXPECT_EQ(information(3, 5), 0.0);  // T0 of two recordings
  EXPECT_GT(std::abs(information(0, 3)), 0.0);
}

INSTANTIATE_TEST_SUITE_P(Forms, OwnParameters, testing::Values(0, 1, 2),
                         [](const auto& p) { return cooling_forms()[p.param].name; });

constexpr const char* kEachAlone = R"(identikal: 1
time: {kind: continuous, step: 1 s}
parameters:
  tau: {value: 4, min: 0.5, per: recording}
  T0: {value: 18, per: recording}
  s: {value: 0.3, min: 0.01, per: recording}
states: [T]
dynamics: {T: -T*(1 + 0.01*T)/tau}
outputs: {y: {column: y, equals: T}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {T: T0}}
)";

// What shares nothing is what each recording says by itself: values, errors, maximum.
TEST(OwnParametersAlone, EstimatesAreThoseOfSingleFits) {
  std::vector<Dataset> recordings;
  Random random(3);
  const Model file = parse_model_file(kEachAlone, "own.yaml");
  Model single = parse_model_file(put_in(kEachAlone, ", per: recording", ""), "single.yaml");
  for (int i = 0; i < 3; ++i) {
    VectorXd y(40);
    for (Index k = 0; k < 40; ++k) {
      y[k] = (18.0 + i) * std::exp(-0.15 * static_cast<double>(k)) + 0.2 * random.normal();
    }
    recordings.push_back(recording(single, Samples(y), 1.0));
    recordings.back().name = "run " + std::to_string(i) + ".csv";
  }
  const std::vector<Dataset> alone = recordings;
  const Model joint = for_recordings(file, recordings);
  const NoiseEstimate all = tune_ml(joint, recordings);
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const NoiseEstimate one = tune_ml(single, {alone[i]});
    sum += one.objective.log_likelihood;
    for (std::size_t p = 0; p < 3; ++p) {
      const EstimatedParameter& here = all.parameters[3 * i + p];
      EXPECT_EQ(here.name, one.parameters[p].name + "_run_" + std::to_string(i));
      EXPECT_NEAR(here.value, one.parameters[p].value, 1e-4 * std::abs(here.value));
      EXPECT_NEAR(here.se, one.parameters[p].se, 1e-3 * here.se);
    }
  }
  EXPECT_NEAR(all.objective.log_likelihood, sum, 1e-4);
}

TEST(OwnParametersAlone, NamesThatDifferInSignsAloneAreRefused) {
  const Model file = parse_model_file(kEachAlone, "own.yaml");
  const Model single = parse_model_file(put_in(kEachAlone, ", per: recording", ""), "single.yaml");
  std::vector<Dataset> two(2, recording(single, Samples(VectorXd::Ones(9)), 1.0));
  two[0].name = "run 1.csv";
  two[1].name = "run-1.csv";
  EXPECT_THROW(for_recordings(file, two), InputError);
}

TEST(OwnParametersAlone, ValuesFoundBeforeServeFurtherRecordings) {
  Model file = parse_model_file(kEachAlone, "own.yaml");
  file.recordings.found = {{"tau_a", 6.0}, {"T0_a", 17.0}, {"s_a", 0.4}};
  const Model single = parse_model_file(put_in(kEachAlone, ", per: recording", ""), "single.yaml");
  std::vector<Dataset> one{recording(single, Samples(VectorXd::Ones(9)), 1.0)};
  one[0].name = "a.csv";
  const Model joint = for_recordings(file, one);
  EXPECT_EQ(values_in(joint.parameters, one[0])[0].scalar(), 6.0);
  one[0].name = "b.csv";
  EXPECT_THROW(for_recordings(file, one), InputError);
}

}  // namespace
}  // namespace identikal
