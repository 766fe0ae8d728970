// Which parameters and which path of the state are most likely together, with process noise?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/covariance.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// The answer of fit_trajectory().
struct VehicleTrajectory {
  VehicleOptimum best;  ///< of the simulation problem: parameters, first states, sd of the outputs
  /// Root of the process-noise density of vy and r [m/s and rad/s, per sqrt(s)].
  Eigen::Vector2d process = Eigen::Vector2d::Zero();
  std::vector<Eigen::Matrix2Xd> states;  ///< (vy, r) of every segment, a column per row, SI
  Eigen::Index left_out = 0;             ///< samples taken for outliers
  VehicleCovariance covariance;          ///< of the parameters, states eliminated
};

/// The states of all rows are unknowns beside the parameters: minimise
///   sum over samples of ((h_j(x_t; p) - y_jt) / sd_j)^2
///     + sum over intervals of |D^-1 (x_t+1 - f_t(x_t; p))|^2 / dt_t  (+ priors),
/// with D = diag(process) and f_t one interval of the Runge-Kutta integration, by
/// Levenberg-Marquardt on sparse normal equations (solvers/sparse_least_squares.h). Samples may be
/// missing; with problem.robust those that lie 4 standard deviations from what all others predict
/// are left out. As the state is corrected at every row, errors of the model do not add up over a
/// long recording.
///
/// The noise (sd unless given, and process) maximises Laplace's approximation of the likelihood
/// with the path integrated out, exact for a linear car: -cost - 1/2 log det H, H the block
/// tridiagonal second derivative with respect to the path; its gradient by the logarithms of the
/// noise is what an EM step compares (Shumway & Stoffer 1982). Parameters and path are most likely
/// jointly, which pulls parameters by an amount of the order of the path's variance over that of
/// the motion. Their information is H's Schur complement.
/// @param start  the best simulation
/// @throws InputError when the car has a relaxation length: its axle forces would be states too
VehicleTrajectory fit_trajectory(const VehicleProblem& problem, const VehicleOptimum& start,
                                 const SolverOptions& options);

}  // namespace identikal
