// How does the car move when sensors elsewhere measure speed and direction? Several vector sensors
// to the velocities of the centre of gravity.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// A sensor of the size U of the velocity and of its direction alpha, the slip angle, positive when
/// the point moves to the left of the sensor's axis (ISO 8855).
struct VectorSensor {
  double x = 0.0, y = 0.0;  ///< from the centre of gravity, forward and to the left [m]
  double mounting = 0.0;    ///< angle of the sensor's axis from the car's, positive left [rad]
  double speed_sd = 0.0;    ///< standard deviation of U [m/s], > 0
  double slip_sd = 0.0;     ///< standard deviation of alpha [rad], > 0
};

/// Velocities at the centre of gravity, sample by sample.
struct CentreVelocity {
  Eigen::Matrix3Xd value;  ///< 3 x N: vx [m/s], vy [m/s], r [rad/s]; NaN where a reading is missing
  std::vector<Eigen::Matrix3d> covariance;  ///< N, of the errors that speed_sd and slip_sd make
};

/// Weighted least squares over all equations of a rigid body,
///   U cos(alpha + mounting) = vx - r y,  U sin(alpha + mounting) = vy + r x,
/// two per sensor, three unknowns. A reading errs by speed_sd along its direction and by
/// U slip_sd across; covariance (H' W H)^-1 with these as weights. First order in slip_sd: the mean
/// of U cos(alpha) falls by the share slip_sd^2 / 2.
///
/// Example:
///
///     const std::vector<VectorSensor> sensors{{.x = 1.9, .speed_sd = 0.05, .slip_sd = 0.003},
///                                             {.x = -2.1, .speed_sd = 0.05, .slip_sd = 0.003}};
///     const CentreVelocity centre = centre_velocity(sensors, y.topRows(2), y.bottomRows(2));
///
/// Source: Sladká (2010), section 8.3, where two sensors are used; the equations are those of a
/// rigid body.
/// @param sensors  S >= 2; @param speed  S x N, U [m/s], > 0 or it counts as missing
/// @param slip     S x N, alpha [rad]; NaN = missing
/// @throws std::invalid_argument in words: fewer than two sensors, sensors at one point (closer
///   than a millimetre, so that a turn cannot be seen), a standard deviation that is not positive,
///   shapes that disagree
CentreVelocity centre_velocity(const std::vector<VectorSensor>& sensors,
                               const Eigen::Ref<const Eigen::MatrixXd>& speed,
                               const Eigen::Ref<const Eigen::MatrixXd>& slip);

}  // namespace identikal
