#include "identify/black_box/internal/candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/subspace/prediction_error.h"
#include "lib/subspace/simulation_error.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Poles of a simulation that has to stay finite, however long it runs.
constexpr double kStable = 0.9999;
constexpr Index kRowsForState = 50;  // that the first state of a held-out stretch is taken from

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }
double logit(double x) { return std::log(x / (1.0 - x)); }

PredictorPrior prior_of(const VectorXd& x) {
  return {std::exp(x[0]), logistic(x[1]), std::exp(x[2]), logistic(x[3])};
}

// The prior of largest evidence: logarithms of the sizes, logits of the decays.
PredictorPrior likeliest_prior(const PredictorRegression& regression, const PredictorPrior* start) {
  Minimization problem;
  problem.evaluate = [&](const VectorXd& x, double& f, VectorXd*) {
    f = -regression.log_evidence(prior_of(x));
    return std::isfinite(f);
  };
  problem.lower = VectorXd{{-10.0, -4.0, -10.0, -4.0}};
  problem.upper = VectorXd{{40.0, 5.0, 40.0, 5.0}};
  VectorXd from{{2.0, 0.0, 2.0, 0.0}};
  if (start != nullptr) {
    from = VectorXd{{std::log(start->output_size), logit(start->output_decay),
                     std::log(start->input_size), logit(start->input_decay)}};
  }
  SolverOptions options;
  options.max_iterations = start != nullptr ? 60 : 150;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-2;
  return prior_of(
      solve_without_gradient(problem, from.cwiseMax(problem.lower).cwiseMin(problem.upper), options)
          .x);
}

double half_log_determinant(const MatrixXd& V) {
  const Eigen::LLT<MatrixXd> factor(V);
  if (factor.info() != Eigen::Success) return kNan;
  return factor.matrixLLT().diagonal().array().log().sum();
}

// 1 - rms(e)/rms(y), mean over outputs, of all recordings together.
double mean_fit(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& predicted) {
  double sum = 0.0;
  const Index p = y.front().rows();
  for (Index i = 0; i < p; ++i) {
    double left = 0.0, all = 0.0, mean = 0.0, count = 0.0;
    for (const MatrixXd& each : y) {
      for (const double value : each.row(i)) {
        if (std::isfinite(value)) mean += value, ++count;
      }
    }
    mean /= std::max(count, 1.0);
    for (std::size_t k = 0; k < y.size(); ++k) {
      for (Index t = 0; t < y[k].cols(); ++t) {
        const double value = y[k](i, t);
        if (!std::isfinite(value)) continue;
        left += std::pow(value - predicted[k](i, t), 2);
        all += std::pow(value - mean, 2);
      }
    }
    sum += 1.0 - std::sqrt(left / std::max(all, 1e-300));
  }
  return std::isfinite(sum) ? sum / static_cast<double>(p)
                            : -std::numeric_limits<double>::infinity();
}

}  // namespace

Index suitable_lags(const ScaledRecordings& recordings, int most_order) {
  const Index q = recordings.y.front().rows() + recordings.u.front().rows();
  const Index rows = recordings.rows();
  constexpr Index kMostRegressors = 240;
  Index lags = std::max<Index>(20, most_order + 5);
  lags = std::min(
      lags, std::max<Index>(kMostRegressors / q, most_order / recordings.y.front().rows() + 2));
  lags = std::min(lags, rows / (2 * (q + 1)));
  if (lags < 2) {
    throw InputError({}, fmt::format("{} rows are too few for {} channels", rows, q),
                     fmt::format("at least {} rows", 4 * (q + 1)));
  }
  return lags;
}

SubspaceStart subspace_start(const ScaledRecordings& recordings, Index lags,
                             const PredictorPrior* start) {
  LaggedProducts sums = lagged_products(recordings.y, recordings.u, lags);
  const PredictorRegression regression(sums);
  const PredictorPrior prior = likeliest_prior(regression, start);
  Realisation states(sums, regression.estimate(prior));
  return {std::move(sums), prior, std::move(states)};
}

InnovationForm refined(const InnovationForm& start, const LaggedProducts& sums) {
  InnovationForm model = start;
  for (int round = 0; round < 2; ++round) {
    MatrixXd V = prediction_error_covariance(model, sums);
    V.diagonal() += 1e-14 * V.diagonal() + VectorXd::Constant(V.rows(), 1e-300);
    if (!std::isfinite(half_log_determinant(V))) return start;
    const PredictionErrorProblem errors(sums, V);
    LeastSquares problem;
    MatrixXd J;
    problem.evaluate = [&](const VectorXd& theta, VectorXd& r, LeastSquares::RowMatrix* of) {
      if (!errors.evaluate(with_predictor_parameters(model, theta), r,
                           of != nullptr ? &J : nullptr))
        return false;
      if (of != nullptr) *of = J;
      return true;
    };
    const VectorXd theta = predictor_parameters(model);
    problem.residuals = errors.residuals();
    problem.lower.setConstant(theta.size(), -std::numeric_limits<double>::infinity());
    problem.upper = -problem.lower;
    SolverOptions options;
    options.max_iterations = 12;
    options.function_tolerance = 1e-7;
    model = with_predictor_parameters(model, solve(problem, theta, options).x);
    model.sigma = prediction_error_covariance(model, sums);
  }
  // A predictor that grows is none, however well it does over so many lags.
  if (spectral_radius(model.A - model.K * model.C) >= 1.0) return start;
  return half_log_determinant(model.sigma) < half_log_determinant(start.sigma) ? model : start;
}

InnovationForm fitted(const SubspaceStart& start, const ScaledRecordings& recordings, int order,
                      Refinement how, bool stable) {
  InnovationForm model = start.states.model(order);
  if (how == Refinement::prediction_error) model = refined(model, start.sums);
  const bool was_stable = spectral_radius(model.A) <= kStable;
  if (stable) model = with_poles_within(std::move(model), kStable);
  if (recordings.u.front().rows() > 0 &&
      (how == Refinement::simulation || (stable && !was_stable))) {
    model = with_inputs_by_simulation(std::move(model), recordings.y, recordings.u);
  }
  model.sigma = prediction_error_covariance(model, start.sums);
  return model;
}

void judge_on_sums(BlackBoxCandidate& candidate, const LaggedProducts& sums) {
  const auto rows = static_cast<double>(sums.windows), p = static_cast<double>(sums.outputs);
  const double half = half_log_determinant(candidate.model.sigma);
  candidate.log_likelihood = -rows * (half + 0.5 * p * (1.0 + std::log(2.0 * std::numbers::pi)));
  candidate.bic = -2.0 * candidate.log_likelihood +
                  static_cast<double>(free_parameters(candidate.model)) * std::log(rows);
}

void judge_on_held_out(BlackBoxCandidate& candidate, const ScaledRecordings& held_out) {
  std::vector<MatrixXd> simulated, predicted;
  const InnovationForm& model = candidate.model;
  for (std::size_t k = 0; k < held_out.y.size(); ++k) {
    const VectorXd x0 = initial_state(model, held_out.y[k], held_out.u[k], kRowsForState);
    simulated.push_back(simulated_outputs(model, held_out.u[k], x0));
    predicted.push_back(one_step_predictions(model, held_out.y[k], held_out.u[k], x0));
  }
  candidate.prediction = mean_fit(held_out.y, predicted);
  candidate.simulation = model.inputs() > 0 ? mean_fit(held_out.y, simulated) : kNan;
}

}  // namespace identikal
