// Where should the search for the vehicle's parameters begin?
#pragma once

#include <vector>

#include "identify/vehicle/output_error.h"

namespace identikal {

/// Starts for the free parameters, inside their bounds, in this order:
/// equation error (vehicle_by_equation_error(), where the outputs allow it); a typical car of this
/// mass, wheelbase and centre of gravity; the file's own; then scattered about the typical car, by
/// seed, until there are `besides` of them not counting the first.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const auto starts = vehicle_starts(run, vehicle_unknowns(car), 5, 1);
std::vector<VehicleParameters<double>> vehicle_starts(const VehicleRun& run,
                                                      const VehicleUnknowns& unknowns, int besides,
                                                      unsigned long long seed);

/// What the balances of force and moment are made of at n points of time, means of 0.1 s:
///   m ay = Ff + Fr,  Iz r' = a Ff - b Fr,  Ff = Cf slip_front,  Fr = Cr slip_rear.
struct VehicleBalances {
  Eigen::VectorXd time;                   ///< [s]
  Eigen::VectorXd slip_front, slip_rear;  ///< [rad]: delta - (vy + a r)/vx and (b r - vy)/vx
  Eigen::VectorXd acceleration;           ///< [m/s^2]: lateral, of the centre of gravity
  Eigen::VectorXd yaw_acceleration;       ///< [rad/s^2]
};

/// Derivatives are central differences of the means, within segments and not across missing
/// samples. Needs r and one of vy, beta, ay; from ay alone everything is high-pass filtered (see
/// vehicle_by_equation_error()).
/// @param p  all parameters but Cf, Cr and Iz are used
/// @return nothing in it when the outputs do not allow it
VehicleBalances vehicle_balances(const VehicleRun& run, const VehicleParameters<double>& p);

/// Cf, Cr and Iz by regression on the balances of force and moment, without any simulation:
///   m ay = Ff + Fr,  Iz r' = a Ff - b Fr,  Ff = Cf (delta - (vy + a r)/vx),  Fr = Cr (b r -
///   vy)/vx,
/// with derivatives by central differences over means of 0.1 s. Needs r and one of vy, beta, ay.
/// From ay alone vy is not known to a constant, so everything is high-pass filtered (1 s) and the
/// filtered vy is the low-pass filtered ay - vx r. Noise in the regressors biases it: it is a
/// start, not an answer.
/// @param p  supplies all other parameters, and the values of Cf, Cr, Iz that are not free
/// @return false, with p untouched, when the outputs do not allow it or nothing sensible comes out
bool vehicle_by_equation_error(const VehicleRun& run, const VehicleUnknowns& unknowns,
                               VehicleParameters<double>& p);

}  // namespace identikal
