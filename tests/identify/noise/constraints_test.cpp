// Fits under constraints between parameters, against models in which one parameter is put in by hand.
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/builder.h"
#include "identify/model/model_file.h"
#include "identify/noise/als.h"
#include "identify/noise/bayes.h"
#include "identify/noise/ml.h"
#include "identify/optimality/bound.h"
#include "identify/vehicle/fit.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

std::string driven(const std::string& A, const std::string& B, const std::string& parameters,
                   const std::string& more = "") {
  return R"(identikal: 1
time: {step: 1 s}
parameters: {)" +
         parameters + R"(q: {value: 1, min: 0}}
A: [[)" + A +
         R"(]]
B: [[)" + B +
         R"(]]
C: [[1]]
Q: [[q]]
R: [[0.04]]
inputs: {u: {column: u}}
outputs: {y: {column: y}}
)" + more;
}

// x+ = 0.5 x + 0.35 u + w
std::vector<Dataset> driven_recording(const Model& model) {
  Random random(3);
  std::string rows = "u,y\n";
  double x = 0.0;
  for (int k = 0; k < 2000; ++k) {
    const double u = random.normal();
    rows += std::to_string(u) + "," + std::to_string(x + 0.2 * random.normal()) + "\n";
    x = 0.5 * x + 0.35 * u + 0.5 * random.normal();
  }
  return {make_dataset(parse_csv(rows, "driven.csv"), model.time, model.inputs, model.outputs)};
}

const EstimatedParameter& parameter_named(const Estimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return p;
  }
  throw std::out_of_range(name);
}

const Finding* constraint_finding(const Estimate& estimate) {
  for (const Finding& finding : estimate.findings) {
    if (finding.code == FindingCode::constraint) return &finding;
  }
  return nullptr;
}

NoiseEstimate fitted(const std::string& text) {
  const Model model = parse_model_file(text, "driven.yaml");
  return tune_ml(model, driven_recording(model), {});
}

TEST(ConstrainedFit, AnEqualityIsTheModelWithOneParameterPutIn) {
  const std::string free_both = "a: {value: 0.4, min: -0.99, max: 0.99}, b: {value: 0.3}, ";
  const NoiseEstimate held = fitted(driven("a", "b", free_both, "constraints: [a + b = 0.85]\n"));
  const NoiseEstimate put_in =
      fitted(driven("a", "0.85 - a", "a: {value: 0.4, min: -0.99, max: 0.99}, "));
  EXPECT_NEAR(parameter_named(held, "a").value, parameter_named(put_in, "a").value, 1e-6);
  EXPECT_NEAR(parameter_named(held, "a").value + parameter_named(held, "b").value, 0.85, 1e-8);
  EXPECT_NEAR(parameter_named(held, "a").se, parameter_named(put_in, "a").se,
              1e-4 * parameter_named(put_in, "a").se);
  EXPECT_NEAR(parameter_named(held, "b").se, parameter_named(put_in, "a").se,
              1e-4 * parameter_named(put_in, "a").se);
  EXPECT_NEAR(held.objective.log_likelihood, put_in.objective.log_likelihood, 1e-6);
  EXPECT_NEAR(held.objective.aic, put_in.objective.aic, 1e-5);
  EXPECT_EQ(constraint_finding(held), nullptr);
  EXPECT_EQ(held.status, put_in.status);
}

TEST(ConstrainedFit, TheDataSpeakAgainstOneThatIsWrong) {
  const std::string parameters = "a: {value: 0.4, min: -0.99, max: 0.99}, b: {value: 0.3}, ";
  const NoiseEstimate free = fitted(driven("a", "b", parameters));
  const NoiseEstimate wrong = fitted(driven("a", "b", parameters, "constraints: [a + b = 0.7]\n"));
  const Finding* finding = constraint_finding(wrong);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_THAT(finding->text, HasSubstr("speak against 'a + b = 0.7'"));
  EXPECT_GT(free.objective.log_likelihood, wrong.objective.log_likelihood + 3.0);
  // An inequality that holds changes nothing; one that does not ends on its border.
  const NoiseEstimate idle = fitted(driven("a", "b", parameters, "constraints: [b < a]\n"));
  EXPECT_NEAR(parameter_named(idle, "a").value, parameter_named(free, "a").value, 1e-9);
  EXPECT_EQ(parameter_named(idle, "a").se, parameter_named(free, "a").se);
  EXPECT_EQ(constraint_finding(idle), nullptr);
  const NoiseEstimate border =
      fitted(driven("a", "b", parameters, "constraints: [a + b <= 0.7]\n"));
  EXPECT_NEAR(parameter_named(border, "a").value, parameter_named(wrong, "a").value, 1e-6);
  EXPECT_NEAR(parameter_named(border, "a").value + parameter_named(border, "b").value, 0.7, 1e-8);
  ASSERT_NE(constraint_finding(border), nullptr);
}

TEST(ConstrainedFit, TheStartDecidesNothing) {
  const std::string more = "constraints: [\"a*b = 0.2\", b < a]\n";
  const NoiseEstimate one =
      fitted(driven("a", "b", "a: {value: 0.4, min: -0.99, max: 0.99}, b: {value: 0.3}, ", more));
  const NoiseEstimate other =
      fitted(driven("a", "b", "a: {value: 0.9, min: -0.99, max: 0.99}, b: {value: 1.5}, ", more));
  EXPECT_NEAR(parameter_named(one, "a").value, parameter_named(other, "a").value, 1e-6);
  EXPECT_NEAR(parameter_named(one, "a").value * parameter_named(one, "b").value, 0.2, 1e-8);
}

std::string constraint_refusal(const std::string& constraint) {
  const std::string parameters = "a: {value: 0.4, min: -0.99, max: 0.99}, b: {value: 0.3}, k: 2, ";
  try {
    parse_model_file(driven("a*k/2", "b", parameters, "constraints: [" + constraint + "]\n"),
                     "m.yaml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ConstrainedFit, AMistakeHasItsPlace) {
  EXPECT_EQ(constraint_refusal("a < b"), "");
  EXPECT_THAT(constraint_refusal("\"a + z = 0.8\""), HasSubstr("m.yaml:11:20: unknown name 'z'"));
  EXPECT_THAT(constraint_refusal("\"a\""),
              HasSubstr("m.yaml:11:15: the constraint 'a'; expected two sides"));
  EXPECT_THAT(constraint_refusal("\"a < b < q\""), HasSubstr("two sides with one of"));
  EXPECT_THAT(constraint_refusal("\"a != b\""), HasSubstr("two sides with one of"));
  EXPECT_THAT(constraint_refusal("\"a < 0.4\""),
              HasSubstr("one parameter alone that is estimated"));
  EXPECT_THAT(constraint_refusal("\"k < 0.4\""), HasSubstr("nothing that is estimated"));
  EXPECT_THAT(constraint_refusal("\"a < \""), HasSubstr("the formula ends"));
}

TEST(ConstrainedFit, WhatHasNoPlaceForThemSaysSo) {
  const std::string text = R"(identikal: 1
time: {step: 1 s}
parameters: {q1: {value: 1, min: 0}, q2: {value: 1, min: 0}, r: {value: 1, min: 0}}
constraints: [q1 = 2*q2]
A: [[0.5, 0], [0, 0.9]]
C: [[1, 1]]
Q: [[q1, 0], [0, q2]]
R: [[r]]
outputs: {y: {column: y}}
)";
  const Model two = parse_model_file(text, "two.yaml");
  const Dataset recording =
      make_dataset(parse_csv("y\n1\n2\n0\n1\n3\n1\n2\n0\n1\n", "y.csv"), two.time, {}, two.outputs);
  EXPECT_THROW(tune_als(two, {recording}, {}), InputError);
  EXPECT_THROW(tune_bayes(two, {recording}, {}), InputError);
  EXPECT_THROW(bound_of(two, {.samples = 100}, nullptr), InputError);
  EXPECT_EQ(two.constraints.size(), 1);
}

Model constrained_car(const std::string& more) {
  return parse_model_file(R"(
identikal: 1
model: single-track
time: {column: t, unit: s}
parameters:
  m: 1446 kg
  a: {value: 1.1 m, min: 0.5, max: 2}
  b: {value: 1.4 m, min: 0.5, max: 2}
  steering_ratio: 21
  Iz: {value: 2000 kg m^2, min: 500, max: 9000}
  Cf: {value: 80 kN/rad, min: 10, max: 400}
  Cr: {value: 80 kN/rad, min: 10, max: 400}
inputs: {steering_wheel_angle: {unit: rad}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, vy: {unit: m/s}}
)" + more,
                          "car.yaml");
}

TEST(ConstrainedFit, AVehiclesAxlesKeepItsWheelbase) {
  const Dataset clean = record(
      {}, uniform_time(30.0, 100.0), {"r", "vy"},
      [](double t) { return 0.5 * std::sin((1.0 + 0.5 * std::sin(0.1 * t)) * 2.0 * t); },
      [](double t) { return 20.0 + 4.0 * std::sin(0.05 * t); });
  const std::vector<Dataset> recording{with_noise(clean, {0.003, 0.02}, 11)};
  const VehicleEstimate held =
      fit_vehicle(constrained_car("constraints: [a + b = 2512 mm]\n"), recording, {});
  EXPECT_NEAR(parameter_named(held, "a").value + parameter_named(held, "b").value, 2.512, 1e-7);
  EXPECT_NEAR(parameter_named(held, "a").value, 0.987, 4.0 * parameter_named(held, "a").se);
  EXPECT_NEAR(parameter_named(held, "a").se, parameter_named(held, "b").se,
              1e-4 * parameter_named(held, "a").se);
  const VehicleEstimate border =
      fit_vehicle(constrained_car("constraints: [a + b = 2.512 m, Cr < 0.9*Cf]\n"), recording, {});
  EXPECT_NEAR(0.9 * parameter_named(border, "Cf").value, parameter_named(border, "Cr").value,
              1e-5 * parameter_named(border, "Cf").value);
  ASSERT_NE(constraint_finding(border), nullptr);
  EXPECT_LT(border.objective.log_likelihood, held.objective.log_likelihood);
  VehicleFitOptions whole_path;
  whole_path.method = VehicleFitOptions::Method::trajectory;
  EXPECT_THROW(
      fit_vehicle(constrained_car("constraints: [a + b = 2.512 m]\n"), recording, whole_path),
      InputError);
  EXPECT_THROW(constrained_car("constraints: [a + b = 2512 kg]\n"), InputError);
  EXPECT_THROW(constrained_car("constraints: [Cf < a]\n"), InputError);
}

TEST(ConstrainedFit, ProgramsStateThemToo) {
  const Model model = linear_model()
                          .A({{"a"}})
                          .B({{"b"}})
                          .C({{1}})
                          .process_noise({{"q"}})
                          .measurement_noise({{0.04}})
                          .parameter("a", 0.4, {.min = -0.99, .max = 0.99})
                          .parameter("b", 0.3)
                          .parameter("q", 1.0, {.min = 0.0})
                          .inputs({"u"})
                          .outputs({"y"})
                          .constraint("a + b = 0.85")
                          .constraint("b < a")
                          .step(1.0);
  EXPECT_EQ(model.constraints.size(), 2);
  const NoiseEstimate held = tune_ml(model, driven_recording(model), {});
  EXPECT_NEAR(parameter_named(held, "a").value + parameter_named(held, "b").value, 0.85, 1e-8);
}

}  // namespace
}  // namespace identikal
