#include "solvers/internal/ceres_options.h"

#include <cmath>

#include <ceres/types.h>

namespace identikal {

ceres::Solver::Options ceres_options(const SolverOptions& options) {
  ceres::Solver::Options out;
  out.function_tolerance = options.function_tolerance;
  out.gradient_tolerance = options.gradient_tolerance;
  out.parameter_tolerance = options.parameter_tolerance;
  out.max_num_iterations = options.max_iterations;
  if (std::isfinite(options.max_seconds)) out.max_solver_time_in_seconds = options.max_seconds;
  out.num_threads = 1;
  out.logging_type = ceres::SILENT;
  return out;
}

Termination termination_of(const ceres::Solver::Summary& summary,
                           const ceres::Solver::Options& options) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE: {
      // Ceres also calls it convergence when its trust region has shrunk to nothing.
      const bool shrunk =
          !summary.iterations.empty() &&
          summary.iterations.back().trust_region_radius <= options.min_trust_region_radius;
      return shrunk ? Termination::no_progress : Termination::converged;
    }
    case ceres::NO_CONVERGENCE:
      return summary.num_successful_steps + summary.num_unsuccessful_steps >=
                     options.max_num_iterations
                 ? Termination::iteration_limit
                 : Termination::time_limit;
    case ceres::USER_SUCCESS:
      return Termination::stopped;
    default:
      return Termination::no_progress;
  }
}

}  // namespace identikal
