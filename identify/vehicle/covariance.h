// How far can the vehicle's parameters be trusted, and which of them do the data determine at all?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/recording_fit.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// Everything about the free parameters is SI and belongs to `inner`, in that order.
struct VehicleCovariance {
  Eigen::VectorXd sd;  ///< noise per output: given, or corrected for the degrees of freedom used
  Eigen::VectorXd residuals;  ///< simulated minus measured over sd, one per residual of the problem
  std::vector<bool> at_bound;  ///< of every free parameter; those are held there
  /// Of every free parameter: it lies at a bound, but the recording does not determine it (its
  /// interval, by `white`, reaches the other bound, or zero where it has to be positive). It is not
  /// held, or the standard errors of the others would take it as known.
  std::vector<bool> open;
  std::vector<Eigen::Index> inner;  ///< free parameters that are not at a bound
  Eigen::MatrixXd information;      ///< J' J with the initial states eliminated
  Eigen::MatrixXd rows;        ///< m x inner: each residual adds row' row to the information ...
  Eigen::VectorXd scores;      ///< m: ... and scores[i] row_i to the gradient
  Eigen::MatrixXd null_space;  ///< orthonormal directions of parameter/scale that change no output
  /// Cramer-Rao bound for white noise of the distribution that was fitted, normal or (robust cost)
  /// Student's, off the null space: (noise_information() J' J)^-1 with the rows of the priors
  Eigen::MatrixXd white;
  Eigen::MatrixXd covariance;         ///< `white`, or the sandwich when residuals are coloured
  std::vector<TestResult> whiteness;  ///< Ljung-Box per output
  bool coloured = false;
  Eigen::Index bandwidth = 1;  ///< rows over which scores are taken as correlated
  double memory = 0.0;         ///< the same in seconds
  int draws = 0;               ///< of the bootstrap, when `covariance` comes from it
  Eigen::Index blocks = 0;     ///< that it draws from
  double freedom = 1.0;        ///< degrees of freedom of Student's t to go with `covariance`
};

/// The covariance where the parameters at a bound are held, but for those that are `open`.
/// @param z        coordinates of the optimum
/// @param holding  makes the covariance with these parameters held
VehicleCovariance covariance_at_bounds(
    const VehicleProblem& problem, const Eigen::VectorXd& z, const std::vector<bool>& at_bound,
    const std::function<VehicleCovariance(const std::vector<bool>& held)>& holding);

/// At an optimum of the problem. White residuals: (J' J)^-1, with a row for every prior. Coloured
/// ones (Ljung-Box at 1 % over all outputs), and the robust cost: (J' J)^-1 S (J' J)^-1 with S the
/// long-run covariance of the scores summed over outputs (White 1982, Newey & West 1987). Of
/// bandwidths from Andrews' (1991) up to an eighth of the rows the one with the widest errors is
/// taken; none is taken below that of white residuals.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const VehicleUnknowns theta = vehicle_unknowns(car);
///     const auto problem = make_vehicle_problem(run, theta, demand_of(theta, theta.value));
///     const auto best = maximise_likelihood(problem, coordinates_of(problem, theta.value), {});
///     const VehicleCovariance covariance = vehicle_covariance(problem, best);
VehicleCovariance vehicle_covariance(const VehicleProblem& problem, const VehicleOptimum& optimum);

/// Replaces `covariance` by that of a block bootstrap: the recording is cut into blocks of
/// consecutive rows, each twice as long as the residuals are correlated (8 to 200 of them), as many
/// are drawn with replacement, and the optimum of every draw is found by one Gauss-Newton step,
///   theta* - theta = -(sum w J'J)^-1 sum w J'e    (Davidson & MacKinnon 1999),
/// with initial states eliminated. Needs no model of the residuals' correlation.
void bootstrap_errors(const VehicleProblem& problem, int draws, unsigned long long seed,
                      VehicleCovariance& covariance);

/// Residual maker: the part of the columns of B that is orthogonal to those of A. Columns of A that
/// depend on each other do no harm.
Eigen::MatrixXd orthogonal_part(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// Sums over the outputs of each row: column t holds sum of weight(i) * rows of X belonging to that
/// row of the recording. One column per row that has a residual.
Eigen::MatrixXd summed_by_row(const VehicleProblem& problem, const Eigen::MatrixXd& X,
                              const Eigen::VectorXd& weight);

/// Standard error of a function of the free parameters (delta method).
/// @param gradient  by the free parameters, SI
/// @return NaN when the function changes along a direction that the data do not determine, or
/// depends on a parameter at a bound
double standard_error(const VehicleProblem& problem, const VehicleCovariance& covariance,
                      const Eigen::VectorXd& gradient);

}  // namespace identikal
