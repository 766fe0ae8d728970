#include "identify/noise/external_filter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>

#include "identify/estimate/parameter_table.h"
#include "identify/estimate/test_result.h"
#include "identify/noise/estimate.h"
#include "lib/statistics/whiteness.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of a coordinate's size: the cube root of the precision, where rounding and curvature balance.
constexpr double kStep = 6e-6;

class Runs {
 public:
  Runs(const ParameterSet& parameters, const ExternalFilter& filter)
      : parameters_(parameters),
        filter_(filter),
        box_(coordinate_box(parameters)),
        size_(coordinates(parameters).cwiseAbs()) {
    const double largest = size_.size() > 0 ? size_.maxCoeff() : 0.0;
    for (double& s : size_) {
      if (s == 0.0) s = largest > 0.0 ? largest : 1.0;
    }
  }

  // Likelihood at these coordinates; nothing where the filter does not run, there or beside.
  std::optional<Likelihood> at(const VectorXd& x, bool with_derivatives,
                               MatrixXd* score_products = nullptr) {
    const std::optional<Innovations> here = filter_(with_coordinates(parameters_, x));
    if (!here) return std::nullopt;
    std::vector<InnovationsBeside> beside;
    for (Index i = 0; with_derivatives && i < x.size(); ++i) {
      const double step = kStep * std::max(std::abs(x[i]), 0.01 * size_[i]);
      VectorXd above = x, below = x;
      above[i] = std::min(x[i] + step, box_.upper[i]);
      below[i] = std::max(x[i] - step, box_.lower[i]);
      auto up = filter_(with_coordinates(parameters_, above));
      auto down = filter_(with_coordinates(parameters_, below));
      if (!up || !down) return std::nullopt;
      beside.push_back({std::move(*up), std::move(*down), above[i] - below[i]});
    }
    Likelihood out = innovations_likelihood(*here, beside, score_products);
    if (out.status != FilterStatus::ok) return std::nullopt;
    return out;
  }

  LikelihoodProblem problem() {
    LikelihoodProblem out;
    out.lower = box_.lower;
    out.upper = box_.upper;
    out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
      std::optional<Likelihood> found = at(x, gradient != nullptr);
      if (!found) return false;
      L = found->value;
      if (gradient != nullptr) *gradient = found->gradient;
      if (information != nullptr) *information = found->information;
      return true;
    };
    return out;
  }

 private:
  const ParameterSet& parameters_;
  const ExternalFilter& filter_;
  Box box_;
  VectorXd size_;
};

// e over its standard deviation, channels decorrelated; NaN where a channel is missing.
MatrixXd standardised(const Innovations& of) {
  MatrixXd out = of.e;
  for (Index t = 0; t < of.e.cols(); ++t) {
    const MatrixXd& Sigma = of.Sigma[of.Sigma.size() == 1 ? 0 : static_cast<std::size_t>(t)];
    std::vector<Index> there;
    for (Index i = 0; i < of.e.rows(); ++i) {
      if (std::isfinite(of.e(i, t))) there.push_back(i);
    }
    if (there.empty()) continue;
    const MatrixXd S = Sigma(there, there);
    const VectorXd e = of.e.col(t)(there), white = S.llt().matrixL().solve(e);
    out(there, t) = white;
  }
  return out;
}

// Size and whiteness of the innovations, at 5 % in all, and how many they are.
void test_innovations(const Innovations& of, Index free, NoiseEstimate& estimate) {
  Objective& objective = estimate.objective;
  objective.samples = of.e.array().isFinite().count();
  objective.rows = of.e.array().isFinite().colwise().any().count();
  const double k = static_cast<double>(free), L = objective.log_likelihood;
  objective.bic = k * std::log(static_cast<double>(objective.rows)) - 2.0 * L;
  objective.bic_values = k * std::log(static_cast<double>(objective.samples)) - 2.0 * L;
  const MatrixXd e = standardised(of);
  const double level = 0.05 / static_cast<double>(1 + e.rows());
  const ChiSquareStatistic nis = normalised_innovation_squared(e);
  if (nis.dof > 0.0) estimate.tests.push_back(nis_test(nis, level));
  const int lags = default_lags(e.cols());
  for (Index i = 0; lags > 0 && i < e.rows(); ++i) {
    estimate.tests.push_back(
        ljung_box_test("y" + std::to_string(i + 1), ljung_box(e.row(i).transpose(), lags), level));
  }
  append(estimate.findings, check_innovations(estimate));
}

}  // namespace

NoiseEstimate fit_external_filter(const ParameterSet& parameters, const ExternalFilter& filter,
                                  const ExternalFilterOptions& options) {
  const VectorXd start = coordinates(parameters);
  if (start.size() == 0) throw std::invalid_argument("fit_external_filter: nothing is free");
  Runs runs(parameters, filter);
  const LikelihoodProblem problem = runs.problem();
  SolverOptions solver;
  solver.max_iterations = options.max_iterations;
  solver.decrement_tolerance = 1e-13;
  solver.progress = options.progress;
  const Solution found = maximise(problem, start, solver);
  if (found.summary.termination == Termination::start_undefined) {
    throw std::invalid_argument("fit_external_filter: the filter does not run at the start");
  }
  const ParameterSet end = with_coordinates(parameters, found.x);
  NoiseEstimate estimate;
  estimate.objective.method = kOwnFilter;
  estimate.objective.log_likelihood = found.summary.objective;
  estimate.objective.log_likelihood_start = found.summary.initial_objective;
  estimate.objective.iterations = found.summary.iterations;
  estimate.objective.evaluations = found.summary.evaluations;
  estimate.objective.aic = 2.0 * (static_cast<double>(start.size()) - found.summary.objective);
  list_parameters(estimate, parameters, end);

  std::vector<bool> at_bound;
  for (Index i = 0; i < found.x.size(); ++i) {
    at_bound.push_back(found.x[i] <= problem.lower[i] || found.x[i] >= problem.upper[i]);
  }
  MatrixXd products;
  const std::optional<Likelihood> there = runs.at(found.x, true, &products);
  const InteriorParameters inside = interior_parameters(estimate, at_bound);
  if (there && !inside.entries.empty()) {
    // By the entries, in the user's units.
    const MatrixXd J = entry_jacobian(parameters, found.x);
    const MatrixXd to_coordinates = J.inverse();
    const auto in_units = [&](const MatrixXd& by_coordinates) {
      const MatrixXd by_entries = to_coordinates.transpose() * by_coordinates * to_coordinates;
      return MatrixXd(inside.unit.asDiagonal() * by_entries(inside.entries, inside.entries) *
                      inside.unit.asDiagonal());
    };
    const MatrixXd information = in_units(there->information);
    const std::optional<MatrixXd> inverse = scaled_inverse(information, 1e-9);
    estimate.covariance_kind =
        inverse ? "expected information" : "partial: some directions carry no information";
    judge_parameters(estimate, information,
                     inverse
                         ? *inverse
                         : MatrixXd(information.completeOrthogonalDecomposition().pseudoInverse()));
    for (std::size_t j = 0; inverse && j < inside.reported.size(); ++j) {
      const auto at = static_cast<Index>(j);
      inside.reported[j]->se_sandwich =
          std::sqrt((*inverse * in_units(products) * *inverse)(at, at));
    }
  }
  if (!found.summary.usable()) withdraw_errors(estimate);
  append(estimate.findings, check_search(estimate, found.summary));
  if (const std::optional<Innovations> left = filter(end))
    test_innovations(*left, start.size(), estimate);
  conclude(estimate, "converged");
  return estimate;
}

}  // namespace identikal
