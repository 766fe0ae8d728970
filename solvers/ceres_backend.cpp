#include <ceres/cost_function.h>
#include <ceres/iteration_callback.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "solvers/solve.h"

namespace identikal {
namespace {

void check(const LeastSquares& problem, const Eigen::VectorXd& start) {
  const Eigen::Index n = start.size();
  std::ostringstream text;
  if (n == 0 || problem.residuals <= 0 || problem.lower.size() != n || problem.upper.size() != n) {
    text << "least squares: " << problem.residuals << " residuals, start of size " << n
         << ", bounds of sizes " << problem.lower.size() << " and " << problem.upper.size();
    throw std::invalid_argument(text.str());
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (start[i] >= problem.lower[i] && start[i] <= problem.upper[i]) continue;
    text << "least squares: start " << start[i] << " of coordinate " << i << " lies outside ["
         << problem.lower[i] << ", " << problem.upper[i] << "]";
    throw std::invalid_argument(text.str());
  }
}

/// Ceres asks for a class; it only passes the call on.
class Residuals : public ceres::CostFunction {
 public:
  Residuals(const LeastSquares& problem, Eigen::Index n)
      : problem_(problem), x_(n), r_(problem.residuals) {
    set_num_residuals(static_cast<int>(problem.residuals));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(n));
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Index n = x_.size(), m = r_.size();
    x_ = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    const bool with_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
    if (with_jacobian) J_.resize(m, n);
    if (!problem_.evaluate(x_, r_, with_jacobian ? &J_ : nullptr)) return false;
    if (!r_.allFinite() || (with_jacobian && !J_.allFinite())) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, m) = r_;
    if (with_jacobian) Eigen::Map<LeastSquares::RowMatrix>(jacobians[0], m, n) = J_;
    return true;
  }

 private:
  const LeastSquares& problem_;
  mutable Eigen::VectorXd x_, r_;
  mutable LeastSquares::RowMatrix J_;
};

class Progress : public ceres::IterationCallback {
 public:
  explicit Progress(const SolverOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    return options_.progress(summary.iteration, summary.cost)
               ? ceres::SOLVER_CONTINUE
               : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  const SolverOptions& options_;
};

Termination termination_of(const ceres::Solver::Summary& summary,
                           const ceres::Solver::Options& options) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE: {
      // Ceres also calls it convergence when its trust region has shrunk to nothing.
      const bool shrunk = !summary.iterations.empty() &&
                          summary.iterations.back().trust_region_radius <=
                              options.min_trust_region_radius;
      return shrunk ? Termination::no_progress : Termination::converged;
    }
    case ceres::NO_CONVERGENCE:
      return summary.num_successful_steps + summary.num_unsuccessful_steps >=
                     options.max_num_iterations
                 ? Termination::iteration_limit
                 : Termination::time_limit;
    case ceres::USER_SUCCESS:
    case ceres::USER_FAILURE:
      return Termination::iteration_limit;
    default:
      return Termination::no_progress;
  }
}

}  // namespace

Solution solve(const LeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options) {
  check(problem, start);
  const Eigen::Index n = start.size();
  Solution solution;
  solution.x = start;

  Eigen::VectorXd r(problem.residuals);
  if (!problem.evaluate(start, r, nullptr) || !r.allFinite()) {
    solution.summary.termination = Termination::start_undefined;
    solution.summary.message = "the residuals are undefined at the start";
    return solution;
  }

  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  Residuals residuals(problem, n);
  ceres::Problem ceres_problem(ownership);
  ceres_problem.AddResidualBlock(&residuals, nullptr, solution.x.data());
  std::vector<int> held;
  for (Eigen::Index i = 0; i < n; ++i) {
    const int k = static_cast<int>(i);
    if (problem.lower[i] == problem.upper[i]) {
      held.push_back(k);  // an empty interior is an error to Ceres unless the coordinate is constant
      continue;
    }
    if (std::isfinite(problem.lower[i])) {
      ceres_problem.SetParameterLowerBound(solution.x.data(), k, problem.lower[i]);
    }
    if (std::isfinite(problem.upper[i])) {
      ceres_problem.SetParameterUpperBound(solution.x.data(), k, problem.upper[i]);
    }
  }
  if (static_cast<Eigen::Index>(held.size()) == n) {
    ceres_problem.SetParameterBlockConstant(solution.x.data());
  } else if (!held.empty()) {
    ceres_problem.SetManifold(solution.x.data(),
                              new ceres::SubsetManifold(static_cast<int>(n), held));
  }

  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = ceres::DENSE_QR;
  ceres_options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  ceres_options.jacobi_scaling = true;
  ceres_options.num_threads = 1;
  ceres_options.max_num_iterations = options.max_iterations;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.gradient_tolerance = options.gradient_tolerance;
  ceres_options.parameter_tolerance = options.parameter_tolerance;
  ceres_options.logging_type = ceres::SILENT;
  if (std::isfinite(options.max_seconds)) {
    ceres_options.max_solver_time_in_seconds = options.max_seconds;
  }
  Progress progress(options);
  if (options.progress) ceres_options.callbacks.push_back(&progress);

  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options, &ceres_problem, &summary);

  solution.summary.termination = termination_of(summary, ceres_options);
  solution.summary.message = summary.message;
  solution.summary.iterations = summary.num_successful_steps + summary.num_unsuccessful_steps;
  solution.summary.evaluations = summary.num_residual_evaluations + 1;
  solution.summary.initial_objective = 0.5 * r.squaredNorm();
  solution.summary.objective = summary.final_cost;
  return solution;
}

}  // namespace identikal
