#include "identify/black_box/internal/candidates.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/black_box/internal/likeliest_prior.h"
#include "identify/black_box/internal/predictor_memory.h"
#include "lib/base/error.h"
#include "lib/filter/steady_state.h"
#include "lib/subspace/prediction_error.h"
#include "lib/subspace/simulation_error.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double half_log_determinant(const MatrixXd& V) {
  const Eigen::LLT<MatrixXd> factor(V);
  if (factor.info() != Eigen::Success) return kNan;
  return factor.matrixLLT().diagonal().array().log().sum();
}

// Of channels of unit power, safely above what sums of their products lose by rounding, which is all that recordings without
// noise leave: outputs count as measured with noise of that power.
constexpr double kLostByRounding = 1e-12;

LaggedProducts sums_of(const ScaledRecordings& recordings, Index lags,
                       const std::vector<MatrixXd>& states = {}) {
  LaggedProducts out = lagged_products(recordings.y, recordings.u, lags, states);
  for (Index lag = 0; lag <= lags; ++lag) {
    out.gram.diagonal().segment(lag * out.channels(), out.outputs).array() +=
        kLostByRounding * static_cast<double>(out.windows);
  }
  return out;
}

// Rows that have so many without a gap before them.
Index windows_of(const ScaledRecordings& recordings, Index lags) {
  Index windows = 0;
  for (const MatrixXd& y : recordings.y) {
    Index run = 0;
    for (Index t = 0; t < y.cols(); ++t) {
      run = y.col(t).allFinite() ? run + 1 : 0;
      windows += run > lags ? 1 : 0;
    }
  }
  return windows;
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
  while (lags > 2 && windows_of(recordings, lags) < 2 * q * (lags + 1)) --lags;
  if (lags < 2) {
    throw InputError(
        {},
        fmt::format("{} rows, without those that are held out, are too few for {} channel{}", rows,
                    q, q == 1 ? "" : "s"),
        fmt::format("at least {} of them", 4 * (q + 1)), "record more, or hold out fewer");
  }
  return lags;
}

SubspaceStart subspace_start(const ScaledRecordings& recordings, Index lags,
                             const PredictorPrior* start) {
  LaggedProducts sums = sums_of(recordings, lags);
  if (sums.windows < 2 * sums.channels()) {
    throw InputError(
        {}, fmt::format("{} rows have {} rows without a gap before them", sums.windows, lags),
        fmt::format("at least {}", 2 * sums.channels()), "fill the gaps, or record more");
  }
  const PredictorRegression regression(sums);
  const PredictorPrior prior = likeliest_prior(regression, start);
  Realisation states(sums, regression.estimate(prior));
  return {std::move(sums), prior, std::move(states)};
}

MatrixXd prediction_errors(const InnovationForm& model, const ScaledRecordings& recordings,
                           const LaggedProducts& sums) {
  if (recordings.rows() > kEnoughRows && forgets(model, sums.lags)) {
    return prediction_error_covariance(model, sums);
  }
  const ScaledRecordings enough = first_rows(recordings, kEnoughRows);
  MatrixXd sum = MatrixXd::Zero(model.outputs(), model.outputs());
  double count = 0.0;
  for (std::size_t k = 0; k < enough.y.size(); ++k) {
    const MatrixXd& y = enough.y[k];
    if (y.cols() <= sums.lags) continue;
    const MatrixXd e = y - one_step_predictions(model, y, enough.u[k],
                                                first_state(model, y, enough.u[k], sums.lags));
    for (Index t = sums.lags; t < e.cols(); ++t) {
      if (!y.col(t).allFinite()) continue;
      sum.noalias() += e.col(t) * e.col(t).transpose();
      count += 1.0;
    }
  }
  sum /= std::max(count, 1.0);
  sum.diagonal().array() += kLostByRounding;
  return sum;
}

LaggedProducts sums_around(const InnovationForm& model, const ScaledRecordings& recordings,
                           Index lags) {
  std::vector<MatrixXd> states;
  for (std::size_t k = 0; k < recordings.y.size(); ++k) {
    states.push_back(predictor_states(model, recordings.y[k], recordings.u[k],
                                      first_state(model, recordings.y[k], recordings.u[k], lags)));
  }
  return sums_of(recordings, lags, states);
}

namespace {

// From here to the least squares of the predictions, weighed by the inverse of their covariance here.
// @param directions  of the predictor's parameters; @param last_gain  of log-likelihood, below which it ends
InnovationForm one_search(const InnovationForm& from, const MatrixXd& directions,
                          const LaggedProducts& sums, double last_gain) {
  const MatrixXd V = prediction_error_covariance(from, sums);
  if (!std::isfinite(half_log_determinant(V))) return from;
  const PredictionErrorProblem errors(sums, V);
  const VectorXd theta = predictor_parameters(from);
  LeastSquares problem;
  MatrixXd J;
  problem.evaluate = [&](const VectorXd& along, VectorXd& r, LeastSquares::RowMatrix* of) {
    const InnovationForm here = with_predictor_parameters(from, theta + directions * along);
    if (!errors.evaluate(here, r, of != nullptr ? &J : nullptr)) return false;
    if (of != nullptr) of->noalias() = J * directions;
    return true;
  };
  problem.residuals = errors.residuals();
  problem.lower.setConstant(directions.cols(), -std::numeric_limits<double>::infinity());
  problem.upper = -problem.lower;
  SolverOptions options;
  options.max_iterations = 15;
  // Of the objective, which begins at half the number of residuals. A step of less gain is not taken.
  options.function_tolerance = 2.0 * last_gain / static_cast<double>(sums.windows * sums.outputs);
  options.normal_equations = true;
  const VectorXd found = solve(problem, VectorXd::Zero(directions.cols()), options).x;
  return with_predictor_parameters(from, theta + directions * found);
}

}  // namespace

namespace {

// Of an evaluation: a twentieth of a second. More would cost more than it tells.
constexpr double kWork = 5e7;

// Rows of that work.
ScaledRecordings affordable(const ScaledRecordings& recordings, double work_of_a_row) {
  return first_rows(recordings, std::max<Index>(static_cast<Index>(kWork / work_of_a_row), 2000));
}

// The least squares of a simulation along these directions.
// @param tolerance  a smaller part of the squares is nothing to go on for
InnovationForm simulating_closest(const InnovationForm& start, const MatrixXd& directions,
                                  const SimulationErrorProblem& errors,
                                  const std::function<bool(const InnovationForm&)>& is_allowed,
                                  int iterations, double tolerance) {
  const VectorXd theta = simulation_parameters(start);
  LeastSquares problem;
  MatrixXd J;
  problem.evaluate = [&](const VectorXd& along, VectorXd& r, LeastSquares::RowMatrix* of) {
    const InnovationForm here = with_simulation_parameters(start, theta + directions * along);
    if (!is_allowed(here)) return false;
    if (!errors.evaluate(here, directions, r, of != nullptr ? &J : nullptr)) return false;
    if (of != nullptr) *of = J;
    return true;
  };
  problem.residuals = errors.residuals();
  problem.lower.setConstant(directions.cols(), -std::numeric_limits<double>::infinity());
  problem.upper = -problem.lower;
  SolverOptions options;
  options.max_iterations = iterations;
  options.function_tolerance = tolerance;
  options.normal_equations = true;
  const VectorXd found = solve(problem, VectorXd::Zero(directions.cols()), options).x;
  return with_simulation_parameters(start, theta + directions * found);
}

// Back from predictor_in(), W = L^-1.
InnovationForm model_of(const InnovationForm& predictor, const MatrixXd& L, InnovationForm out) {
  const Index m = out.inputs(), p = out.outputs();
  out.C = L * predictor.C;
  out.D = L * predictor.D.leftCols(m);
  out.K = predictor.B.rightCols(p);
  out.A = predictor.A + out.K * out.C;
  out.B = predictor.B.leftCols(m) + out.K * out.D;
  return out;
}

// The least squares of the predictions row by row, weighed by the inverse of their covariance V here, each recording from
// the first state that is best for it: of a predictor that does not forget within any number of rows. Of as many first rows
// as are worth their time.
// @return the start where outputs are missing, which the predictor is driven by, and where those are too few
InnovationForm searched_by_rows(const InnovationForm& from, const ScaledRecordings& recordings,
                                const MatrixXd& V, double largest_pole) {
  const Eigen::LLT<MatrixXd> factor(V);
  const MatrixXd L = factor.matrixL();
  const MatrixXd W = L.inverse();
  const InnovationForm start = predictor_in(from, W);
  const MatrixXd all = simulation_coordinates(start);
  const MatrixXd directions = all.leftCols(all.cols() - V.size());  // the last: of outputs, zero
  const auto n = static_cast<double>(from.states()), d = static_cast<double>(directions.cols());
  constexpr double kShare = 0.2;    // of the work of an evaluation: it takes several
  constexpr double kFewest = 0.25;  // of the rows: fewer tell less than is lost by forgetting
  const double affordable_rows = kShare * kWork / (d * (2.0 * n * n + d));
  if (affordable_rows < kFewest * static_cast<double>(recordings.rows())) return from;
  const ScaledRecordings enough = first_rows(recordings, static_cast<Index>(affordable_rows));
  std::vector<MatrixXd> y, driven_by;
  for (std::size_t k = 0; k < enough.y.size(); ++k) {
    if (!enough.y[k].allFinite()) return from;
    y.push_back(W * enough.y[k]);
    driven_by.push_back(driving(enough.y[k], enough.u[k]));
  }
  const auto is_allowed = [&](const InnovationForm& predictor) {
    return spectral_radius(predictor.A) < 1.0 &&
           spectral_radius(model_of(predictor, L, from).A) <= largest_pole;
  };
  if (!is_allowed(start)) return from;
  const InnovationForm found =
      simulating_closest(start, directions, {y, driven_by}, is_allowed, 10, 1e-5);
  return model_of(found, L, from);
}

// What rows say of a predictor's first state, beyond what is known of it before: log det(I + P S)/2, S the information of
// so many rows about it in units of V, P its covariance where inputs are white and of unit power. Without this a pole at
// the unit circle is a sine that can be laid through noise at no cost.
double first_state_known(const InnovationForm& predictor, const MatrixXd& root, Index rows) {
  constexpr Index kMostRows = 5000;
  const Index n = predictor.states();
  MatrixXd S = MatrixXd::Zero(n, n), response = predictor.C;
  for (Index t = 0; t < std::min(rows, kMostRows); ++t) {
    S.noalias() += response.transpose() * response;
    response = (response * predictor.A).eval();
  }
  return half_log_determinant(MatrixXd::Identity(n, n) + root.transpose() * S * root);
}

// Of log-likelihood: what first states cost that later predictions remember, rows behind the lags against those before.
double cost_of_first_states(const InnovationForm& model, const MatrixXd& V,
                            const ScaledRecordings& recordings, Index lags) {
  if (forgets(model, lags)) return 0.0;
  const Eigen::LLT<MatrixXd> factor(V);
  const InnovationForm predictor = predictor_in(
      model, factor.matrixL().solve(MatrixXd::Identity(model.outputs(), model.outputs())));
  const MatrixXd A = with_poles_within(model, 0.99).A;
  const auto P =
      solve_discrete_lyapunov(A, model.K * V * model.K.transpose() + model.B * model.B.transpose());
  if (!P) return 0.0;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> of_P(*P);
  const MatrixXd root =
      of_P.eigenvectors() * of_P.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  const double before = first_state_known(predictor, root, lags);
  std::map<Index, double> behind;  // of so many rows: many recordings have the same
  double sum = 0.0;
  for (const MatrixXd& y : recordings.y) {
    if (!y.allFinite() || y.cols() <= lags) continue;
    const auto [known, is_new] = behind.try_emplace(y.cols());
    if (is_new) known->second = first_state_known(predictor, root, y.cols());
    sum += known->second - before;
  }
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

// Until no search by rows is likelier by more than the first states that are free in it explain.
InnovationForm refined_by_rows(InnovationForm best, const ScaledRecordings& recordings,
                               const LaggedProducts& sums, double largest_pole) {
  constexpr int kSearches = 3;
  const double of_states = 0.5 * static_cast<double>(best.states());  // of log-likelihood
  MatrixXd V = prediction_errors(best, recordings, sums);
  for (int k = 0; k < kSearches && std::isfinite(half_log_determinant(V)); ++k) {
    InnovationForm model = searched_by_rows(best, recordings, V, largest_pole);
    const MatrixXd now = prediction_errors(model, recordings, sums);
    const double gain = half_log_determinant(V) - half_log_determinant(now);
    const double cost = cost_of_first_states(model, now, recordings, sums.lags) -
                        cost_of_first_states(best, V, recordings, sums.lags);
    if (!(gain * static_cast<double>(sums.windows) - cost > of_states)) break;
    best = std::move(model);
    V = now;
  }
  return best;
}

}  // namespace

InnovationForm refined(const InnovationForm& start, const ScaledRecordings& recordings,
                       const LaggedProducts& sums) {
  InnovationForm best = start;
  double least = half_log_determinant(prediction_errors(best, recordings, sums));
  // Neither the weights nor the states of a search are those at its end: the first need not go to its last digit.
  for (const double last_gain : {0.03, 0.01, 0.001}) {
    const bool far_back = !forgets(best, sums.lags);
    const InnovationForm model =
        one_search(best, local_coordinates(best),
                   far_back ? sums_around(best, recordings, sums.lags) : sums, last_gain);
    if (spectral_radius(model.A - model.K * model.C) >= 1.0) break;
    const double now = half_log_determinant(prediction_errors(model, recordings, sums));
    if (!(now < least)) break;
    const double gain = (least - now) * static_cast<double>(sums.windows);
    best = model;
    least = now;
    constexpr double kNothing = 0.05;  // of log-likelihood
    if (gain < kNothing) break;
  }
  return best;
}

namespace {

bool predicts_better(const InnovationForm& one, const InnovationForm& than,
                     const ScaledRecordings& recordings, const LaggedProducts& sums) {
  return half_log_determinant(prediction_errors(one, recordings, sums)) <
         half_log_determinant(prediction_errors(than, recordings, sums));
}

// The gain of the likeliest predictions, all else held.
InnovationForm with_likeliest_gain(const InnovationForm& from, const ScaledRecordings& recordings,
                                   const LaggedProducts& sums) {
  const InnovationForm found = one_search(from, gain_directions(from), sums, 0.01);
  const bool stable = spectral_radius(found.A - found.K * found.C) < 1.0;
  return stable && predicts_better(found, from, recordings, sums) ? found : from;
}

// All of it by the errors of its simulation, from here on, no pole beyond the largest.
InnovationForm by_simulation(const InnovationForm& from, const ScaledRecordings& recordings) {
  const MatrixXd directions = simulation_coordinates(from);
  const auto n = static_cast<double>(from.states()), d = static_cast<double>(directions.cols());
  const ScaledRecordings enough = affordable(recordings, d * (2.0 * n * n + d));
  const auto is_allowed = [](const InnovationForm& here) {
    return spectral_radius(here.A) <= kLargestPole;
  };
  return simulating_closest(from, directions, {enough.y, enough.u}, is_allowed, 10, 1e-3);
}

}  // namespace

InnovationForm fitted(const SubspaceStart& start, const ScaledRecordings& recordings, int order,
                      Refinement how, bool stable) {
  InnovationForm model = start.states.model(order);
  if (how == Refinement::prediction_error || how == Refinement::any_poles)
    model = refined(with_stable_predictor(model), recordings, start.sums);
  const bool was_stable = spectral_radius(model.A) <= kLargestPole;
  if (stable) model = with_poles_within(std::move(model), kLargestPole);
  const bool by_inputs = how == Refinement::simulation || how == Refinement::output_error;
  if (recordings.u.front().rows() > 0 && (by_inputs || (stable && !was_stable))) {
    const auto n = static_cast<double>(order), m = static_cast<double>(model.inputs());
    const ScaledRecordings enough = affordable(recordings, n * n * n * m);
    model = with_inputs_by_simulation(std::move(model), enough.y, enough.u);
    if (how == Refinement::output_error) {
      // Poles at the limit cannot move: two of them leave it at any step.
      constexpr double kInside = 0.98;
      if (!was_stable) {
        model = with_inputs_by_simulation(with_poles_within(std::move(model), kInside), enough.y,
                                          enough.u);
      }
      model = with_stable_predictor(by_simulation(model, recordings));
      model = with_likeliest_gain(model, recordings, start.sums);
    }
  }
  model = with_stable_predictor(model);
  if (how != Refinement::prediction_error && how != Refinement::any_poles) return model;
  if (stable) {
    // Poles that are put elsewhere may undo more than the search gains, or may be what it should begin from.
    InnovationForm plain = fitted(start, recordings, order, Refinement::none, stable);
    if (predicts_better(plain, model, recordings, start.sums)) model = std::move(plain);
  }
  if (forgets(model, start.sums.lags)) return model;
  return refined_by_rows(std::move(model), recordings, start.sums,
                         stable ? kLargestPole : std::numeric_limits<double>::infinity());
}

void judge_on_fitted(BlackBoxCandidate& candidate, const ScaledRecordings& recordings,
                     const LaggedProducts& sums) {
  candidate.model.sigma = prediction_errors(candidate.model, recordings, sums);
  const auto rows = static_cast<double>(std::min(sums.windows, kEnoughRows));
  const auto p = static_cast<double>(sums.outputs);
  const double half = half_log_determinant(candidate.model.sigma);
  candidate.log_likelihood =
      -rows * (half + 0.5 * p * (1.0 + std::log(2.0 * std::numbers::pi))) -
      cost_of_first_states(candidate.model, candidate.model.sigma, recordings, sums.lags);
  Index parameters = 0;
  for (const PolynomialModel& each : candidate.polynomials) parameters += each.parameters();
  if (candidate.polynomials.empty()) parameters = free_parameters(candidate.model);
  candidate.bic =
      -2.0 * candidate.log_likelihood + static_cast<double>(parameters) * std::log(rows);
  candidate.hannan_quinn = -2.0 * candidate.log_likelihood +
                           2.0 * static_cast<double>(parameters) * std::log(std::log(rows));
}

}  // namespace identikal
