// Predictions several steps ahead: errors and slopes against a filter run by hand and differences, and
// what the search makes of a model that is wrong one step ahead.
#include "identify/noise/steps_ahead.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/predicted_motion.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const char* const kDrivenLevel = R"(identikal: 1
time: {step: 1 s}
parameters:
  a: {value: 0.7, min: -0.99, max: 0.999}
  b: {value: 0.5}
  q: {value: 0.3, min: 0}
A: [[a]]
B: [[b]]
C: [[1]]
Q: [[q]]
R: [[0.1]]
inputs: {u: {column: u}}
outputs: {y: {column: y}}
initial: {mean: [0], sd: [1]}
)";

const char* const kDampedMotion = R"(identikal: 1
time: {kind: continuous, step: 0.1 s, inputs: foh}
parameters:
  k: {value: 4, min: 0.1}
  d: {value: 0.4, min: 0}
  s: {value: 0.05, min: 0}
states: [x, v]
inputs: {u: {column: u}}
dynamics: {x: v, v: -k*sin(x) - d*v + u}
outputs: {y: {column: y, equals: x}}
noise: {process: {kind: density, sd: {v: s}}, measurement: {sd: {y: 0.02}}}
initial: {mean: {x: 0, v: 0}, sd: {x: 0.1, v: 0.1}}
)";

// A first-order system with an input, and a slow disturbance that the model does not have.
std::vector<Dataset> driven_level(const Model& model, Index N, double slow, double step = 1.0) {
  Random random(8);
  VectorXd u(N), y(N);
  double x = 0.0, lasting = 0.0, drive = 0.0;
  for (Index t = 0; t < N; ++t) {
    drive = 0.95 * drive + random.normal();
    u[t] = drive;
    y[t] = x + lasting + 0.3 * random.normal();
    x = 0.8 * x + 0.4 * u[t] + 0.2 * random.normal();
    lasting = 0.98 * lasting + slow * random.normal();
  }
  return {recording(model, y, step, u)};
}

TEST(StepsAhead, PredictionsAreThoseOfTheFilterMovedOn) {
  const Model model = parse_model_file(kDrivenLevel, "level.yaml");
  const Dataset data = driven_level(model, 60, 0.0)[0];
  const FilterResult filter = run_filter(model, model.parameters, data);
  PredictedMotion motion(model, data);
  motion.set(model.parameters);
  VectorXd x = filter.x_filt.col(20), y;
  MatrixXd dx = MatrixXd::Zero(1, 3), dy;
  double by_hand = x[0];
  for (Index t = 20; t < 25; ++t) {
    motion.move(t, x, dx);
    by_hand = 0.7 * by_hand + 0.5 * data.u(0, t);
  }
  motion.observe(25, x, dx, y, dy);
  EXPECT_NEAR(y[0], by_hand, 1e-12);
}

TEST(StepsAhead, SlopesOfTheMotionAreThoseOfDifferences) {
  for (const char* text : {kDrivenLevel, kDampedMotion}) {
    Model model = parse_model_file(text, "motion.yaml");
    const Dataset data = driven_level(model, 60, 0.0, model.time.step)[0];
    const Index n = is_linear(model) ? 1 : 2;
    const auto seen = [&](const VectorXd& p, MatrixXd* slopes) {
      PredictedMotion motion(model, data);
      motion.set(with_coordinates(model.parameters, p));
      VectorXd x = VectorXd::Constant(n, 0.3), y;
      MatrixXd dx = MatrixXd::Zero(n, p.size()), dy;
      for (Index t = 10; t < 20; ++t) motion.move(t, x, dx);
      motion.observe(20, x, dx, y, dy);
      if (slopes != nullptr) *slopes = dy;
      return y[0];
    };
    const VectorXd p = coordinates(model.parameters);
    MatrixXd slopes;
    seen(p, &slopes);
    for (Index i = 0; i < p.size(); ++i) {
      VectorXd up = p, down = p;
      up[i] += 1e-6;
      down[i] -= 1e-6;
      EXPECT_NEAR(slopes(0, i), (seen(up, nullptr) - seen(down, nullptr)) / 2e-6, 1e-6) << text;
    }
  }
}

double named_value(const NoiseEstimate& estimate, const std::string& name) {
  for (const auto& p : estimate.parameters) {
    if (p.name == name) return p.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double named_se(const NoiseEstimate& estimate, const std::string& name) {
  for (const auto& p : estimate.parameters) {
    if (p.name == name) return p.se;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

// Of predictions and, behind it, of the same by the likelihood's values.
double rmse_ahead(const NoiseEstimate& estimate, std::size_t which) {
  return estimate.derived.at(estimate.derived.size() - 2 + which).value;
}

TEST(StepsAhead, ARightModelHasTheSameValues) {
  const Model model = parse_model_file(kDrivenLevel, "level.yaml");
  const std::vector<Dataset> data = driven_level(model, 4000, 0.0);
  for (const int steps : {2, 5, 20}) {
    const NoiseEstimate far = fit_steps_ahead(model, data, steps, {});
    EXPECT_EQ(far.objective.method, std::to_string(steps) + "-step");
    EXPECT_EQ(far.status, Status::ok);
    EXPECT_NEAR(named_value(far, "a"), 0.8, 4.0 * named_se(far, "a"));
    EXPECT_NEAR(named_value(far, "b"), 0.4, 4.0 * named_se(far, "b"));
    EXPECT_LE(rmse_ahead(far, 0), rmse_ahead(far, 1) + 1e-12);
  }
}

// Where something slow is missing, one step leads to a pole that is slow, many steps to the input's.
TEST(StepsAhead, AWrongOnePredictsFurtherWithOthers) {
  const Model model = parse_model_file(kDrivenLevel, "level.yaml");
  const std::vector<Dataset> data = driven_level(model, 4000, 0.3);
  const NoiseEstimate near = tune_ml(model, data, {});
  const NoiseEstimate far = fit_steps_ahead(model, data, 20, {});
  EXPECT_GT(std::abs(named_value(near, "a") - 0.8), 0.03);
  EXPECT_LT(std::abs(named_value(far, "a") - 0.8), 0.5 * std::abs(named_value(near, "a") - 0.8));
  EXPECT_LT(rmse_ahead(far, 0), 0.99 * rmse_ahead(far, 1));
}

TEST(StepsAhead, FormulasAreFoundFromElsewhere) {
  Model model = parse_model_file(kDampedMotion, "damped.yaml");
  Random random(4);
  const Index N = 600;
  VectorXd u(N), y(N);
  double x = 0.0, v = 0.0;
  for (Index t = 0; t < N; ++t) {
    u[t] = 2.0 * std::sin(0.13 * static_cast<double>(t)) + std::sin(0.031 * static_cast<double>(t));
    y[t] = x + 0.02 * random.normal();
    const double next = 2.0 * std::sin(0.13 * static_cast<double>(t + 1)) +
                        std::sin(0.031 * static_cast<double>(t + 1));
    for (int i = 0; i < 100; ++i) {
      const double share = (i + 0.5) / 100.0, drive = (1.0 - share) * u[t] + share * next;
      v += 1e-3 * (-4.0 * std::sin(x) - 0.4 * v + drive) + 0.05 * std::sqrt(1e-3) * random.normal();
      x += 1e-3 * v;
    }
  }
  model.parameters[0].value(0, 0) = 5.0;
  model.parameters[1].value(0, 0) = 0.8;
  const NoiseEstimate far = fit_steps_ahead(model, {recording(model, y, 0.1, u)}, 10, {});
  EXPECT_NEAR(named_value(far, "k"), 4.0, 4.0 * named_se(far, "k"));
  EXPECT_NEAR(named_value(far, "d"), 0.4, 4.0 * named_se(far, "d"));
  EXPECT_LT(named_se(far, "k"), 0.1);
}

TEST(StepsAhead, RefusesWhatItCannot) {
  EXPECT_EQ(steps_in("12-step"), 12);
  for (const char* word : {"one-step", "-step", "simulation", "1.5-step", "123456789-step"}) {
    EXPECT_EQ(steps_in(word), 0) << word;
  }
  const Model model = parse_model_file(kDrivenLevel, "level.yaml");
  const std::vector<Dataset> data = driven_level(model, 30, 0.0);
  EXPECT_THROW(fit_steps_ahead(model, data, 1, {}), std::invalid_argument);
  EXPECT_THROW(fit_steps_ahead(model, data, 30, {}), InputError);
  const Model bound =
      parse_model_file(std::string(kDrivenLevel) + "constraints: [a + b = 1.2]\n", "level.yaml");
  EXPECT_THROW(fit_steps_ahead(bound, data, 3, {}), InputError);
}

}  // namespace
}  // namespace identikal
