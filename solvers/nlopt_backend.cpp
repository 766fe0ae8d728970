#include <cmath>
#include <exception>
#include <stdexcept>
#include <vector>

#include <nlopt.hpp>

#include "solvers/solve.h"

namespace identikal {
namespace {

struct Call {
  const Minimization* problem;
  const SolverOptions* options;
  SolverSummary* summary;
  Eigen::VectorXd best_x;
  double best_f = HUGE_VAL;
  bool stopped = false;  // by the caller; L-BFGS finishes its line search all the same
};

double objective(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  Call& call = *static_cast<Call*>(data);
  if (call.stopped) return HUGE_VAL;
  const Eigen::VectorXd at =
      Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
  double f = 0.0;
  Eigen::VectorXd g;
  ++call.summary->evaluations;
  if (!call.problem->evaluate(at, f, gradient.empty() ? nullptr : &g) || !std::isfinite(f)) {
    // L-BFGS backs off from an infinite value; the gradient there is never used.
    for (double& value : gradient) value = 0.0;
    f = HUGE_VAL;
  } else {
    for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] = g[i];
  }
  if (call.summary->evaluations == 1 && f < HUGE_VAL) call.summary->initial_objective = f;
  if (f < call.best_f) {
    call.best_f = f;
    call.best_x = at;
  }
  const SolverOptions& options = *call.options;
  if (options.progress && !options.progress(call.summary->evaluations, call.best_f)) {
    call.stopped = true;
    throw nlopt::forced_stop();
  }
  return f;
}

Solution solve_by(nlopt::algorithm algorithm, const Minimization& problem,
                  const Eigen::VectorXd& start, const SolverOptions& options) {
  const auto n = static_cast<unsigned>(start.size());
  if (problem.lower.size() != start.size() || problem.upper.size() != start.size()) {
    throw std::invalid_argument("solve: start and bounds differ in size");
  }
  if ((start.array() < problem.lower.array()).any() ||
      (start.array() > problem.upper.array()).any()) {
    throw std::invalid_argument("solve: the start lies outside the bounds");
  }
  Solution out;
  out.x = start;
  Call call{&problem, &options, &out.summary, start};
  nlopt::opt optimiser(algorithm, n);
  optimiser.set_min_objective(objective, &call);
  optimiser.set_lower_bounds({problem.lower.data(), problem.lower.data() + n});
  optimiser.set_upper_bounds({problem.upper.data(), problem.upper.data() + n});
  optimiser.set_ftol_rel(options.function_tolerance);
  optimiser.set_xtol_rel(options.parameter_tolerance);
  optimiser.set_maxeval(10 * options.max_iterations);
  if (std::isfinite(options.max_seconds)) optimiser.set_maxtime(options.max_seconds);
  std::vector<double> x(start.data(), start.data() + n);
  double f = 0.0;
  try {
    const nlopt::result result = optimiser.optimize(x, f);
    out.summary.termination = result == nlopt::MAXEVAL_REACHED   ? Termination::iteration_limit
                              : result == nlopt::MAXTIME_REACHED ? Termination::time_limit
                                                                 : Termination::converged;
    out.summary.message = nlopt_result_to_string(static_cast<nlopt_result>(result));
  } catch (const nlopt::roundoff_limited&) {
    out.summary.termination = Termination::no_progress;
    out.summary.message = "rounding limits further progress";
  } catch (const std::exception& error) {
    out.summary.termination = Termination::no_progress;
    out.summary.message = error.what();
  }
  if (call.stopped) {
    out.summary.termination = Termination::stopped;
    out.summary.message = "stopped by the caller";
    x.assign(call.best_x.begin(), call.best_x.end());
    f = call.best_f;
  }
  out.x = Eigen::Map<const Eigen::VectorXd>(x.data(), start.size());
  out.summary.objective = f;
  out.summary.iterations = out.summary.evaluations;
  return out;
}

}  // namespace

Solution solve(const Minimization& problem, const Eigen::VectorXd& start,
               const SolverOptions& options) {
  return solve_by(nlopt::LD_LBFGS, problem, start, options);
}

Solution solve_without_gradient(const Minimization& problem, const Eigen::VectorXd& start,
                                const SolverOptions& options) {
  return solve_by(nlopt::LN_SBPLX, problem, start, options);
}

}  // namespace identikal
