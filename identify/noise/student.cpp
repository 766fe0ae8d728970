#include "identify/noise/student.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/filter/student_filter.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/gain_by_row.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kStartTurns = 6;  // of expectation maximisation, for a start
constexpr double kMostFreedom = 200.0;
constexpr double kShareHeldOut = 0.3;
constexpr Index kFewestRowsToCompare = 60;
constexpr double kDifference = 1e-5;  // of a coordinate's size

// The maximum of the normal likelihood, weighted or not, from the model's values.
void maximise_normal(Model& normal, const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(normal, recordings);
  if (free_entries(normal.parameters).size() == 0) return;
  if (likelihood.status_at_start() != FilterStatus::ok) return;
  likelihood.weigh_by_priors();
  SolverOptions solver;
  solver.max_iterations = 40;
  const Solution found = maximise(likelihood.problem(), coordinates(normal.parameters), solver);
  if (!std::isfinite(found.summary.objective)) return;
  normal.parameters = with_coordinates(normal.parameters, found.x);
}

// With weights that follow from the values, and values from the weights.
Model weighted_start(const Model& model, const std::vector<Dataset>& recordings) {
  Model normal = normal_model(model);
  const double freedom = degrees_of_freedom(model, model.parameters);
  std::vector<Dataset> weighted = recordings;
  maximise_normal(normal, weighted);
  for (int turn = 0; turn < kStartTurns; ++turn) {
    for (Dataset& recording : weighted) {
      recording.noise_scale = noise_scale_of(expected_squares(normal, recording), freedom);
    }
    maximise_normal(normal, weighted);
  }
  Model out = model;
  for (std::size_t i = 0; i < out.parameters.size(); ++i) {
    out.parameters[i].value = normal.parameters[i].value;
  }
  return out;
}

// The likelihood by the rows of all recordings, in the optimiser's coordinates.
class StudentLikelihood {
 public:
  StudentLikelihood(const Model& model, const std::vector<Dataset>& recordings)
      : model_(model), box_(coordinate_box(model.parameters)) {
    for (const Dataset& recording : recordings) filters_.emplace_back(model_, recording);
    size_ = coordinates(model.parameters).cwiseAbs();
    const double largest = size_.size() > 0 ? size_.maxCoeff() : 0.0;
    for (double& s : size_) {
      if (s == 0.0) s = largest > 0.0 ? largest : 1.0;
    }
  }

  // Log-densities, rows of all recordings; nothing where a filter does not run.
  std::optional<VectorXd> rows(const VectorXd& x) {
    const ParameterSet at = with_coordinates(model_.parameters, x);
    std::vector<VectorXd> parts;
    Index total = 0;
    for (StudentFilter& filter : filters_) {
      StudentRun run = filter.run(at, Keep::innovations);
      if (run.filter.status != FilterStatus::ok) return std::nullopt;
      total += run.log_density.size();
      parts.push_back(std::move(run.log_density));
    }
    VectorXd out(total);
    Index begin = 0;
    for (const VectorXd& part : parts) {
      out.segment(begin, part.size()) = part;
      begin += part.size();
    }
    return out;
  }

  // Rows x coordinates.
  std::optional<MatrixXd> scores(const VectorXd& x) {
    MatrixXd out;
    for (Index i = 0; i < x.size(); ++i) {
      const double step = kDifference * std::max(std::abs(x[i]), 1e-3 * size_[i]);
      VectorXd above = x, below = x;
      above[i] = std::min(x[i] + step, box_.upper[i]);
      below[i] = std::max(x[i] - step, box_.lower[i]);
      const std::optional<VectorXd> up = rows(above), down = rows(below);
      if (!up || !down) return std::nullopt;
      if (i == 0) out.resize(up->size(), x.size());
      out.col(i) = (*up - *down) / (above[i] - below[i]);
    }
    return out;
  }

  LikelihoodProblem problem() {
    LikelihoodProblem out{{}, box_.lower, box_.upper};
    out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
      const PriorTerms prior = stated_priors_at(with_coordinates(model_.parameters, x));
      const std::optional<VectorXd> here = rows(x);
      if (!here || !std::isfinite(prior.value)) return false;
      L = here->sum() + prior.value;
      if (gradient == nullptr) return true;
      const std::optional<MatrixXd> s = scores(x);
      if (!s) return false;
      *gradient = s->colwise().sum().transpose();
      if (prior.gradient.size() > 0) *gradient += prior.gradient;
      if (information == nullptr) return true;
      *information = s->transpose() * *s;
      if (prior.information.size() > 0) information->diagonal() += prior.information;
      return true;
    };
    return out;
  }

 private:
  const Model& model_;
  Box box_;
  VectorXd size_;
  std::vector<StudentFilter> filters_;
};

struct StudentEnd {
  Model model;  // where the search began
  Solution found;
  ParameterSet parameters;  // and where it ended
};

StudentEnd maximise_student(const Model& model, const std::vector<Dataset>& recordings,
                            const NoiseMlOptions& options) {
  StudentEnd out{weighted_start(model, recordings), {}, {}};
  StudentLikelihood likelihood(out.model, recordings);
  SolverOptions solver;
  solver.max_iterations = options.iterations > 0 ? options.iterations : 100;
  solver.decrement_tolerance = 1e-5;
  if (options.progress) {
    solver.progress = [&](int iteration, double L) { return options.progress(1, iteration, L); };
  }
  out.found = maximise(likelihood.problem(), coordinates(out.model.parameters), solver);
  out.parameters = with_coordinates(out.model.parameters, out.found.x);
  return out;
}

// Errors by the entries, in the user's units, from the products of the scores.
void judge(NoiseEstimate& estimate, const StudentEnd& end, const std::vector<Dataset>& recordings) {
  StudentLikelihood likelihood(end.model, recordings);
  const LikelihoodProblem problem = likelihood.problem();
  std::vector<bool> at_bound;
  for (Index i = 0; i < end.found.x.size(); ++i) {
    at_bound.push_back(end.found.x[i] <= problem.lower[i] || end.found.x[i] >= problem.upper[i]);
  }
  const InteriorParameters inside = interior_parameters(estimate, at_bound);
  double L = 0.0;
  VectorXd gradient;
  MatrixXd products;
  if (inside.entries.empty() || !problem.evaluate(end.found.x, L, &gradient, &products)) return;
  const MatrixXd to_coordinates = entry_jacobian(end.parameters, end.found.x).inverse();
  const MatrixXd by_entries = to_coordinates.transpose() * products * to_coordinates;
  const MatrixXd information = inside.unit.asDiagonal() *
                               by_entries(inside.entries, inside.entries) *
                               inside.unit.asDiagonal();
  const std::optional<MatrixXd> inverse = scaled_inverse(information, 1e-9);
  estimate.covariance_kind =
      inverse ? "products of the rows' scores" : "partial: some directions carry no information";
  judge_parameters(
      estimate, information,
      inverse ? *inverse : MatrixXd(information.completeOrthogonalDecomposition().pseudoInverse()));
}

// The mean gain per row held out, and its standard error from blocks of rows.
std::optional<std::pair<double, double>> gain_held_out(const Model& model,
                                                       const std::vector<Dataset>& recordings) {
  std::vector<Dataset> first;
  for (const Dataset& data : recordings) {
    if (data.size() < kFewestRowsToCompare) return std::nullopt;
    const double kept = (1.0 - kShareHeldOut) * static_cast<double>(data.size());
    first.push_back(first_samples(data, static_cast<Index>(std::ceil(kept))));
  }
  const StudentEnd heavy = maximise_student(model, first, {});
  Model normal = normal_model(model);
  maximise_normal(normal, first);
  std::vector<VectorXd> gains;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const StudentRun run = StudentFilter(model, recordings[r]).run(heavy.parameters);
    if (run.filter.status != FilterStatus::ok) return std::nullopt;
    gains.push_back((run.log_density - normal_log_densities(normal, recordings[r]))
                        .tail(recordings[r].size() - first[r].size()));
  }
  const GainByRow gain = gain_by_row(gains);
  if (std::isnan(gain.se)) return std::nullopt;
  return std::pair(gain.mean, gain.se);
}

std::string comparison(double freedom, const std::pair<double, double>& gain) {
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

// Degrees of freedom that are a parameter have an end.
Model with_most_freedom(Model model) {
  if (model.student->parameter < 0) return model;
  Parameter& freedom = model.parameters[static_cast<std::size_t>(model.student->parameter)];
  freedom.min = std::max(freedom.min, 1.0);
  freedom.max = std::min(freedom.max, kMostFreedom);
  return model;
}

void report_student(NoiseEstimate& estimate, const Model& model, const StudentEnd& end,
                    const std::vector<Dataset>& recordings) {
  estimate.excess_mean_square_error = excess_error(estimate, model, end.parameters);
  report_filter(estimate, model, end.parameters, recordings);
  Objective& objective = estimate.objective;
  objective.samples = static_cast<long>(samples_present(recordings));
  const auto k = static_cast<double>(end.found.x.size());
  objective.aic = 2.0 * (k - objective.log_likelihood);
  objective.rows = static_cast<long>(rows_present(recordings));
  const double twice = 2.0 * objective.log_likelihood;
  objective.bic = k * std::log(static_cast<double>(objective.rows)) - twice;
  objective.bic_values = k * std::log(static_cast<double>(objective.samples)) - twice;
  append(estimate.findings, check_innovations(estimate));
  const double freedom = degrees_of_freedom(model, end.parameters);
  estimate.notes.push_back(
      fmt::format("the measurement noise is Student's t with {:.4g} degrees of freedom: R holds "
                  "squared scales, and K is that of normal noise with this R",
                  freedom));
  if (const auto gain = gain_held_out(model, recordings)) {
    estimate.notes.push_back(comparison(freedom, *gain));
  }
}

}  // namespace

NoiseEstimate tune_student(const Model& given, const std::vector<Dataset>& recordings,
                           const NoiseMlOptions& options) {
  refuse_constraints(given, "Student's t");
  if (!given.student) return tune_ml(given, recordings, options);
  const Model model = with_most_freedom(checked(given, recordings));
  check_recordings(model, recordings);
  const StudentEnd end = maximise_student(model, recordings, options);
  const SolverSummary& summary = end.found.summary;
  NoiseEstimate estimate;
  estimate.model_name = model.name;
  list_parameters(estimate, model.parameters, end.parameters);
  Objective& objective = estimate.objective;
  objective.method = "ml";
  objective.iterations = summary.iterations;
  objective.evaluations = summary.evaluations;
  objective.starts = objective.starts_at_optimum = 1;
  StudentLikelihood likelihood(model, recordings);
  const auto start = likelihood.rows(coordinates(model.parameters));
  objective.log_likelihood_start = start ? start->sum() : kNone;
  judge(estimate, end, recordings);
  if (!summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, summary));
  report_student(estimate, model, end, recordings);
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
