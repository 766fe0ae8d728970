#include "identify/noise/student.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostTurns = 100;
constexpr double kTurnsAgree = 1e-4;  // of every value
constexpr double kFewestFreedom = 1.0, kMostFreedom = 200.0;
constexpr double kShareHeldOut = 0.3;
constexpr Index kFewestRowsToCompare = 60;

// psi(x), x > 0: up to x = 6 by psi(x + 1) = psi(x) + 1/x, then its asymptotic series.
double digamma(double x) {
  double out = 0.0;
  for (; x < 6.0; x += 1.0) out -= 1.0 / x;
  const double s = 1.0 / (x * x);
  return out + std::log(x) - 0.5 / x - s * (1.0 / 12 - s * (1.0 / 120 - s / 252));
}

// The likeliest degrees of freedom, weights being what they are at the present ones.
double likeliest_freedom(const std::vector<MatrixXd>& squares, double freedom) {
  const double a = 0.5 * (freedom + 1.0);
  double sum = 0.0, count = 0.0;
  for (const MatrixXd& each : squares) {
    for (const double square : each.reshaped()) {
      if (!std::isfinite(square)) continue;
      const double b = 0.5 * (freedom + square);
      sum += digamma(a) - std::log(b) - a / b;
      count += 1.0;
    }
  }
  if (count == 0.0) return freedom;
  const auto slope = [&](double nu) {
    return std::log(0.5 * nu) + 1.0 - digamma(0.5 * nu) + sum / count;
  };
  double low = kFewestFreedom, high = kMostFreedom;
  if (!(slope(low) > 0.0)) return low;
  if (!(slope(high) < 0.0)) return high;
  while (high > 1.0001 * low) {
    const double middle = std::sqrt(low * high);
    (slope(middle) > 0.0 ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

struct StudentFit {
  Model model;  // normal_model(), at the values found
  double freedom = 4.0;
  std::vector<Dataset> weighted;
  double objective = kNone;  // of the last maximum
  bool settled = false;
};

// The maximum with the weights as they are, from the present values; false where there is none.
bool maximise_weighted(StudentFit& fit) {
  RecordingsLikelihood likelihood(fit.model, fit.weighted);
  if (likelihood.status_at_start() != FilterStatus::ok) return false;
  likelihood.weigh_by_priors();
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-6;
  const Solution found = maximise(likelihood.problem(), coordinates(fit.model.parameters), solver);
  if (!std::isfinite(found.summary.objective)) return false;
  fit.model.parameters = with_coordinates(fit.model.parameters, found.x);
  fit.objective = found.summary.objective;
  return true;
}

void weigh(StudentFit& fit, bool free) {
  std::vector<MatrixXd> squares;
  for (Dataset& recording : fit.weighted) {
    squares.push_back(expected_squares(fit.model, recording));
    recording.noise_scale = noise_scale_of(squares.back(), fit.freedom);
  }
  if (free) fit.freedom = likeliest_freedom(squares, fit.freedom);
}

bool is_free(const Model& model) {
  const int parameter = model.student->parameter;
  return parameter >= 0 && !model.parameters[static_cast<std::size_t>(parameter)].fixed;
}

StudentFit fit_student(const Model& model, const std::vector<Dataset>& recordings,
                       const NoiseMlOptions& options) {
  StudentFit fit{normal_model(model), degrees_of_freedom(model), recordings};
  if (free_entries(fit.model.parameters).size() == 0) {
    weigh(fit, is_free(model));
    return fit;
  }
  maximise_weighted(fit);
  for (int turn = 0; turn < kMostTurns && !fit.settled; ++turn) {
    const VectorXd before = free_entries(fit.model.parameters);
    const double freedom_before = fit.freedom;
    weigh(fit, is_free(model));
    if (!maximise_weighted(fit)) break;
    const VectorXd moved = (free_entries(fit.model.parameters) - before).cwiseAbs();
    const double small = 1e-12 * before.cwiseAbs().maxCoeff();
    fit.settled = (moved.array() <= kTurnsAgree * before.array().abs() + small).all() &&
                  std::abs(1.0 / fit.freedom - 1.0 / freedom_before) <= kTurnsAgree;
    if (options.progress && !options.progress(1, turn + 1, fit.objective)) break;
  }
  return fit;
}

// With weights that know no later sample.
std::vector<Dataset> weighted_up_to_now(const Model& model, const StudentFit& fit,
                                        const std::vector<Dataset>& recordings) {
  Model at = model;
  at.student = StudentNoise{fit.freedom};
  at.parameters = fit.model.parameters;
  return student_weighted(at, recordings);
}

double log_likelihood_of(const Model& model, const StudentFit& fit,
                         const std::vector<Dataset>& recordings) {
  double out = 0.0;
  for (const Dataset& data : weighted_up_to_now(model, fit, recordings)) {
    out += student_log_densities(fit.model, fit.freedom, data).sum();
  }
  return out;
}

// The mean gain per row held out, and its standard error from blocks of rows.
std::optional<std::pair<double, double>> gain_held_out(const Model& model,
                                                       const std::vector<Dataset>& recordings,
                                                       const NoiseMlOptions& options) {
  constexpr Index kBlocks = 10;
  std::vector<Dataset> first;
  for (const Dataset& data : recordings) {
    if (data.size() < kFewestRowsToCompare) return std::nullopt;
    first.push_back(first_samples(
        data,
        static_cast<Index>(std::ceil((1.0 - kShareHeldOut) * static_cast<double>(data.size())))));
  }
  const StudentFit heavy = fit_student(model, first, options);
  StudentFit normal{normal_model(model), kInfinity, first};
  if (!maximise_weighted(normal)) return std::nullopt;
  const std::vector<Dataset> weighted = weighted_up_to_now(model, heavy, recordings);
  std::vector<double> blocks;
  double sum = 0.0, rows = 0.0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const VectorXd gain = (student_log_densities(heavy.model, heavy.freedom, weighted[r]) -
                           normal_log_densities(normal.model, recordings[r]))
                              .tail(recordings[r].size() - first[r].size());
    sum += gain.sum();
    rows += static_cast<double>(gain.size());
    const Index length = std::max<Index>(1, gain.size() / kBlocks);
    for (Index at = 0; at + length <= gain.size(); at += length) {
      blocks.push_back(gain.segment(at, length).mean());
    }
  }
  const double mean = sum / rows;
  double squares = 0.0;
  for (const double block : blocks) squares += (block - mean) * (block - mean);
  const auto count = static_cast<double>(blocks.size());
  if (count < 2.0) return std::nullopt;
  return std::pair(mean, std::sqrt(squares / (count - 1.0) / count));
}

std::string in_words(double freedom, const std::pair<double, double>& gain) {
  constexpr double kErrors = 2.0;
  const auto& [mean, se] = gain;
  return fmt::format(
      "on the last {:.0f} % of each recording, both fitted to the rest, Student's t "
      "with {:.3g} degrees of freedom predicts {} than a normal distribution: {:+.3g} "
      "+- {:.2g} nats per row",
      100.0 * kShareHeldOut, freedom,
      mean > kErrors * se    ? "better"
      : mean < -kErrors * se ? "worse"
                             : "no better, beyond chance,",
      mean, se);
}

}  // namespace

NoiseEstimate tune_student(const Model& given, const std::vector<Dataset>& recordings,
                           const NoiseMlOptions& options) {
  const Model model = checked(given, recordings);
  if (!model.student) return tune_ml(model, recordings, options);
  check_recordings(normal_model(model), recordings);
  const bool free = is_free(model);
  StudentFit start{normal_model(model), degrees_of_freedom(model), recordings};
  const double at_start = log_likelihood_of(model, start, recordings);
  const StudentFit fit = fit_student(model, recordings, options);
  NoiseEstimate estimate = tune_ml(fit.model, fit.weighted, options);
  Objective& objective = estimate.objective;
  const double L = log_likelihood_of(model, fit, recordings);
  const double more = free ? 1.0 : 0.0;  // unknown beside the parameters that have errors
  objective.aic += 2.0 * (objective.log_likelihood - L + more);
  objective.bic += 2.0 * (objective.log_likelihood - L) +
                   more * std::log(static_cast<double>(objective.samples));
  objective.log_likelihood = L;
  objective.log_likelihood_start = at_start;
  if (is_linear(model)) {
    Model nominal = model;
    nominal.parameters = fit.model.parameters;
    static_cast<FilterMatrices&>(estimate) = filter_matrices(nominal, nominal.parameters);
    objective.filter.clear();
  }
  if (free) {
    const std::string& name =
        model.parameters[static_cast<std::size_t>(model.student->parameter)].name;
    for (EstimatedParameter& p : estimate.parameters) {
      if (p.name == name) p.value = fit.freedom;
    }
    estimate.notes.push_back(
        fmt::format("{} = {:.4g}: the likeliest degrees of freedom", name, fit.freedom));
  }
  estimate.notes.push_back(
      fmt::format("the measurement noise is Student's t with {:.4g} degrees of freedom: R holds "
                  "squared scales, K is that of samples of weight 1, and errors and tests take the "
                  "samples' weights as known",
                  fit.freedom));
  if (const auto gain = gain_held_out(model, recordings, options)) {
    estimate.notes.push_back(in_words(fit.freedom, *gain));
  }
  if (!fit.settled) {
    estimate.findings.push_back(
        make_finding(FindingCode::not_converged, {},
                     fmt::format("weights and values have not settled in {} turns", kMostTurns)));
    conclude(estimate, "converged");
  }
  return estimate;
}

}  // namespace identikal
