// Options and terminations, translated for Ceres and back.
#pragma once

#include <ceres/solver.h>

#include "solvers/problem.h"

namespace identikal {

/// Tolerances and limits; one thread, nothing printed. The linear solver is the caller's to choose.
ceres::Solver::Options ceres_options(const SolverOptions& options);

/// What a run with `options` ended with. `stopped` where a callback ended it; convergence is
/// `no_progress` where the trust region has only shrunk to nothing.
Termination termination_of(const ceres::Solver::Summary& summary,
                           const ceres::Solver::Options& options);

}  // namespace identikal
