#include "identify/noise/steps_ahead.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/predicted_motion.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/model/noise_entries.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/coloured_errors.h"
#include "lib/base/nearest_turn.h"
#include "lib/data/units.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Errors of one recording, of each output, NaN where there is none.
struct ErrorsAhead {
  MatrixXd e;                    // ny x N
  std::vector<MatrixXd> slopes;  // per output, N x k
};

// Errors K steps ahead of all recordings, by the free entries of a model.
class PredictionAhead {
 public:
  PredictionAhead(const Model& model, const std::vector<Dataset>& recordings, int steps)
      : model_(model), recordings_(recordings), steps_(steps), likelihood_(model, recordings) {
    for (const Dataset& data : recordings) {
      motions_.push_back(std::make_unique<PredictedMotion>(model, data));
    }
  }

  // @return false where a filter does not run or a prediction is not finite
  bool evaluate(const ParameterSet& at, std::vector<ErrorsAhead>& out) {
    out.resize(recordings_.size());
    for (std::size_t r = 0; r < recordings_.size(); ++r) {
      if (!errors_of(at, r, out[r])) return false;
    }
    return true;
  }

 private:
  bool errors_of(const ParameterSet& at, std::size_t r, ErrorsAhead& out) {
    const Dataset& data = recordings_[r];
    const Index N = data.size(), ny = data.y.rows(), k = free_entries(at).size();
    out.e = MatrixXd::Constant(ny, N, std::numeric_limits<double>::quiet_NaN());
    out.slopes.assign(static_cast<std::size_t>(ny), MatrixXd::Zero(N, k));
    PredictedMotion& motion = *motions_[r];
    motion.set(at);
    bool finite = true;
    VectorXd x, y;
    MatrixXd dx, dy;
    const FilterStatus status = likelihood_.watch(at, true, r, [&](const FilteredState& seen) {
      const Index to = seen.t + steps_;
      if (!finite || to >= N || !seen.x.allFinite()) return;
      x = seen.x;
      dx = seen.dx;
      for (Index t = seen.t; t < to; ++t) motion.move(t, x, dx);
      motion.observe(to, x, dx, y, dy);
      finite = y.allFinite() && dy.allFinite();
      for (Index j = 0; finite && j < ny; ++j) take_error(data, j, to, y[j], dy.row(j), out);
    });
    return status == FilterStatus::ok && finite;
  }

  void take_error(const Dataset& data, Index j, Index t, double predicted,
                  const Eigen::RowVectorXd& slope, ErrorsAhead& out) const {
    if (std::isnan(data.y(j, t))) return;
    double e = data.y(j, t) - predicted;
    if (model_.outputs[static_cast<std::size_t>(j)].wraps) e = nearest_turn(e);
    out.e(j, t) = e;
    out.slopes[static_cast<std::size_t>(j)].row(t) = -slope;
  }

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  int steps_;
  RecordingsLikelihood likelihood_;
  std::vector<std::unique_ptr<PredictedMotion>> motions_;
};

// Mean squares of each output.
VectorXd mean_squares(const std::vector<ErrorsAhead>& all, VectorXd& count) {
  VectorXd squares = VectorXd::Zero(all[0].e.rows());
  count = squares;
  for (const ErrorsAhead& one : all) {
    for (Index j = 0; j < squares.size(); ++j) {
      for (const double e : one.e.row(j)) {
        if (std::isnan(e)) continue;
        squares[j] += e * e;
        count[j] += 1.0;
      }
    }
  }
  return squares.cwiseQuotient(count.cwiseMax(1.0));
}

// sum J'J / s^2 and -sum J'e / s^2 of what is there.
void add_normal_equations(const ErrorsAhead& one, const VectorXd& variance, MatrixXd& information,
                          VectorXd& gradient) {
  for (Index j = 0; j < one.e.rows(); ++j) {
    const MatrixXd& J = one.slopes[static_cast<std::size_t>(j)];
    const VectorXd e = one.e.row(j).array().isNaN().select(0.0, one.e.row(j)).transpose();
    information += J.transpose() * J / variance[j];
    gradient -= J.transpose() * e / variance[j];
  }
}

LikelihoodProblem problem_ahead(PredictionAhead& ahead, const Model& model) {
  LikelihoodProblem out;
  const Box box = coordinate_box(model.parameters);
  out.lower = box.lower;
  out.upper = box.upper;
  out.evaluate = [&](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    std::vector<ErrorsAhead> errors;
    if (!ahead.evaluate(with_coordinates(model.parameters, x), errors)) return false;
    VectorXd count;
    const VectorXd variance = mean_squares(errors, count);
    if (!(variance.minCoeff() > 0.0)) return false;
    L = -0.5 * count.dot(VectorXd(variance.array().log()));
    MatrixXd I = MatrixXd::Zero(x.size(), x.size());
    VectorXd g = VectorXd::Zero(x.size());
    for (const ErrorsAhead& one : errors) add_normal_equations(one, variance, I, g);
    if (gradient != nullptr) *gradient = g;
    if (information != nullptr) *information = I;
    return true;
  };
  return out;
}

// The model with its noise as it is: what changes only that predicts nothing by itself.
Model with_known_noise(Model model) {
  const std::vector<EntryDerivative> entries = entry_derivatives(model.parameters);
  const std::vector<bool> noise = entries_of_noise(model);
  for (std::size_t e = 0; e < entries.size(); ++e) {
    if (noise[e]) model.parameters[static_cast<std::size_t>(entries[e].parameter)].fixed = true;
  }
  return model;
}

void check_model(const Model& model, const std::vector<Dataset>& recordings, int steps) {
  refuse_constraints(model, "--objective " + steps_ahead_method(steps));
  const auto refuse = [&](const std::string& what, const std::string& expected) {
    throw InputError({model.source, 0, 0},
                     fmt::format("--objective {} with {}", steps_ahead_method(steps), what),
                     expected);
  };
  if (!names_with_priors(model.parameters).empty()) refuse("a prior", "no prior");
  if (changes(model))
    refuse("matrices that change from sample to sample",
           "a linear model, or formulas that are not");
  if (model.student) refuse("Student's t", "normal noise");
  if (!model.recordings.empty())
    refuse("parameters with values of their own", "one model of all recordings");
  if (is_linear(model) && !instantiate(as_linear(model), model.parameters).S.isZero(0.0)) {
    refuse("S", "process noise that is independent of the sensors'");
  }
  for (const Dataset& data : recordings) {
    if (data.size() > steps) continue;
    throw InputError({data.name, 0, 0},
                     fmt::format("{} rows to predict {} ahead", data.size(), steps),
                     "more rows, or fewer steps");
  }
}

// Errors of what was searched for; the likelihood's stand of the noise.
void report_errors(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                   const std::vector<ErrorsAhead>& errors) {
  VectorXd count;
  const VectorXd variance = mean_squares(errors, count);
  const Index k = free_entries(end).size();
  MatrixXd information = MatrixXd::Zero(k, k);
  VectorXd gradient = VectorXd::Zero(k);
  Index N = 0;
  for (const ErrorsAhead& one : errors) {
    add_normal_equations(one, variance, information, gradient);
    N += one.e.cols();
  }
  SimulationScore score;
  score.by_sample = MatrixXd::Zero(k, N);
  Index at = 0;
  for (const ErrorsAhead& one : errors) {
    for (Index t = 0; t < one.e.cols(); ++t, ++at) {
      for (Index j = 0; j < one.e.rows(); ++j) {
        if (std::isnan(one.e(j, t))) continue;
        score.by_sample.col(at) -=
            one.e(j, t) / variance[j] * one.slopes[static_cast<std::size_t>(j)].row(t).transpose();
      }
    }
  }
  const VectorXd x = coordinates(end);
  const Box box = coordinate_box(model.parameters);
  std::vector<bool> at_bound;
  for (Index i = 0; i < k; ++i) at_bound.push_back(x[i] <= box.lower[i] || x[i] >= box.upper[i]);
  const InteriorParameters inside = interior_parameters(estimate, at_bound);
  const MatrixXd inner = information(inside.entries, inside.entries);
  const auto white = scaled_inverse(inner);
  const VectorXd to_unit = inside.unit.cwiseInverse();
  double quantile = 1.959963984540054;
  MatrixXd covariance = MatrixXd::Zero(inner.rows(), inner.cols());
  if (white) {
    score.by_sample = MatrixXd(score.by_sample(inside.entries, Eigen::all));
    score.by_autoregression = MatrixXd::Zero(inner.rows(), inner.cols());
    const ColouredCovariance coloured =
        coloured_covariance(*white, score, MatrixXd::Identity(inner.rows(), inner.cols()));
    covariance = coloured.covariance;
    quantile = student_t_quantile(0.975, coloured.freedom);
    estimate.covariance_freedom = coloured.freedom;
    estimate.covariance_kind = fmt::format(
        "predictions, errors correlated over {} samples allowed for", coloured.bandwidth);
  }
  judge_parameters(estimate, inside.unit.asDiagonal() * inner * inside.unit.asDiagonal(),
                   to_unit.asDiagonal() * covariance * to_unit.asDiagonal(), quantile);
}

// Colour one step ahead is what somebody accepts who looks further.
void accept_colour(Findings& findings) {
  for (Finding& finding : findings) {
    const bool colour = finding.code == FindingCode::coloured_innovations ||
                        finding.code == FindingCode::input_in_innovations;
    if (colour && finding.severity == Severity::serious) finding.severity = Severity::warning;
  }
}

void report_predictions(NoiseEstimate& estimate, const std::vector<Channel>& outputs, int steps,
                        const VectorXd& likeliest, const VectorXd& reached) {
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const double unit = unit_scale(outputs[j].unit);
    const auto i = static_cast<Index>(j);
    estimate.derived.push_back({fmt::format("rmse of {}, {} steps ahead", outputs[j].name, steps),
                                outputs[j].unit, std::sqrt(reached[i]) / unit, kNone});
    estimate.derived.push_back(
        {fmt::format("rmse of {}, by the likelihood's values", outputs[j].name), outputs[j].unit,
         std::sqrt(likeliest[i]) / unit, kNone});
  }
}

}  // namespace

std::string steps_ahead_method(int steps) { return fmt::format("{}-step", steps); }

int steps_in(const std::string& method) {
  constexpr std::string_view kBehind = "-step";
  if (method.size() <= kBehind.size() || method.size() > 10 || !method.ends_with(kBehind)) return 0;
  const std::string number = method.substr(0, method.size() - kBehind.size());
  const bool digits =
      std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
  return digits ? std::stoi(number) : 0;
}

NoiseEstimate fit_steps_ahead(const Model& given, const std::vector<Dataset>& recordings, int steps,
                              const NoiseMlOptions& options) {
  if (steps < 2)
    throw std::invalid_argument(fmt::format("{} steps ahead; expected 2 or more", steps));
  check_model(given, recordings, steps);
  NoiseMlOptions first = options;
  first.profiles = first.pictures = false;
  const NoiseEstimate likeliest = tune_ml(given, recordings, first);
  Model model = checked(given, recordings);
  model.parameters = parameters_of(likeliest, model.parameters);
  const Model known = with_known_noise(model);
  PredictionAhead ahead(known, recordings, steps);
  const LikelihoodProblem problem = problem_ahead(ahead, known);
  const VectorXd start = coordinates(known.parameters);
  if (start.size() == 0) {
    throw InputError({model.source, 0, 0}, "nothing but noise is free",
                     "a parameter that moves or shows the states", "'tune' estimates noise");
  }
  std::vector<ErrorsAhead> errors;
  VectorXd count;
  const bool begun = ahead.evaluate(known.parameters, errors);
  const VectorXd before = begun ? mean_squares(errors, count) : VectorXd();
  SolverOptions solver;
  if (options.iterations > 0) solver.max_iterations = options.iterations;
  solver.progress = [&](int iteration, double L) {
    return !options.progress || options.progress(0, iteration, L);
  };
  const Solution found = maximise(problem, start, solver);
  const ParameterSet end = with_coordinates(known.parameters, found.x);

  NoiseEstimate estimate;
  estimate.model_name = model.name;
  estimate.objective.method = steps_ahead_method(steps);
  list_parameters(estimate, given.parameters, end);
  if (!begun || !ahead.evaluate(end, errors)) {
    append(estimate.findings, check_search(estimate, found.summary));
    conclude(estimate, "");
    return estimate;
  }
  for (EstimatedParameter& p : estimate.parameters) {
    const int at = find_parameter(known.parameters, p.name);
    if (at >= 0 && known.parameters[static_cast<std::size_t>(at)].fixed) p.fixed = true;
  }
  estimate.objective.iterations = found.summary.iterations;
  estimate.objective.evaluations = found.summary.evaluations;
  report_errors(estimate, known, end, errors);
  if (!found.summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.summary));
  report_noise_estimate(estimate, known, end, recordings);
  accept_colour(estimate.findings);
  report_predictions(estimate, recordings[0].outputs, steps, before, mean_squares(errors, count));
  estimate.notes.push_back("noise as the likelihood has it; what moves the states by predictions");
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
