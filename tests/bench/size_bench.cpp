// What do a fit's length and its model's size cost? Fits of models that integrate from sums that exist, at 1e4 and 1e7 samples;
// then whole fits with errors of many states, outputs and unknowns. Processor seconds.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/filter/simulation.h"
#include "lib/model/linear_model.h"
#include "solvers/scoring.h"
#include "tests/support/random_model.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::string text_of(const MatrixXd& M) {
  std::string out;
  for (Index i = 0; i < M.rows(); ++i) {
    std::string row;
    for (Index j = 0; j < M.cols(); ++j)
      row += fmt::format("{}{:.17g}", j > 0 ? ", " : "", M(i, j));
    out += fmt::format("{}[{}]", i > 0 ? ", " : "", row);
  }
  return "[" + out + "]";
}

// Variances q1, ... of the process, r1, ... of the outputs, or all of R at once.
Model model_of(const MatrixXd& A, const MatrixXd& G, const MatrixXd& C, const VectorXd& q,
               const VectorXd& r, bool full, const std::string& initial) {
  std::string parameters, outputs;
  const auto diagonal = [&](const char* name, const VectorXd& values) {
    std::string out;
    for (Index i = 0; i < values.size(); ++i) {
      parameters += fmt::format("  {}{}: {{value: {:.17g}, min: 0}}\n", name, i, values[i]);
      std::string row;
      for (Index j = 0; j < values.size(); ++j) {
        row += (j > 0 ? ", " : "") + (i == j ? fmt::format("{}{}", name, i) : std::string("0"));
      }
      out += fmt::format("{}[{}]", i > 0 ? ", " : "", row);
    }
    return "[" + out + "]";
  };
  const std::string Q = diagonal("q", q);
  std::string R;
  if (full) {
    R = fmt::format("{{structure: full, start: {}}}", text_of(r.asDiagonal().toDenseMatrix()));
  } else {
    R = diagonal("r", r);
  }
  for (Index i = 0; i < C.rows(); ++i) {
    outputs += fmt::format("{}{{name: y{}, column: y{}}}", i > 0 ? ", " : "", i + 1, i + 1);
  }
  return parse_model_file(
      fmt::format(
          "identikal: 1\nname: sizes\nparameters:\n{}time: {{step: 1 s}}\nA: {}\nG: {}\nC: {}\n"
          "Q: {}\nR: {}\ninitial: {}\noutputs: [{}]\n",
          parameters, text_of(A), text_of(G), text_of(C), Q, R, initial, outputs),
      "sizes");
}

Dataset simulated(const Model& model, InitialState initial, Index samples) {
  Random random(1);
  const StateSpace system = instantiate(as_linear(model), model.parameters);
  return dataset_of(simulate_outputs(system, initial, MatrixXd(0, samples), samples, random));
}

// Milliseconds of a fit whose sums exist.
double fit_after_sums(const Model& truth, const Model& start, Index samples) {
  const std::vector<Dataset> data{simulated(truth, InitialState::diffuse, samples)};
  RecordingsLikelihood prepared(start, data);
  const VectorXd from = coordinates(start.parameters);
  maximise(prepared.problem(), from, {});
  double least = 1e9;
  Solution end;
  for (int k = 0; k < 20; ++k) {
    const double begin = now();
    end = maximise(prepared.problem(), from, {});
    least = std::min(least, 1e3 * (now() - begin));
  }
  std::printf("  N %9td: %.3f ms, %d evaluations, %s\n", samples, least, end.summary.evaluations,
              to_string(prepared.evaluation_taken().method));
  return least;
}

void compare_lengths(const char* name, const MatrixXd& A, const MatrixXd& G, const MatrixXd& C,
                     const VectorXd& q, const VectorXd& r) {
  std::printf("%s\n", name);
  const Model truth = model_of(A, G, C, q, r, false, "diffuse");
  const Model start = model_of(A, G, C, 3.0 * q, 0.5 * r, false, "diffuse");
  const double brief = fit_after_sums(truth, start, 10000);
  const double lasting = fit_after_sums(truth, start, 10000000);
  std::printf("  ratio %.2f\n", lasting / brief);
}

void fit_large(const char* name, Index states, Index noises, Index outputs, bool full,
               Index samples) {
  Random random(1);
  MatrixXd A = random_matrix(random, states, states);
  A *= 0.9 / A.eigenvalues().cwiseAbs().maxCoeff();
  const MatrixXd G = random_matrix(random, states, noises);
  const MatrixXd C = random_matrix(random, outputs, states);
  const VectorXd q = VectorXd::LinSpaced(noises, 1.0, 10.0);
  const VectorXd r = VectorXd::LinSpaced(outputs, 100.0, 400.0);
  const Model truth = model_of(A, G, C, q, r, full, "stationary");
  const Model start = model_of(A, G, C, VectorXd::Constant(noises, 5.0),
                               VectorXd::Constant(outputs, 300.0), full, "stationary");
  const std::vector<Dataset> data{simulated(truth, InitialState::stationary, samples)};
  const double begin = now();
  const NoiseEstimate estimate = tune_ml(start, data);
  const auto without = std::count_if(estimate.parameters.begin(), estimate.parameters.end(),
                                     [](const auto& p) { return !(p.se > 0.0); });
  std::printf("%s: %.2f s, %zu unknowns, %td without error, %d evaluations, %s: %s\n", name,
              now() - begin, estimate.parameters.size(), without, estimate.objective.evaluations,
              to_string(estimate.status).c_str(), estimate.message.c_str());
}

}  // namespace
}  // namespace identikal

int main() {
  using namespace identikal;
  using Eigen::VectorXd;
  const MatrixXd one{{1.0}}, ramp{{1, 1}, {0, 1}}, first{{1, 0}};
  compare_lengths("local level", one, one, one, VectorXd{{0.1}}, VectorXd{{1.0}});
  compare_lengths("local linear trend", ramp, MatrixXd::Identity(2, 2), first,
                  VectorXd{{0.1, 0.01}}, VectorXd{{1.0}});
  compare_lengths("constant velocity", ramp, MatrixXd{{0.5}, {1.0}}, first, VectorXd{{0.01}},
                  VectorXd{{1.0}});
  fit_large("30 states, 3 outputs, N 100,000", 30, 10, 3, false, 100000);
  fit_large("50 states, 10 outputs, R full, N 20,000", 50, 10, 10, true, 20000);
}
