#include "lib/nonlinear/filter.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/kalman.h"
#include "lib/model/discretise.h"
#include "lib/model/linear_formulas.h"
#include "lib/model/nonlinear_model.h"

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

// A model and, where its formulas are linear, its matrices.
struct FormulaModel : NonlinearModel {
  std::optional<LinearModel> matrices;
};

FormulaModel from_formulas(const Names& states, const Names& inputs, const Names& parameters,
                           const Names& dynamics, const Names& outputs, Time time,
                           Derivatives order = Derivatives::second,
                           const std::vector<bool>& known = {}) {
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
  return {make_nonlinear_model(formulas, order, known), linear_model_of(formulas)};
}

FormulaModel filtered_pendulum(Derivatives order = Derivatives::second,
                               const std::vector<bool>& known = {}) {
  return from_formulas({"th", "w"}, {"torque"}, {"l", "d", "m"},
                       {"w", "-g/l*sin(th) - d*w + torque/m"}, {"sin(th)"}, Time::continuous, order,
                       known);
}

MatrixXd covariance_of_size(Random& random, Index n, double size) {
  MatrixXd L(n, n);
  for (double& entry : L.reshaped()) entry = random.normal();
  return size * (L * L.transpose() / static_cast<double>(n) + 0.2 * MatrixXd::Identity(n, n));
}

// Everything that a likelihood depends on.
struct Setting {
  FormulaModel model;
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

// The matrices of the model, as they are written, with this noise.
StateSpace with_noise(StateSpace matrices, const FilterNoise& noise) {
  matrices.Q = noise.Q;
  matrices.R = noise.R;
  matrices.x0 = noise.x0;
  matrices.P0 = noise.P0;
  return matrices;
}

LinearCounterpart counterpart_of(const Setting& s) {
  LinearModel linear = *s.model.matrices;
  linear.continuous = false;
  const Index nx = s.model.states, ny = s.model.outputs;
  linear.G.constant = linear.Q.constant = MatrixXd::Identity(nx, nx);
  linear.R.constant = MatrixXd::Identity(ny, ny);
  linear.S.constant = MatrixXd::Zero(nx, ny);
  ParameterSet parameters;
  for (const double value : s.p) {
    parameters.emplace_back();
    parameters.back().value = MatrixXd::Constant(1, 1, value);
  }
  const std::vector<StateSpace> by_parameter = model_derivatives(linear, parameters);
  LinearCounterpart out;
  out.model = with_noise(written_matrices(linear, parameters), s.noise);
  for (const FilterDirection& d : s.directions) {
    StateSpace derivative = out.model;
    if (d.parameter >= 0) {
      derivative = by_parameter[static_cast<std::size_t>(d.parameter)];
    } else {
      for (MatrixXd* M : {&derivative.A, &derivative.B, &derivative.C, &derivative.D}) {
        M->setZero();
      }
    }
    derivative.G.setZero(nx, nx);
    derivative.S.setZero(nx, ny);
    out.derivatives.push_back(with_noise(derivative, d.noise));
  }
  out.u = model_inputs(linear, s.inputs.at_sample);
  return out;
}

void expect_same_as_kalman_filter(Setting& s, const std::string& what) {
  ASSERT_TRUE(s.model.matrices.has_value());
  const LinearCounterpart linear = counterpart_of(s);
  const FilterResult expected = kalman_filter(linear.model, InitialState::given, s.y, linear.u);
  // As a model that may change it is filtered in full at every sample: log_likelihood() of one that
  // cannot keeps the gain once that has settled to 1e-12.
  const ModelAt same = [&](Index, StateSpace& model, std::vector<StateSpace>* derivatives) {
    model = linear.model;
    if (derivatives != nullptr) *derivatives = linear.derivatives;
  };
  const Likelihood by = log_likelihood(same, InitialState::given, s.y, linear.u, true);
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

TEST(NonlinearFilter, NoiseBetweenSamplesIsTheIntegralAlongTheTrajectory) {
  Random random(7);
  const NonlinearModel model = filtered_pendulum();
  const VectorXd p = (VectorXd(3) << 0.8, 0.3, 0.5).finished();
  const MatrixXd Q = covariance_of_size(random, 2, 0.5);
  const Index parts = 64;
  const VectorXd fine = VectorXd::LinSpaced(parts + 1, 0.0, 0.5);
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  // Phi from every part's begin to the end, and Simpson's rule over those.
  const InputNodes nodes =
      input_nodes(fine, MatrixXd::Constant(1, parts + 1, 0.4), InputPath::constant, 1.0);
  std::vector<MatrixXd> Phi;
  VectorXd x = Eigen::Vector2d(1.2, -0.5);
  Jacobian jacobian;
  for (Index j = 0; j < parts; ++j) {
    step(model, memory, nodes, j, x, jacobian);
    for (MatrixXd& earlier : Phi) earlier = (jacobian.wrt_x * earlier).eval();
    Phi.push_back(jacobian.wrt_x);
  }
  Phi.emplace_back(MatrixXd::Identity(2, 2));
  MatrixXd expected = MatrixXd::Zero(2, 2);
  for (Index j = 0; j <= parts; ++j) {
    const double weight = j == 0 || j == parts ? 1.0 : j % 2 == 1 ? 4.0 : 2.0;
    const MatrixXd& to_end = Phi[static_cast<std::size_t>(j)];
    expected += weight * 0.5 / (3.0 * static_cast<double>(parts)) * to_end * Q * to_end.transpose();
  }
  double before = 0.0;
  for (const int steps : {8, 16, 32, 64}) {
    const InputNodes once = input_nodes(Eigen::Vector2d(0.0, 0.5), MatrixXd::Constant(1, 2, 0.4),
                                        InputPath::constant, std::vector<int>{steps});
    Gramians gramians;
    gramians.densities = Q.reshaped(4, 1);
    VectorXd end = Eigen::Vector2d(1.2, -0.5);
    step(model, memory, once, 0, end, jacobian, Derivatives::first, &gramians);
    const double now = relative_distance(gramians.values.reshaped(2, 2), expected);
    std::printf("integral of the noise in %d steps: %.1e\n", steps, now);
    if (steps == 64) {
      EXPECT_GT(before / now, 13.0);
      EXPECT_LT(now, 1e-6);
    }
    before = now;
  }
  Gramians none;
  EXPECT_THROW(step(model, memory, nodes, 0, x, jacobian, Derivatives::first, &none),
               std::invalid_argument);
}

// --- gradients ----------------------------------------------------------------------------------

void move_along(Setting& s, std::size_t direction, double way) {
  const FilterDirection& d = s.directions[direction];
  if (d.parameter >= 0) s.p[d.parameter] += way;
  s.noise.Q += way * d.noise.Q;
  s.noise.R += way * d.noise.R;
  s.noise.x0 += way * d.noise.x0;
  s.noise.P0 += way * d.noise.P0;
}

// Central differences over `way`, extrapolated twice to the sixth order.
MatrixXd extrapolated_difference(const Setting& s, std::size_t direction, double way,
                                 const std::function<MatrixXd(const Setting&)>& of) {
  const auto slope = [&](double h) -> MatrixXd {
    Setting up = s, down = s;
    move_along(up, direction, h);
    move_along(down, direction, -h);
    return (of(up) - of(down)) / (2.0 * h);
  };
  const MatrixXd wide = slope(way), half = slope(0.5 * way), quarter = slope(0.25 * way);
  return (16.0 * (4.0 * quarter - half) - (4.0 * half - wide)) / 45.0;
}

// Exact and numerical gradient, each entry against the larger of itself and its own scatter.
double gradient_error(const Setting& s, const Likelihood& exact, double way) {
  double worst = 0.0;
  for (std::size_t i = 0; i < s.directions.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const double size =
        std::max(std::abs(exact.gradient[at]), std::sqrt(exact.information(at, at)));
    const double numerical = extrapolated_difference(s, i, way, [](const Setting& moved) {
      ModelMemory memory = make_memory(moved.model);
      return MatrixXd::Constant(1, 1,
                                nonlinear_likelihood(moved.model, memory, moved.p, moved.noise, {},
                                                     moved.inputs, moved.y, moved.options)
                                    .value);
    })(0, 0);
    worst = std::max(worst, std::abs(exact.gradient[at] - numerical) / size);
  }
  return worst;
}

// The information from differences of innovations and their covariances; no sample is missing.
MatrixXd numerical_information(const Setting& s, double way) {
  const Index ny = s.model.outputs;
  const auto told = [ny](const Setting& moved) {
    const FilterResult f =
        nonlinear_filter(moved.model, moved.p, moved.noise, moved.inputs, moved.y, moved.options);
    MatrixXd out(ny, f.e.cols() * (1 + ny));
    for (Index t = 0; t < f.e.cols(); ++t) {
      out.col(t * (1 + ny)) = f.e.col(t);
      out.middleCols(t * (1 + ny) + 1, ny) = f.Sigma[static_cast<std::size_t>(t)];
    }
    return out;
  };
  const MatrixXd here = told(s);
  std::vector<MatrixXd> by;
  for (std::size_t i = 0; i < s.directions.size(); ++i)
    by.push_back(extrapolated_difference(s, i, way, told));
  const auto k = static_cast<Index>(by.size());
  MatrixXd out = MatrixXd::Zero(k, k);
  for (Index t = 0; t < s.y.cols(); ++t) {
    const MatrixXd inverse = here.middleCols(t * (1 + ny) + 1, ny).inverse();
    for (Index i = 0; i < k; ++i) {
      for (Index j = 0; j < k; ++j) {
        const MatrixXd &a = by[static_cast<std::size_t>(i)], &b = by[static_cast<std::size_t>(j)];
        out(i, j) += 0.5 * (inverse * a.middleCols(t * (1 + ny) + 1, ny) * inverse *
                            b.middleCols(t * (1 + ny) + 1, ny))
                               .trace() +
                     a.col(t * (1 + ny)).dot(inverse * b.col(t * (1 + ny)));
      }
    }
  }
  return out;
}

Setting pendulum_setting(Random& random, ProcessNoise noise, bool missing) {
  Setting s;
  s.model = filtered_pendulum();
  s.p = (VectorXd(3) << 0.8, 0.3, 0.5).finished();
  s.options.noise = noise;
  s.noise = {covariance_of_size(random, 2, 0.05), covariance_of_size(random, 1, 0.01),
             Eigen::Vector2d(0.6, -0.3), covariance_of_size(random, 2, 0.05)};
  const Index N = 80;
  VectorXd time(N);
  MatrixXd u(1, N);
  double at = 0.0;
  for (Index t = 0; t < N; ++t) {
    time[t] = at += 0.02 + 0.06 * random.uniform();
    u(0, t) = std::sin(2.0 * at) + 0.2 * random.normal();
  }
  s.inputs = input_nodes(time, u, InputPath::linear, 0.03);
  ModelMemory memory = make_memory(s.model);
  set_parameters(s.model, memory, s.p);
  VectorXd x = s.noise.x0, y(1);
  s.y.resize(1, N);
  for (Index t = 0; t < N; ++t) {
    observe(s.model, memory, x, u.col(t), time[t], y);
    s.y(0, t) = missing && random.uniform() < 0.2 ? kNaN : y[0] + 0.1 * random.normal();
    if (t + 1 == N) break;
    step(s.model, memory, s.inputs, t, x);
    x += 0.05 * random.normal(2);
  }
  s.directions = all_directions(s.model, random);
  return s;
}

// The growth model of the particle filter literature, with an output that does not hide the sign.
Setting growth_setting(Random& random) {
  Setting s;
  s.model = from_formulas({"x"}, {}, {"a", "b", "c"}, {"a*x + b*x/(1 + x^2) + 8*cos(1.2*t)"},
                          {"c*x + x^2/20 + atan(x)"}, Time::discrete);
  s.p = (VectorXd(3) << 0.5, 25.0, 1.5).finished();
  const auto one = [](double value) { return MatrixXd::Constant(1, 1, value); };
  s.noise = {one(4.0), one(1.0), VectorXd::Constant(1, 0.1), one(5.0)};
  const Index N = 100;
  s.inputs = input_nodes(VectorXd::LinSpaced(N, 0.0, N - 1.0), MatrixXd(0, N), InputPath::constant,
                         kInfinity);
  double x = 0.5;
  s.y.resize(1, N);
  for (Index t = 0; t < N; ++t) {
    s.y(0, t) = 1.5 * x + x * x / 20.0 + std::atan(x) + random.normal();
    x = 0.5 * x + 25.0 * x / (1.0 + x * x) + 8.0 * std::cos(1.2 * static_cast<double>(t)) +
        2.0 * random.normal();
  }
  s.directions = all_directions(s.model, random, true);
  return s;
}

TEST(NonlinearFilter, GradientAndInformationAreExact) {
  Random random(3);
  struct Case {
    std::string name;
    Setting setting;
    double way;
  };
  const std::vector<Case> cases{
      {"pendulum, noise per sample", pendulum_setting(random, ProcessNoise::per_sample, true),
       2e-3},
      {"pendulum, noise density", pendulum_setting(random, ProcessNoise::density, false), 2e-3},
      {"growth", growth_setting(random), 1e-3}};
  for (const Case& c : cases) {
    for (const NonlinearMethod method : kMethods) {
      Setting s = c.setting;
      s.options.method = method;
      const Likelihood exact = likelihood_of(s);
      ASSERT_EQ(exact.status, FilterStatus::ok) << c.name << name_of(method);
      const double gradient = gradient_error(s, exact, c.way);
      std::printf("%s, %s: log-likelihood %.4f, gradient %.1e", c.name.c_str(), name_of(method),
                  exact.value, gradient);
      EXPECT_LT(gradient, 1e-7);
      if (!s.y.hasNaN()) {
        const double information =
            relative_distance(exact.information, numerical_information(s, c.way));
        std::printf(", information %.1e", information);
        EXPECT_LT(information, 1e-7);
      }
      std::printf("\n");
    }
  }
}

// --- output error -------------------------------------------------------------------------------

TEST(NonlinearFilter, OutputErrorTakesThePathOfItsOwnToTheSameNumbers) {
  Random random(4);
  Setting s = pendulum_setting(random, ProcessNoise::per_sample, true);
  s.noise.Q.setZero();
  s.noise.P0.setZero();
  std::erase_if(s.directions, [](const FilterDirection& d) {
    return !d.noise.Q.isZero(0.0) || !d.noise.P0.isZero(0.0);
  });
  const auto k = static_cast<Index>(s.directions.size());
  MatrixXd products;
  const Likelihood fast = likelihood_of(s, &products);
  ASSERT_EQ(fast.status, FilterStatus::ok);
  EXPECT_LT(gradient_error(s, fast, 1e-3), 1e-7);
  Setting first = s;
  first.model = filtered_pendulum(Derivatives::first);
  for (const NonlinearMethod method : kMethods) {
    first.options.method = s.options.method = method;
    EXPECT_EQ(likelihood_of(first).value, fast.value);
    EXPECT_EQ(likelihood_of(first).gradient, fast.gradient);
    if (method == NonlinearMethod::unscented) continue;
    Setting general = s;  // a moving P0 makes it general
    general.directions.push_back({-1, zero_noise(s.model)});
    general.directions.back().noise.P0(0, 0) = 1.0;
    MatrixXd general_products;
    const Likelihood slow = likelihood_of(general, &general_products);
    ASSERT_EQ(slow.status, FilterStatus::ok);
    const double value = std::abs(fast.value / slow.value - 1.0),
                 gradient = relative_distance(fast.gradient, slow.gradient.head(k)),
                 information =
                     relative_distance(fast.information, slow.information.topLeftCorner(k, k)),
                 scores = relative_distance(products, general_products.topLeftCorner(k, k));
    std::printf(
        "against the general path, %s: value %.1e, gradient %.1e, information %.1e, "
        "score products %.1e\n",
        name_of(method), value, gradient, information, scores);
    EXPECT_LT(std::max({value, gradient, information, scores}), 1e-12);
  }
  // A variance so small that it does not matter.
  s.options.method = NonlinearMethod::unscented;
  s.noise.P0 = 1e-18 * MatrixXd::Identity(2, 2);
  EXPECT_NEAR(likelihood_of(s).value, fast.value, 1e-9 * std::abs(fast.value));
  const FilterResult told =
      nonlinear_filter(first.model, first.p, first.noise, first.inputs, first.y, first.options);
  EXPECT_NEAR(told.log_likelihood, fast.value, 1e-12 * std::abs(fast.value));
  EXPECT_EQ(told.x_pred, told.x_filt);
}

// --- a strongly nonlinear model -----------------------------------------------------------------

struct Told {
  double log_likelihood = 0.0;
  VectorXd x_filt;
};

// Bootstrap particle filter of a model with one state and one output (Gordon, Salmond & Smith
// 1993), resampled systematically at every sample.
Told particle_filter(const Setting& s, Index particles, Random& random) {
  ModelMemory memory = make_memory(s.model);
  set_parameters(s.model, memory, s.p);
  const double R = s.noise.R(0, 0), q = std::sqrt(s.noise.Q(0, 0));
  VectorXd X(particles), weight(particles), next(particles), one(1), y(1);
  for (double& x : X) x = s.noise.x0[0] + std::sqrt(s.noise.P0(0, 0)) * random.normal();
  Told out;
  out.x_filt.resize(s.y.cols());
  for (Index t = 0; t < s.y.cols(); ++t) {
    for (Index i = 0; i < particles; ++i) {
      one[0] = X[i];
      observe(s.model, memory, one, s.inputs.at_sample.col(t), s.inputs.time[t], y);
      weight[i] = -0.5 * (s.y(0, t) - y[0]) * (s.y(0, t) - y[0]) / R;
    }
    const double largest = weight.maxCoeff();
    weight = (weight.array() - largest).exp();
    const double sum = weight.sum();
    out.log_likelihood += largest + std::log(sum / static_cast<double>(particles)) -
                          0.5 * std::log(2.0 * std::numbers::pi * R);
    out.x_filt[t] = weight.dot(X) / sum;
    if (t + 1 == s.y.cols()) break;
    double reached = weight[0];
    const double offset = random.uniform(), share = sum / static_cast<double>(particles);
    for (Index i = 0, from = 0; i < particles; ++i) {
      const double level = (static_cast<double>(i) + offset) * share;
      while (reached < level && from + 1 < particles) reached += weight[++from];
      one[0] = X[from];
      step(s.model, memory, s.inputs, t, one);
      next[i] = one[0] + q * random.normal();
    }
    X.swap(next);
  }
  return out;
}

Setting scalar_setting(const std::string& f, const std::string& h, double Q, double R, double x0,
                       double P0, Index N, Random& random) {
  Setting s;
  s.model = from_formulas({"x"}, {}, {}, {f}, {h}, Time::discrete);
  const auto one = [](double value) { return MatrixXd::Constant(1, 1, value); };
  s.p.resize(0);
  s.noise = {one(Q), one(R), VectorXd::Constant(1, x0), one(P0)};
  s.inputs = input_nodes(VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1)), MatrixXd(0, N),
                         InputPath::constant, kInfinity);
  ModelMemory memory = make_memory(s.model);
  set_parameters(s.model, memory, s.p);
  VectorXd x = s.noise.x0 + std::sqrt(P0) * random.normal(1), y(1);
  s.y.resize(1, N);
  for (Index t = 0; t < N; ++t) {
    observe(s.model, memory, x, s.inputs.at_sample.col(t), s.inputs.time[t], y);
    s.y(0, t) = y[0] + std::sqrt(R) * random.normal();
    if (t + 1 < N) step(s.model, memory, s.inputs, t, x);
    x += std::sqrt(Q) * random.normal(1);
  }
  return s;
}

TEST(NonlinearFilter, ParticlesAgreeWithTheUnscentedWhereTheExtendedIsOff) {
  // The curvature of f moves the mean, which the extended filter does not see. Means are compared
  // by their root mean square difference; states are of size one.
  struct Case {
    const char* f;
    double Q, R, P0;
    double value_within, mean_within;  // infinite: not compared
  };
  const Case cases[] = {{"0.2*x^2 - 1", 0.8, 8.0, 0.8, kInfinity, 0.02},
                        {"log(1 + exp(2*x)) - 1.5", 0.5, 2.0, 1.0, 0.25, kInfinity}};
  constexpr int kRuns = 4;
  const Index N = 200;
  for (const Case& c : cases) {
    Random random(11);
    Setting s = scalar_setting(c.f, "x", c.Q, c.R, 0.0, c.P0, N, random);
    VectorXd values(kRuns);
    MatrixXd means(N, kRuns);
    for (Index i = 0; i < kRuns; ++i) {
      const Told told = particle_filter(s, 20000, random);
      values[i] = told.log_likelihood;
      means.col(i) = told.x_filt;
    }
    const double value = values.mean();
    const VectorXd mean = means.rowwise().mean();
    // Standard errors of the averages over the runs.
    const double value_error = (values.array() - value).matrix().norm() / std::sqrt(12.0),
                 mean_error = (means.colwise() - mean).norm() / std::sqrt(12.0 * N);
    const auto off = [&](NonlinearMethod method) {
      s.options.method = method;
      const FilterResult f = nonlinear_filter(s.model, s.p, s.noise, s.inputs, s.y, s.options);
      return Eigen::Vector2d(std::abs(f.log_likelihood - value),
                             (f.x_filt.row(0).transpose() - mean).norm() / std::sqrt(N));
    };
    const Eigen::Vector2d extended = off(NonlinearMethod::extended),
                          unscented = off(NonlinearMethod::unscented);
    std::printf(
        "%s: particles %.3f +- %.3f, mean +- %.4f; extended off by %.3f and %.3f, "
        "unscented by %.3f and %.3f\n",
        c.f, value, value_error, mean_error, extended[0], extended[1], unscented[0], unscented[1]);
    if (std::isfinite(c.value_within)) {
      EXPECT_LT(3.0 * value_error, c.value_within);
      EXPECT_LT(unscented[0], c.value_within);
      EXPECT_GT(extended[0], 4.0 * c.value_within);
    } else {
      EXPECT_LT(3.0 * mean_error, c.mean_within);
      EXPECT_LT(unscented[1], c.mean_within);
      EXPECT_GT(extended[1], 4.0 * c.mean_within);
    }
  }
}

TEST(NonlinearFilter, SemidefiniteCovariancesWork) {
  Random random(6);
  Setting s;
  s.model = from_formulas({"a", "b", "c"}, {}, {"p"}, {"0.8*a + p*b", "0.5*b - 0.1*a", "c"},
                          {"a + c", "b"}, Time::discrete);
  const Index N = 100;
  s.p = VectorXd::Constant(1, 0.3);
  s.noise = zero_noise(s.model);
  // One source drives a and b alike, c is a constant that is known, and the start lies on a line.
  const VectorXd by = Eigen::Vector3d(1.0, -2.0, 0.0);
  s.noise.Q = by * by.transpose();
  s.noise.P0 = s.noise.Q;
  s.noise.x0 = Eigen::Vector3d(0.0, 0.0, 1.0);
  s.noise.R = 0.3 * MatrixXd::Identity(2, 2);
  s.inputs = input_nodes(VectorXd::LinSpaced(N, 0.0, N - 1.0), MatrixXd(0, N), InputPath::constant,
                         kInfinity);
  s.y.resize(2, N);
  for (double& y : s.y.reshaped()) y = random.normal();
  s.directions.push_back({0, zero_noise(s.model)});
  s.directions.push_back({-1, zero_noise(s.model)});
  s.directions.back().noise.Q = s.noise.Q;
  expect_same_as_kalman_filter(s, "semidefinite");
  // Sigma points do not determine what a variance of zero does when it grows; they say so.
  s.directions.back().noise.Q(2, 2) = 1.0;
  s.options.method = NonlinearMethod::unscented;
  EXPECT_EQ(likelihood_of(s).status, FilterStatus::indefinite);
  s.options.method = NonlinearMethod::extended;
  EXPECT_EQ(likelihood_of(s).status, FilterStatus::ok);
  s.directions.clear();
  s.options.method = NonlinearMethod::unscented;
  s.noise.P0(0, 1) = s.noise.P0(1, 0) = 5.0;
  EXPECT_EQ(likelihood_of(s).status, FilterStatus::indefinite);
  // A nonlinear model in which one state follows from another.
  Setting bent = s;
  bent.model =
      from_formulas({"a", "b", "c"}, {}, {"p"}, {"0.8*sin(a) + p*b", "0.5*b - 0.1*a^2", "c"},
                    {"a + c", "b*a"}, Time::discrete);
  bent.noise.P0 = bent.noise.Q;
  bent.directions.push_back({0, zero_noise(s.model)});
  bent.directions.push_back({-1, zero_noise(s.model)});
  bent.directions.back().noise.Q = s.noise.Q;
  const Likelihood exact = likelihood_of(bent);
  ASSERT_EQ(exact.status, FilterStatus::ok);
  const double gradient = gradient_error(bent, exact, 1e-3);
  std::printf("semidefinite, nonlinear, unscented: gradient %.1e\n", gradient);
  EXPECT_LT(gradient, 1e-7);
}

// --- what cannot be done ------------------------------------------------------------------------

TEST(NonlinearFilter, TroubleIsAStatusAndAMistakeAnException) {
  Random random(5);
  const Setting good = pendulum_setting(random, ProcessNoise::density, false);
  const auto status_with = [&](NonlinearMethod method,
                               const std::function<void(Setting&)>& change) {
    Setting s = good;
    s.options.method = method;
    change(s);
    const FilterStatus filter =
        nonlinear_filter(s.model, s.p, s.noise, s.inputs, s.y, s.options).status;
    EXPECT_EQ(likelihood_of(s).status, filter);
    return filter;
  };
  for (const NonlinearMethod method : kMethods) {
    SCOPED_TRACE(name_of(method));
    EXPECT_EQ(status_with(method, [](Setting&) {}), FilterStatus::ok);
    EXPECT_EQ(status_with(method, [](Setting& s) { s.noise.R(0, 0) = -1.0; }),
              FilterStatus::indefinite);
    EXPECT_EQ(status_with(method,
                          [&](Setting& s) {
                            s = scalar_setting("exp(100*x)", "x", 1.0, 1.0, 0.0, 1.0, 10, random);
                            s.options.method = method;
                            s.noise.x0[0] = 10.0;
                            s.y.setZero();
                            s.directions = all_directions(s.model, random);
                          }),
              FilterStatus::not_finite);
    EXPECT_EQ(status_with(method, [](Setting& s) { s.y(0, 7) = kInfinity; }),
              FilterStatus::not_finite);
    EXPECT_EQ(status_with(method, [](Setting& s) { s.inputs.u(0, 9) = kNaN; }),
              FilterStatus::not_finite);
    EXPECT_EQ(status_with(method, [](Setting& s) { s.p[0] = 0.0; }), FilterStatus::not_finite);
    for (const auto& mistake : std::vector<std::function<void(Setting&)>>{
             [](Setting& s) { s.p.conservativeResize(2); },
             [](Setting& s) { s.noise.Q.resize(3, 3); }, [](Setting& s) { s.noise.R.resize(2, 2); },
             [](Setting& s) { s.noise.x0.resize(1); }, [](Setting& s) { s.noise.P0.resize(2, 1); },
             [](Setting& s) { s.y.conservativeResize(1, 10); },
             [](Setting& s) { s.y.conservativeResize(2, Eigen::NoChange); },
             [](Setting& s) { s.directions[1].noise.Q.resize(1, 1); },
             [](Setting& s) { s.directions[1].parameter = 3; },
             [](Setting& s) { s.options.iterations = 0; },
             [](Setting& s) { s.options.weights.kappa = -2.0; },
             [](Setting& s) { s.model = filtered_pendulum(Derivatives::first); }}) {
      Setting s = good;
      s.options.method = method;
      mistake(s);
      EXPECT_THROW(likelihood_of(s), std::invalid_argument);
    }
  }
  Setting discrete = growth_setting(random);
  discrete.options.noise = ProcessNoise::density;
  EXPECT_THROW(likelihood_of(discrete), std::invalid_argument);
}

// What is known costs no derivative, and what is derived stays the same to the last digit.
TEST(NonlinearFilter, KnownParametersHaveNoDerivatives) {
  Random random(41);
  for (const NonlinearMethod method : kMethods) {
    SCOPED_TRACE(name_of(method));
    Setting all = pendulum_setting(random, ProcessNoise::density, true);
    all.options.method = method;
    all.directions.erase(all.directions.begin());
    all.directions.erase(all.directions.begin() + 1);  // l and m; d stays, and the noise
    Setting some = all;
    some.model = filtered_pendulum(Derivatives::second, {true, false, true});
    EXPECT_EQ(some.model.columns, 1);
    EXPECT_EQ(some.model.column,
              (std::vector<Index>{NonlinearModel::kKnown, 0, NonlinearModel::kKnown}));
    const Likelihood a = likelihood_of(all), b = likelihood_of(some);
    EXPECT_EQ(a.value, b.value);
    EXPECT_LT((a.gradient - b.gradient).norm(), 1e-14 * a.gradient.norm());
    EXPECT_LT((a.information - b.information).norm(), 1e-14 * a.information.norm());
    some.directions.push_back({2, zero_noise(some.model)});
    EXPECT_THROW(likelihood_of(some), std::invalid_argument);
  }
  EXPECT_THROW(filtered_pendulum(Derivatives::first, {true}), std::invalid_argument);
}

// A parameter of the noise or the start alone is no parameter of the formulas.
TEST(NonlinearFilter, ParametersInNoFormulaHaveNoColumn) {
  const FormulaModel model =
      from_formulas({"x"}, {}, {"x0", "a"}, {"-a*x"}, {"x"}, Time::continuous);
  EXPECT_EQ(model.columns, 1);
  EXPECT_EQ(model.column, (std::vector<Index>{NonlinearModel::kInNoFormula, 0}));
  Random random(42);
  Setting s = scalar_setting("-x", "x", 1.0, 1.0, 1.0, 1.0, 10, random);
  s.model = from_formulas({"x"}, {}, {"x0", "a"}, {"-a*x"}, {"x"}, Time::discrete);
  s.p = Eigen::Vector2d(3.0, 0.5);
  s.directions = {{0, zero_noise(s.model)}, {1, zero_noise(s.model)}};
  const Likelihood found = likelihood_of(s);
  EXPECT_EQ(found.gradient[0], 0.0);
  EXPECT_NE(found.gradient[1], 0.0);
}

}  // namespace
}  // namespace identikal
