// How long does a likelihood take, with and without gradient and information, and a fit? By every
// method, as a fraction of what the machine can do. tests/bench/README.md says how to repeat it.
#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include <benchmark/benchmark.h>

#include "identify/filter/recordings_likelihood.h"
#include "lib/data/csv.h"
#include "lib/filter/internal/segment_autocovariances.h"
#include "tests/bench/roof.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/random_model.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Systems 1, 6 and 7, and 0: six states, three outputs.
MatiskoSystem system_of(int number) {
  if (number != 0) return matisko_system(number);
  Random random(6);
  const StateSpace m = random_model(random, 6, 0, 3, 6);
  MatiskoSystem out = matisko_system(7);
  LinearModel& linear = as_linear(out.model);
  linear.A.constant = m.A;
  linear.B.constant = m.B;
  linear.C.constant = m.C;
  linear.D.constant = m.D;
  linear.G.constant = MatrixXd::Identity(6, 6);
  linear.S.constant = MatrixXd::Zero(6, 3);
  out.model.parameters[0].value = MatrixXd::Identity(6, 6);
  out.model.parameters[1].value = MatrixXd::Identity(3, 3);
  out.truth = VectorXd::LinSpaced(9, 0.5, 2.0);
  out.number = 0;
  return out;
}

const char* label(int number) {
  return number == 0 ? "n6r3" : number == 1 ? "sys1" : number == 6 ? "sys6" : "sys7";
}

// Recordings of a folder, N = 0; else simulated.
std::string files;

MatrixXd read_recording(int number) {
  const Table table = read_csv(files + "/" + label(number) + ".csv");
  MatrixXd y(static_cast<Index>(table.columns.size()), static_cast<Index>(table.rows));
  for (Index i = 0; i < y.rows(); ++i) {
    y.row(i) = Eigen::Map<const Eigen::RowVectorXd>(
        table.columns[static_cast<std::size_t>(i)].values.data(), y.cols());
  }
  return y;
}

const MatrixXd& recording(int number, Index N) {
  static std::map<std::pair<int, Index>, MatrixXd> all;
  const auto [at, fresh] = all.try_emplace({number, N});
  if (fresh && N == 0) {
    at->second = read_recording(number);
  } else if (fresh) {
    MatiskoSystem system = system_of(number);
    system.samples = N;
    Random random(static_cast<std::uint64_t>(100 + number));
    at->second = simulate_matisko(system, random);
  }
  return at->second;
}

// Multiply-adds per sample of a filter with constant gain that only sums its innovations' squares.
double floor_per_sample(const StateSpace& m) {
  const auto n = static_cast<double>(m.states()), r = static_cast<double>(m.outputs());
  return 2.0 * (n * n + 2.0 * n * r + r * (r + 1.0) / 2.0);
}

double roof() {
  static const double value = fma_roof();
  return value;
}

void evaluate(benchmark::State& state, int number, Index N, EvaluationMethod method,
              bool derivatives) {
  const MatiskoSystem system = system_of(number);
  const MatrixXd &y = recording(number, N), u(0, y.cols());
  const StateSpace m = true_system(system);
  const auto d = derivatives ? model_derivatives(as_linear(system.model), system.model.parameters)
                             : std::vector<StateSpace>{};
  LikelihoodEngine engine;
  engine.add_recording(y, u);
  engine.evaluate(m, InitialState::stationary, d, method);
  if (engine.evaluation_taken().method != method) state.SkipWithError("another method ran");
  for (auto _ : state) {
    benchmark::DoNotOptimize(engine.evaluate(m, InitialState::stationary, d, method).value);
  }
  const auto samples = static_cast<double>(y.cols());
  state.counters["ns_per_sample"] = benchmark::Counter(
      samples * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  if (method == EvaluationMethod::steady_state && !derivatives) {
    state.counters["of_fma_roof"] = benchmark::Counter(
        samples * floor_per_sample(m) / roof(), benchmark::Counter::kIsIterationInvariantRate);
  }
}

// From a recording in memory to the maximum: sums included, or, with_sums = false, prepared before.
void fit(benchmark::State& state, int number, Index N, bool with_sums) {
  const MatiskoSystem system = system_of(number);
  const std::vector<Dataset> data{dataset_of(recording(number, N))};
  SolverOptions options;
  options.decrement_tolerance = 1e-12;
  const VectorXd start = coordinates(system.model.parameters);
  RecordingsLikelihood prepared(system.model, data);
  maximise(prepared.problem(), start, options);
  int evaluations = 0;
  for (auto _ : state) {
    if (with_sums) {
      RecordingsLikelihood fresh(system.model, data);
      evaluations = maximise(fresh.problem(), start, options).summary.evaluations;
    } else {
      evaluations = maximise(prepared.problem(), start, options).summary.evaluations;
    }
  }
  state.counters["evaluations"] = evaluations;
}

void segment_autocovariances(benchmark::State& state, int channels, Index N, Index lags) {
  Random random(1);
  const MatrixXd z = random_matrix(random, channels, N);
  for (auto _ : state) {
    state.PauseTiming();
    SegmentAutocovariances sums(z);
    state.ResumeTiming();
    sums.extend_to(lags);
    benchmark::DoNotOptimize(sums.at(0).data());
  }
  const double operations = 2.0 * static_cast<double>(channels * channels * lags) *
                            (static_cast<double>(N) - 0.5 * static_cast<double>(lags));
  state.counters["of_fma_roof"] =
      benchmark::Counter(operations / roof(), benchmark::Counter::kIsIterationInvariantRate);
}

void register_files() {
  for (const int number : {1, 6, 7}) {
    const std::string name = label(number);
    benchmark::RegisterBenchmark(("file/fit/" + name).c_str(), [=](benchmark::State& state) {
      fit(state, number, 0, true);
    })->Unit(benchmark::kMicrosecond);
    benchmark::RegisterBenchmark(("file/value/" + name).c_str(), [=](benchmark::State& state) {
      evaluate(state, number, 0, EvaluationMethod::autocovariances, false);
    })->Unit(benchmark::kMicrosecond);
  }
}

void register_all() {
  const auto named = [](const std::string& name, auto&& run) {
    return benchmark::RegisterBenchmark(name.c_str(), run);
  };
  for (const int number : {1, 6, 7, 0}) {
    for (const Index N : {1000L, 10000L, 100000L, 1000000L, 10000000L}) {
      const std::string at = std::string(label(number)) + "/N:" + std::to_string(N);
      for (const EvaluationMethod method :
           {EvaluationMethod::time_varying, EvaluationMethod::steady_state,
            EvaluationMethod::autocovariances}) {
        if (method == EvaluationMethod::time_varying && N > 100000)
          continue;  // its cost is proportional to N
        for (const bool derivatives : {false, true}) {
          const std::string what = derivatives ? "all/" : "value/";
          named(what + to_string(method) + "/" + at, [=](benchmark::State& state) {
            evaluate(state, number, N, method, derivatives);
          })->Unit(benchmark::kMicrosecond);
        }
      }
      for (const bool sums : {true, false}) {
        named(std::string(sums ? "fit/" : "fit_after_sums/") + at, [=](benchmark::State& state) {
          fit(state, number, N, sums);
        })->Unit(benchmark::kMillisecond);
      }
    }
  }
  for (const int channels : {1, 2, 3, 4}) {
    for (const Index N : {3000L, 100000L}) {
      named("autocovariances/channels:" + std::to_string(channels) + "/N:" + std::to_string(N) +
                "/lags:64",
            [=](benchmark::State& state) { segment_autocovariances(state, channels, N, 64); })
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

}  // namespace
}  // namespace identikal

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (const std::string last = argv[argc - 1]; last.starts_with("--files=")) {
    identikal::files = last.substr(8);
    --argc;
  }
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", identikal::fma_roof() * 1e-9);
  benchmark::AddCustomContext("fma_roof_gflop_per_s", text);
  std::snprintf(text, sizeof text, "%.4g", identikal::copy_roof() * 1e-9);
  benchmark::AddCustomContext("copy_roof_gb_per_s", text);
  if (identikal::files.empty()) {
    identikal::register_all();
  } else {
    identikal::register_files();
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
