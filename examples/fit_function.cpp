// A model as a C++ function: length and friction of a pendulum from its angle, exact derivatives
// through the extended Kalman filter. The data are made here, so that the truth is known.
#include <cmath>
#include <cstdio>
#include <utility>

#include "identify/filter/nonlinear_recordings.h"
#include "identify/noise/ml.h"
#include "lib/model/recorded_scalar.h"

namespace {

// x = [angle, rate], u = [torque/inertia], p = [length, friction, q, r].
struct Pendulum {
  template <typename T>
  void dynamics(const T* x, const T* u, const T* p, T, T* f) const {
    using std::sin;
    f[0] = x[1];
    f[1] = -9.80665 / p[0] * sin(x[0]) - p[1] * x[1] + u[0];
  }
  template <typename T>
  void outputs(const T* x, const T*, const T*, T, T* y) const {
    y[0] = x[0];
  }
};

}  // namespace

int main() {
  using namespace identikal;
  using Eigen::MatrixXd;
  Model model;
  FormulaModel pendulum;
  pendulum.equations = make_nonlinear_model(trace(Pendulum(), {2, 1, 4, 1}), Derivatives::second);
  const std::pair<const char*, double> values[] = {
      {"length", 0.8}, {"friction", 0.3}, {"q", 0.02}, {"r", 1e-4}};
  for (const auto& [name, value] : values) {
    Parameter p;
    p.name = name;
    p.value = MatrixXd::Constant(1, 1, value);
    p.min = 0.0;
    model.parameters.push_back(p);
  }
  LinearModel& noise = pendulum.noise;  // q disturbs the rate, r is the sensor's
  noise.A.constant = noise.G.constant = MatrixXd::Identity(2, 2);
  noise.Q.constant = MatrixXd::Zero(2, 2);
  noise.Q.entries = {{1, 1, 2, 1.0}};
  noise.R.constant = MatrixXd::Zero(1, 1);
  noise.R.entries = {{0, 0, 3, 1.0}};
  noise.x0.constant = Eigen::Vector2d(0.5, 0.0);
  noise.P0.constant = 0.01 * MatrixXd::Identity(2, 2);
  noise.initial = InitialState::given;
  noise.noise = ProcessNoise::density;
  model.form = std::move(pendulum);

  Dataset data;
  data.dt = 0.02;
  data.time = Eigen::VectorXd::LinSpaced(1000, 0.0, 19.98);
  data.u = (3.0 * (0.4 * 2.0 * M_PI * data.time.array()).sin()).matrix().transpose();
  data.inputs = {{"torque", ""}};
  data.outputs = {{"angle", ""}};
  Random random(1);
  data.y = simulate_nonlinear_outputs(model, data, random).y;

  model.parameters[0].value(0, 0) = 1.2;
  model.parameters[1].value(0, 0) = 0.1;
  const NoiseEstimate estimate = tune_ml(model, {data});
  for (const EstimatedParameter& p : estimate.parameters) {
    std::printf("%s = %.4g +- %.2g\n", p.name.c_str(), p.value, p.se);
  }
  return exit_code(estimate, false);
}
