// Does a program that states a model say the same as a file that does?
#include "identify/model/builder.h"

#include <cmath>
#include <functional>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/noise/ml.h"
#include "identify/vehicle/fit.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::HasSubstr;

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

void expect_equal(const Model& one, const Model& other) {
  const StateSpace a = instantiate(noise_model(one), one.parameters);
  const StateSpace b = instantiate(noise_model(other), other.parameters);
  for (const auto& [x, y] :
       {std::pair{a.A, b.A}, std::pair{a.B, b.B}, std::pair{a.C, b.C}, std::pair{a.D, b.D},
        std::pair{a.G, b.G}, std::pair{a.Q, b.Q}, std::pair{a.R, b.R}, std::pair{a.S, b.S}}) {
    EXPECT_EQ(x, y);
  }
  EXPECT_EQ(noise_model(one).initial, noise_model(other).initial);
  ASSERT_EQ(one.parameters.size(), other.parameters.size());
  for (std::size_t i = 0; i < one.parameters.size(); ++i) {
    const Parameter &p = one.parameters[i], &q = other.parameters[i];
    EXPECT_EQ(p.name, q.name);
    EXPECT_EQ(p.value, q.value);
    EXPECT_EQ(p.min, q.min);
    EXPECT_EQ(p.max, q.max);
    EXPECT_EQ(p.fixed, q.fixed);
    EXPECT_EQ(p.domain, q.domain);
  }
}

LinearModelBuilder tracker() {
  return linear_model()
      .A({{1, 0.1}, {0, 1}})
      .G({{0.005}, {0.1}})
      .C({{1, 0}})
      .process_noise(variance("q"))
      .measurement_noise(variance("r", 2.5))
      .diffuse();
}

TEST(LinearModelBuilder, SaysTheSameAsAFile) {
  expect_equal(tracker(), parse_model_file(R"(
identikal: 1
time: {step: 1}
parameters: {q: {value: 1, min: 0}, r: {value: 2.5, min: 0}}
outputs: {y: {column: y}}
A: [[1, 0.1], [0, 1]]
G: [[0.005], [0.1]]
C: [[1, 0]]
Q: [[q]]
R: [[r]]
initial: diffuse
)",
                                           "file.yaml"));
}

TEST(LinearModelBuilder, TakesFormulasAndEigenExpressions) {
  const Eigen::RowVector2d C(1.0, 0.0);
  const Model model = linear_model()
                          .parameter("tau", 2.0, {0.1, 10.0})
                          .known("k", 3.0)
                          .A({{"-1/tau", 0}, {1, "-k"}})
                          .B(MatrixXd::Identity(2, 1) * 0.5)
                          .C(2.0 * C)
                          .process_noise(variances({{"q1", 1.0}, {"q2", 0.1}}))
                          .measurement_noise(1e-5)
                          .continuous()
                          .step(0.05);
  expect_equal(model, parse_model_file(R"(
identikal: 1
time: {kind: continuous, step: 0.05}
parameters: {tau: {value: 2, min: 0.1, max: 10}, k: 3, q1: {value: 1, min: 0}, q2: {value: 0.1, min: 0}}
inputs: {u: {column: u}}
outputs: {y: {column: y}}
A: [[-1/tau, 0], [1, -k]]
B: [[0.5], [0]]
C: [[2, 0]]
noise: {process: density}
Q: [[q1, 0], [0, q2]]
R: [[1e-5]]
)",
                                       "file.yaml"));
}

TEST(LinearModelBuilder, EveryBitOfANumberArrives) {
  Random random(5);
  const MatrixXd A = 0.1 * random.normal(9).reshaped(3, 3);
  const Model model = linear_model()
                          .A(A)
                          .C(MatrixXd::Identity(1, 3))
                          .process_noise(full_covariance(MatrixXd::Identity(3, 3)))
                          .measurement_noise(1.0 / 3.0);
  EXPECT_EQ(instantiate(as_linear(model), model.parameters).A, A);
  EXPECT_EQ(model.parameters[0].domain, Domain::positive_definite);
}

TEST(LinearModelBuilder, TunesATracker) {
  Random random(3);
  VectorXd y(2000);
  double position = 0.0, speed = 0.0;
  for (double& sample : y) {
    sample = position + 0.5 * random.normal();
    const double acceleration = 0.3 * random.normal();
    position += 0.1 * speed + 0.005 * acceleration;
    speed += 0.1 * acceleration;
  }
  const Model model = tracker();
  const NoiseEstimate estimate = tune_ml(model, {recording(model, y, 0.1)});
  EXPECT_EQ(estimate.status, Status::ok);
  for (const auto& [i, truth] : {std::pair{0, 0.09}, std::pair{1, 0.25}}) {
    const EstimatedParameter& p = estimate.parameters[static_cast<std::size_t>(i)];
    EXPECT_NEAR(p.value, truth, 3.5 * p.se);
  }
  EXPECT_DOUBLE_EQ(estimate.filter->model.dt, 0.1);
}

TEST(LinearModelBuilder, MistakesAreNamed) {
  const double nan = std::nan("");
  const auto built = [](const LinearModelBuilder& builder) {
    return message_of([&] { (void)static_cast<Model>(builder); });
  };
  EXPECT_THAT(built(linear_model().C(1).process_noise(1).measurement_noise(1)),
              HasSubstr("the model has no A"));
  EXPECT_THAT(built(tracker().C({{1, 0, 0}})), HasSubstr("C is 1 x 3; expected 1 x 2"));
  EXPECT_THAT(built(tracker().process_noise({{1, 0}, {0, 1}})),
              HasSubstr("Q is 2 x 2; expected 1 x 1"));
  EXPECT_THAT(built(tracker().measurement_noise({{"s"}})), HasSubstr("'s'"));
  EXPECT_THAT(built(tracker().parameter("unused", 1.0)),
              HasSubstr("parameter 'unused' is not used anywhere"));
  EXPECT_THAT(built(tracker().S({{10}})), HasSubstr("Q, R and S"));
  EXPECT_THAT(built(tracker().G(MatrixXd::Identity(2, 2)).process_noise({{1, 2}, {0, 1}})),
              HasSubstr("Q is not symmetric"));
  EXPECT_THAT(message_of([&] { tracker().A(MatrixXd::Constant(2, 2, nan)); }),
              HasSubstr("is nan; expected a finite number"));
  EXPECT_THAT(message_of([&] { tracker().step(0.0); }), HasSubstr("expected a time above 0"));
  EXPECT_THAT(built(tracker().process_noise(variance("q", -1.0))),
              HasSubstr("expected a number above 0"));
}

TEST(FormulaModelBuilder, SaysTheSameAsAFile) {
  const Model model = formula_model()
                          .state("phi", "w")
                          .state("w", "-g/l*sin(phi) - d*w + torque/l")
                          .input("torque")
                          .output("angle", "phi")
                          .parameter("l", 0.8, {0.1, 5})
                          .parameter("d", 0.3, {0})
                          .parameter("q", 0.02, {0})
                          .parameter("r", 1e-4, {0})
                          .process_variance("w", "q")
                          .measurement_variance("angle", "r")
                          .initial("phi", 0.3, 0.1)
                          .initial("w", 0, 0.2)
                          .step(0.02);
  const Model file = parse_model_file(R"(
identikal: 1
time: {kind: continuous, step: 0.02}
parameters: {l: {value: 0.8, min: 0.1, max: 5}, d: {value: 0.3, min: 0}, q: {value: 0.02, min: 0}, r: {value: 1e-4, min: 0}}
states: [phi, w]
inputs: {torque: {column: torque}}
dynamics: {phi: w, w: -g/l*sin(phi) - d*w + torque/l}
outputs: {angle: {column: angle, equals: phi}}
noise: {process: {kind: density, variance: {w: q}}, measurement: {variance: {angle: r}}}
initial: {mean: {phi: 0.3, w: 0}, sd: {phi: 0.1, w: 0.2}}
)",
                                      "file.yaml");
  EXPECT_TRUE(is_formula_model(model));
  expect_equal(model, file);
  EXPECT_EQ(as_formulas(model).equations.rates.start, as_formulas(file).equations.rates.start);
  EXPECT_THAT(message_of([] { (void)static_cast<Model>(formula_model().state("x", "-x*")); }),
              testing::Not(HasSubstr("nothing was thrown")));
}

TEST(VehicleModelBuilder, FitsFromVectors) {
  const Model car = vehicle_model()
                        .known("m", 1446)
                        .known("a", 0.987)
                        .known("b", 1.525)
                        .known("steering_ratio", 21)
                        .parameter("Iz", 2000, {800, 6000})
                        .parameter("Cf", 8e4, {1e4, 4e5})
                        .parameter("Cr", 8e4, {1e4, 4e5})
                        .output("r", 0.01)
                        .output("vy", 0.03);
  EXPECT_TRUE(is_vehicle(car));
  const Model file =
      read_model_file(std::string(IDENTIKAL_SOURCE_DIR) + "/examples/severe_lane_change.yaml");
  const Dataset data =
      make_dataset(read_csv(std::string(IDENTIKAL_SOURCE_DIR) + "/data/severe_lane_change.csv"),
                   file.time, file.inputs, file.outputs);
  const auto column = [](const MatrixXd& M, Eigen::Index row) {
    return std::vector<double>(M.row(row).begin(), M.row(row).end());
  };
  const Dataset drive = recording(car,
                                  {{"vx", column(data.u, 1)},
                                   {"steering_wheel_angle", column(data.u, 0)},
                                   {"vy", column(data.y, 1)},
                                   {"r", column(data.y, 0)}},
                                  data.time);
  const VehicleEstimate mine = fit_vehicle(car, {drive}), theirs = fit_vehicle(file, {data});
  for (std::size_t i = 0; i < mine.parameters.size(); ++i) {
    const EstimatedParameter &p = mine.parameters[i], &q = theirs.parameters[i];
    if (p.fixed) continue;
    EXPECT_NEAR(p.value, q.value, 1e-3 * q.se) << p.name;
  }
  EXPECT_THAT(
      message_of([] { (void)static_cast<Model>(vehicle_model().known("m", 1446).output("r")); }),
      HasSubstr("parameters"));
}

}  // namespace
}  // namespace identikal
