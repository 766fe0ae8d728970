#include "lib/nonlinear_filter.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lib/constants.h"
#include "lib/discretise.h"
#include "lib/kalman.h"
#include "lib/nonlinear_model.h"
#include "lib/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Names = std::vector<std::string>;

constexpr NonlinearMethod kMethods[] = {NonlinearMethod::extended, NonlinearMethod::iterated,
                                        NonlinearMethod::unscented};
const char* name_of(NonlinearMethod method) {
  return method == NonlinearMethod::extended   ? "extended"
         : method == NonlinearMethod::iterated ? "iterated"
                                               : "unscented";
}

enum class Time { discrete, continuous };

NonlinearModel from_formulas(const Names& states, const Names& inputs, const Names& parameters,
                             const Names& dynamics, const Names& outputs, Time time,
                             Derivatives order = Derivatives::second) {
  ModelFormulas formulas;
  formulas.states = static_cast<int>(states.size());
  formulas.inputs = static_cast<int>(inputs.size());
  formulas.parameters = static_cast<int>(parameters.size());
  formulas.continuous = time == Time::continuous;
  Names names = states;
  names.insert(names.end(), inputs.begin(), inputs.end());
  names.insert(names.end(), parameters.begin(), parameters.end());
  names.emplace_back("t");
  for (const std::string& f : dynamics) formulas.dynamics.push_back(parse_expression(f, names));
  for (const std::string& h : outputs) formulas.outputs.push_back(parse_expression(h, names));
  return make_nonlinear_model(formulas, order);
}

NonlinearModel filtered_pendulum(Derivatives order = Derivatives::second) {
  return from_formulas({"th", "w"}, {"torque"}, {"l", "d", "m"},
                       {"w", "-g/l*sin(th) - d*w + torque/m"}, {"sin(th)"}, Time::continuous,
                       order);
}

MatrixXd covariance_of_size(Random& random, Index n, double size) {
  MatrixXd L(n, n);
  for (double& entry : L.reshaped()) entry = random.normal();
  return size * (L * L.transpose() / static_cast<double>(n) + 0.2 * MatrixXd::Identity(n, n));
}

// Everything that a likelihood depends on.
struct Setting {
  NonlinearModel model;
  VectorXd p;
  FilterNoise noise;
  std::vector<FilterDirection> directions;
  InputNodes inputs;
  MatrixXd y;
  NonlinearFilterOptions options;
};

// Every parameter and one random change of each kind of noise; with `mixed` they move together.
std::vector<FilterDirection> all_directions(const NonlinearModel& model, Random& random,
                                            bool mixed = false) {
  std::vector<FilterDirection> out;
  for (Index i = 0; i < model.parameters; ++i) {
    out.push_back({i, zero_noise(model)});
    if (mixed) out.back().noise.Q = covariance_of_size(random, model.states, 0.01);
  }
  for (int kind = 0; kind < 4; ++kind) {
    FilterDirection d{-1, zero_noise(model)};
    if (kind == 0) d.noise.Q = covariance_of_size(random, model.states, 0.1);
    if (kind == 1) d.noise.R = covariance_of_size(random, model.outputs, 0.1);
    if (kind == 2) d.noise.x0 = random.normal(model.states);
    if (kind == 3) d.noise.P0 = covariance_of_size(random, model.states, 0.1);
    out.push_back(d);
  }
  return out;
}

Likelihood likelihood_of(const Setting& s, MatrixXd* products = nullptr) {
  ModelMemory memory = make_memory(s.model);
  return nonlinear_likelihood(s.model, memory, s.p, s.noise, s.directions, s.inputs, s.y, s.options,
                              products);
}

// How far apart, against the largest of b.
double relative_distance(const MatrixXd& a, const MatrixXd& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return kInfinity;
  double largest = 0.0, size = 1e-300;
  for (Index i = 0; i < a.size(); ++i) {
    if (std::isnan(a(i)) != std::isnan(b(i))) return kInfinity;
    if (std::isnan(b(i))) continue;
    largest = std::max(largest, std::abs(a(i) - b(i)));
    size = std::max(size, std::abs(b(i)));
  }
  return largest / size;
}
// --- linear models ------------------------------------------------------------------------------

struct LinearCounterpart {
  StateSpace model;
  std::vector<StateSpace> derivatives;
  MatrixXd u;
};

StateSpace counterpart_of(const LinearFormMatrices& form, const FilterNoise& noise) {
  StateSpace out;
  const Index nx = form.A.rows(), ny = form.C.rows();
  out.A = form.A;
  out.B = form.B;
  out.C = form.C;
  out.D = form.D;
  out.G = MatrixXd::Identity(nx, nx);
  out.Q = noise.Q;
  out.R = noise.R;
  out.S = MatrixXd::Zero(nx, ny);
  out.x0 = noise.x0;
  out.P0 = noise.P0;
  return out;
}

LinearCounterpart counterpart_of(const Setting& s) {
  const LinearForm form = linear_form(s.model, s.p);
  LinearCounterpart out;
  out.model = counterpart_of(form.value, s.noise);
  for (const FilterDirection& d : s.directions) {
    LinearFormMatrices by = form.value;
    if (d.parameter >= 0) {
      by = form.by_parameter[static_cast<std::size_t>(d.parameter)];
    } else {
      for (MatrixXd* M : {&by.A, &by.B, &by.C, &by.D}) M->setZero();
    }
    StateSpace derivative = counterpart_of(by, d.noise);
    derivative.G.setZero();
    out.derivatives.push_back(derivative);
  }
  const Index N = s.y.cols(), nu = s.inputs.at_sample.rows();
  out.u = MatrixXd::Ones(nu + (s.model.offset ? 1 : 0), N);
  out.u.topRows(nu) = s.inputs.at_sample;
  return out;
}

void expect_same_as_kalman_filter(Setting& s, const std::string& what) {
  ASSERT_TRUE(s.model.linear);
  const LinearCounterpart linear = counterpart_of(s);
  const FilterResult expected = kalman_filter(linear.model, InitialState::given, s.y, linear.u);
  const Likelihood by =
      log_likelihood(linear.model, InitialState::given, s.y, linear.u, linear.derivatives);
  const MatrixXd products =
      score_products(linear.model, InitialState::given, s.y, linear.u, linear.derivatives);
  ASSERT_EQ(by.status, FilterStatus::ok);
  for (const NonlinearMethod method : kMethods) {
    s.options.method = method;
    const FilterResult filter = nonlinear_filter(s.model, s.p, s.noise, s.inputs, s.y, s.options);
    ASSERT_EQ(filter.status, FilterStatus::ok) << what << name_of(method);
    MatrixXd own_products;
    const Likelihood own = likelihood_of(s, &own_products);
    ASSERT_EQ(own.status, FilterStatus::ok);
    const double value = std::abs(own.value / by.value - 1.0),
                 e = relative_distance(filter.e, expected.e),
                 z = relative_distance(filter.standardised, expected.standardised),
                 gradient = relative_distance(own.gradient, by.gradient),
                 information = relative_distance(own.information, by.information),
                 scores = relative_distance(own_products, products);
    double states = std::max(relative_distance(filter.x_pred, expected.x_pred),
                             relative_distance(filter.x_filt, expected.x_filt));
    for (std::size_t t = 0; t < expected.P_pred.size(); ++t) {
      states = std::max({states, relative_distance(filter.P_pred[t], expected.P_pred[t]),
                         relative_distance(filter.P_filt[t], expected.P_filt[t]),
                         relative_distance(filter.Sigma[t], expected.Sigma[t])});
    }
    std::printf(
        "%s, %s: value %.1e, innovations %.1e, states %.1e, gradient %.1e, information %.1e, "
        "score products %.1e\n",
        what.c_str(), name_of(method), value, std::max(e, z), states, gradient, information,
        scores);
    EXPECT_LT(std::max({value, e, z, states}), 1e-12);
    EXPECT_LT(std::max({gradient, information, scores}), 1e-12);
    EXPECT_EQ(own.value, filter.log_likelihood);
    ModelMemory memory = make_memory(s.model);
    EXPECT_NEAR(
        nonlinear_likelihood(s.model, memory, s.p, s.noise, {}, s.inputs, s.y, s.options).value,
        own.value, 1e-12 * std::abs(own.value));
  }
}

TEST(NonlinearFilter, LinearModelsHaveTheKalmanFiltersNumbers) {
  Random random(1);
  const Index N = 300;
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1));
  {
    // System 7 of Matisko (2013), with two of its entries as parameters.
    Setting s;
    s.model = from_formulas(
        {"x1", "x2", "x3", "x4"}, {}, {"a", "c"},
        {"a*x1 + x3 + x4", "-0.8*x2 - x4", "-0.1*x2 + 0.85*x3 + x4", "-0.2*x1 - 0.9*x4"},
        {"c*x1 + x4", "x2 + x3"}, Time::discrete);
    s.p = Eigen::Vector2d(0.9, 1.0);
    s.noise = zero_noise(s.model);
    MatrixXd G(4, 3);
    G << 0, 0, 0.1, 1, 0, 0, 0, 1, 0, 0, 0, 1;
    s.noise.Q = G * Eigen::Vector3d(10.0, 3.0, 7.0).asDiagonal() * G.transpose();
    s.noise.R = Eigen::Vector2d(2.0, 1.0).asDiagonal();
    s.noise.P0 = covariance_of_size(random, 4, 5.0);
    s.noise.x0 = random.normal(4);
    s.inputs = input_nodes(time, MatrixXd(0, N), InputPath::constant, kInfinity);
    s.y.resize(2, N);
    for (double& y : s.y.reshaped()) y = 5.0 * random.normal();
    s.directions = all_directions(s.model, random);
    expect_same_as_kalman_filter(s, "System 7");
  }
  Setting s;
  s.model = from_formulas({"a", "b"}, {"u", "v"}, {"p", "q"},
                          {"p*a + b + u", "-0.3*a + q*b + 0.5*v + 0.2"},
                          {"a + p*u + 1", "b - a*q", "b"}, Time::discrete);
  s.p = Eigen::Vector2d(0.7, 0.4);
  s.noise = {covariance_of_size(random, 2, 1.0), covariance_of_size(random, 3, 0.5),
             random.normal(2), covariance_of_size(random, 2, 2.0)};
  MatrixXd u(2, N);
  for (double& entry : u.reshaped()) entry = random.normal();
  s.inputs = input_nodes(time, u, InputPath::constant, kInfinity);
  s.y.resize(3, N);
  for (double& y : s.y.reshaped()) y = random.uniform() < 0.3 ? kNaN : 2.0 * random.normal();
  s.y.col(17).setConstant(kNaN);
  s.y.col(N - 1).setConstant(kNaN);
  s.directions = all_directions(s.model, random, true);
  expect_same_as_kalman_filter(s, "inputs, missing samples");
}

TEST(NonlinearFilter, ContinuousModelsApproachTheExactDiscretisationWithFourthOrder) {
  Random random(2);
  const Index N = 60;
  const double h = 0.4;
  Setting s;
  s.model = from_formulas({"a", "b"}, {"u"}, {"k", "d"}, {"b", "-k*a - d*b + u"}, {"a", "a + d*b"},
                          Time::continuous);
  s.p = Eigen::Vector2d(3.0, 0.7);
  s.noise = {MatrixXd(Eigen::Vector2d(0.0, 0.6).asDiagonal()), covariance_of_size(random, 2, 0.2),
             random.normal(2), covariance_of_size(random, 2, 0.5)};
  s.options.noise = ProcessNoise::density;
  MatrixXd u(1, N);
  for (double& entry : u.reshaped()) entry = random.normal();
  s.y.resize(2, N);
  for (double& y : s.y.reshaped()) y = random.normal();
  s.y(0, 5) = kNaN;
  s.directions = all_directions(s.model, random);
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, h * (N - 1));
  s.inputs = input_nodes(time, u, InputPath::constant, h);
  const LinearCounterpart written = counterpart_of(s);
  const StateSpace sampled = discretise(written.model, ProcessNoise::density, h);
  std::vector<StateSpace> derivatives;
  for (std::size_t i = 0; i < s.directions.size(); ++i) {
    derivatives.push_back(
        discretise_derivative(written.model, written.derivatives[i], ProcessNoise::density, h));
  }
  const Likelihood exact = log_likelihood(sampled, InitialState::given, s.y, u, derivatives);
  for (const NonlinearMethod method : kMethods) {
    s.options.method = method;
    double before[3] = {0.0, 0.0, 0.0};
    for (const int steps : {2, 4, 8, 16}) {
      s.inputs = input_nodes(time, u, InputPath::constant,
                             std::vector<int>(static_cast<std::size_t>(N - 1), steps));
      const Likelihood own = likelihood_of(s);
      ASSERT_EQ(own.status, FilterStatus::ok);
      const double now[3] = {std::abs(own.value / exact.value - 1.0),
                             relative_distance(own.gradient, exact.gradient),
                             relative_distance(own.information, exact.information)};
      std::printf("%s, %2d steps: value %.2e, gradient %.2e, information %.2e\n", name_of(method),
                  steps, now[0], now[1], now[2]);
      for (int i = 0; i < 3; ++i) {
        if (steps == 16) {
          EXPECT_GT(before[i] / now[i], 13.0) << "2^4 less 20 %";
        }
        before[i] = now[i];
      }
    }
    EXPECT_LT(*std::max_element(before, before + 3), 3e-6);
  }
}

}  // namespace
}  // namespace identikal
