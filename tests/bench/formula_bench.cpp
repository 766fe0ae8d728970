// What does a formula from a text cost beside the same equations in C++?
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "lib/base/dual.h"
#include "lib/formula/tape.h"
#include "lib/nonlinear/filter.h"

namespace {

using identikal::Expression;
using identikal::Tape;
using identikal::TapeMemory;

// Linear single-track vehicle: two states, two inputs, nine parameters.
const std::vector<std::string> kSymbols{"vy", "r",  "steer", "vx", "m",    "a",     "b",
                                        "ir", "Iz", "Cf",    "Cr", "gain", "offset"};
const std::vector<std::string> kRates{
    "-(Cf+Cr)/(m*vx)*vy - (vx + (a*Cf-b*Cr)/(m*vx))*r + Cf/(m*ir)*gain*(steer + offset)",
    "-(a*Cf-b*Cr)/(Iz*vx)*vy - (a^2*Cf+b^2*Cr)/(Iz*vx)*r + a*Cf/(Iz*ir)*gain*(steer + offset)"};
const std::vector<bool> kHeld{false, false, false, false, true, true, true,
                              true,  true,  true,  true,  true, true};
const std::vector<double> kPoint{0.3,  0.1,    0.4, 25.0, 1446.0, 0.987, 1.525,
                                 21.0, 2319.0, 8e4, 9e4,  1.0,    0.01};

// The same, written down as it stands.
template <typename T>
[[gnu::noinline]] std::array<T, 2> rates(const T* s) {
  const T vy = s[0], r = s[1], steer = s[2], vx = s[3], m = s[4], a = s[5], b = s[6], ir = s[7],
          Iz = s[8], Cf = s[9], Cr = s[10], gain = s[11], offset = s[12];
  return {-(Cf + Cr) / (m * vx) * vy - (vx + (a * Cf - b * Cr) / (m * vx)) * r +
              Cf / (m * ir) * gain * (steer + offset),
          -(a * Cf - b * Cr) / (Iz * vx) * vy - (a * a * Cf + b * b * Cr) / (Iz * vx) * r +
              a * Cf / (Iz * ir) * gain * (steer + offset)};
}

// By the states and the parameters: all but steering and speed.
const std::vector<int> kBy{0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 12};

Tape tape(bool with_jacobian) {
  std::vector<Expression> formulas;
  for (const std::string& text : kRates) {
    formulas.push_back(identikal::parse_expression(text, kSymbols));
  }
  return with_jacobian ? identikal::compile(formulas, kHeld, kBy)
                       : identikal::compile(formulas, kHeld);
}

// Every evaluation waits for the one before, as along a simulation.
template <typename F>
void chain(benchmark::State& state, F&& evaluate) {
  std::vector<double> point = kPoint;
  double f[2] = {0.0, 0.0};
  for (auto _ : state) {
    point[0] = 0.3 + 1e-9 * f[0];
    point[1] = 0.1 + 1e-9 * f[1];
    evaluate(point.data(), f);
    benchmark::DoNotOptimize(f);
  }
}

void value_by_hand(benchmark::State& state) {
  chain(state, [](const double* s, double* f) {
    const std::array<double, 2> out = rates(s);
    f[0] = out[0];
    f[1] = out[1];
  });
}

void value_by_tape(benchmark::State& state) {
  const Tape t = tape(false);
  TapeMemory memory = identikal::make_memory(t);
  std::copy(kPoint.begin(), kPoint.end(), memory.begin());
  evaluate_held(t, memory);
  state.counters["instructions"] = static_cast<double>(t.values_end - t.held_end);
  chain(state, [&](const double* s, double* f) {
    memory[0] = s[0];
    memory[1] = s[1];
    evaluate_values(t, memory, {f, 2});
  });
}

void value_by_tape_new_parameters(benchmark::State& state) {
  const Tape t = tape(false);
  TapeMemory memory = identikal::make_memory(t);
  state.counters["instructions"] = static_cast<double>(t.values_end);
  chain(state, [&](const double* s, double* f) {
    std::copy(s, s + kPoint.size(), memory.begin());
    evaluate_held(t, memory);
    evaluate_values(t, memory, {f, 2});
  });
}

void value_by_tree(benchmark::State& state) {
  std::vector<Expression> formulas;
  for (const std::string& text : kRates) {
    formulas.push_back(identikal::parse_expression(text, kSymbols));
  }
  chain(state, [&](const double* s, double* f) {
    for (std::size_t i = 0; i < 2; ++i) f[i] = evaluate(formulas[i], {s, kPoint.size()});
  });
}

void jacobian_by_tape(benchmark::State& state) {
  const Tape t = tape(true);
  TapeMemory memory = identikal::make_memory(t);
  std::copy(kPoint.begin(), kPoint.end(), memory.begin());
  evaluate_held(t, memory);
  std::array<double, 22> J;
  state.counters["instructions"] = static_cast<double>(t.code.size() - t.held_end);
  chain(state, [&](const double* s, double* f) {
    memory[0] = s[0];
    memory[1] = s[1];
    evaluate_jacobian(t, memory, {f, 2}, J);
    benchmark::DoNotOptimize(J);
  });
}

void jacobian_by_dual_numbers(benchmark::State& state) {
  using T = identikal::Dual<11>;
  std::array<T, 13> variable;
  for (std::size_t i = 0; i < kPoint.size(); ++i) variable[i] = T(kPoint[i]);
  for (std::size_t i = 0; i < kBy.size(); ++i) {
    const auto at = static_cast<std::size_t>(kBy[i]);
    variable[at] = T(kPoint[at], static_cast<int>(i));
  }
  chain(state, [&](const double* s, double* f) {
    variable[0].a = s[0];
    variable[1].a = s[1];
    std::array<T, 2> out = rates(variable.data());
    benchmark::DoNotOptimize(out);
    f[0] = out[0].a;
    f[1] = out[1].a;
  });
}

// A recording of the same vehicle: yaw rate and lateral velocity, steering and speed given. Time
// per sample of the log-likelihood, with its gradient by the nine parameters and the noise.
void filter(benchmark::State& state, identikal::NonlinearMethod method, bool noisy, bool gradient) {
  using Eigen::Index;
  using Eigen::MatrixXd;
  using Eigen::VectorXd;
  std::vector<std::string> names = kSymbols;
  names.emplace_back("t");
  identikal::ModelFormulas formulas;
  formulas.states = formulas.inputs = 2;
  formulas.parameters = 9;
  for (const std::string& text : kRates) {
    formulas.dynamics.push_back(identikal::parse_expression(text, names));
  }
  for (const char* text : {"vy", "r"}) {
    formulas.outputs.push_back(identikal::parse_expression(text, names));
  }
  const identikal::NonlinearModel model =
      identikal::make_nonlinear_model(formulas, identikal::Derivatives::second);
  identikal::ModelMemory memory = identikal::make_memory(model);
  const Index N = 2000;
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, 0.01 * static_cast<double>(N - 1));
  MatrixXd u(2, N), y(2, N);
  u.row(0) = time.array().sin();
  u.row(1) = 25.0 + (0.1 * time.array()).cos();
  y.row(0) = 0.3 * (time.array() - 0.2).sin();
  y.row(1) = 0.2 * (time.array() - 0.1).sin();
  const identikal::InputNodes inputs =
      identikal::input_nodes(time, u, identikal::InputPath::linear, 0.01);
  const VectorXd p = Eigen::Map<const VectorXd>(kPoint.data() + 4, 9);
  identikal::FilterNoise noise = identikal::zero_noise(model);
  noise.R = 0.01 * MatrixXd::Identity(2, 2);
  if (noisy) noise.Q = noise.P0 = 1e-4 * MatrixXd::Identity(2, 2);
  std::vector<identikal::FilterDirection> directions;
  for (Index i = 0; gradient && i < (noisy ? 13 : 11); ++i) {
    directions.push_back({i < 9 ? i : -1, identikal::zero_noise(model)});
    if (i == 9 || i == 10) directions.back().noise.R(i - 9, i - 9) = 1.0;
    if (i > 10) directions.back().noise.Q(i - 11, i - 11) = 1.0;
  }
  identikal::NonlinearFilterOptions options;
  options.method = method;
  options.noise = identikal::ProcessNoise::density;
  for (auto _ : state) {
    const identikal::Likelihood l =
        identikal::nonlinear_likelihood(model, memory, p, noise, directions, inputs, y, options);
    if (l.status != identikal::FilterStatus::ok) state.SkipWithError("the filter does not run");
    benchmark::DoNotOptimize(l.value);
  }
  state.SetItemsProcessed(state.iterations() * N);
  state.counters["seconds_per_sample"] =
      benchmark::Counter(static_cast<double>(state.iterations() * N),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
constexpr auto kExtended = identikal::NonlinearMethod::extended,
               kUnscented = identikal::NonlinearMethod::unscented;
BENCHMARK_CAPTURE(filter, output_error_value, kExtended, false, false);
BENCHMARK_CAPTURE(filter, output_error_gradient, kExtended, false, true);
BENCHMARK_CAPTURE(filter, extended_value, kExtended, true, false);
BENCHMARK_CAPTURE(filter, extended_gradient, kExtended, true, true);
BENCHMARK_CAPTURE(filter, unscented_value, kUnscented, true, false);
BENCHMARK_CAPTURE(filter, unscented_gradient, kUnscented, true, true);

// Position, course, speed, turn rate and a gyro's bias at 50 Hz; positions come at 1 Hz, speed and
// turn rate at every sample. The gradient is by six densities and variances.
void tracker(benchmark::State& state, bool gradient) {
  using Eigen::Index;
  using Eigen::MatrixXd;
  using Eigen::VectorXd;
  const std::vector<std::string> names{"x", "y", "psi", "v", "w", "b", "t"};
  identikal::ModelFormulas formulas;
  formulas.states = 6;
  for (const char* text : {"v*sin(psi)", "v*cos(psi)", "w", "0", "0", "0"}) {
    formulas.dynamics.push_back(identikal::parse_expression(text, names));
  }
  for (const char* text : {"x", "y", "v", "b - w"}) {
    formulas.outputs.push_back(identikal::parse_expression(text, names));
  }
  const identikal::NonlinearModel model =
      identikal::make_nonlinear_model(formulas, identikal::Derivatives::second);
  identikal::ModelMemory memory = identikal::make_memory(model);
  const Index N = 1000;
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, 0.02 * static_cast<double>(N - 1));
  MatrixXd y = MatrixXd::Constant(4, N, std::nan(""));
  for (Index t = 0; t < N; ++t) {
    y(2, t) = 10.0 + 0.1 * std::sin(3.0 * time[t]);
    y(3, t) = -0.1 + 0.01 * std::cos(5.0 * time[t]);
    if (t % 50 == 0) y.col(t).head(2) << 10.0 * time[t], 0.5 * time[t];
  }
  const identikal::InputNodes inputs =
      identikal::input_nodes(time, MatrixXd(0, N), identikal::InputPath::constant, 0.02);
  identikal::FilterNoise noise = identikal::zero_noise(model);
  noise.Q.diagonal() << 0.0, 0.0, 0.0, 1.0, 0.1, 1e-6;
  noise.R.diagonal() << 1.0, 1.0, 0.1, 1e-3;
  noise.P0.diagonal() << 9.0, 9.0, 0.5, 4.0, 0.25, 0.01;
  noise.x0 << 0.0, 0.0, 1.5, 10.0, 0.1, 0.0;
  std::vector<identikal::FilterDirection> directions;
  for (Index i = 0; gradient && i < 6; ++i) {
    directions.push_back({-1, identikal::zero_noise(model)});
    if (i < 3) directions.back().noise.Q(i + 3, i + 3) = 1.0;
    if (i >= 3) directions.back().noise.R(i - 2, i - 2) = 1.0;
  }
  identikal::NonlinearFilterOptions options;
  options.noise = identikal::ProcessNoise::density;
  for (auto _ : state) {
    const identikal::Likelihood l = identikal::nonlinear_likelihood(
        model, memory, VectorXd(0), noise, directions, inputs, y, options);
    if (l.status != identikal::FilterStatus::ok) state.SkipWithError("the filter does not run");
    benchmark::DoNotOptimize(l.value);
  }
  state.counters["seconds_per_sample"] =
      benchmark::Counter(static_cast<double>(state.iterations() * N),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK_CAPTURE(tracker, value, false);
BENCHMARK_CAPTURE(tracker, gradient, true);

BENCHMARK(value_by_hand);
BENCHMARK(value_by_tape);
BENCHMARK(value_by_tape_new_parameters);
BENCHMARK(value_by_tree);
BENCHMARK(jacobian_by_tape);
BENCHMARK(jacobian_by_dual_numbers);

}  // namespace

BENCHMARK_MAIN();
