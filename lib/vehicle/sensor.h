// What does a sensor in the car measure?
#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "lib/vehicle/motion.h"

namespace identikal {

/// The quantity of that name: "r", "vy", "ay" or "beta".
std::optional<VehicleQuantity> vehicle_quantity(std::string_view name);

/// What a sensor at (x, y) from the centre of gravity measures:
///   r:    gain r + bias_r
///   vy:   gain (vy_s cos(angle) - vx_s sin(angle)) + bias_vy,  vx_s = vx - r y,  vy_s = vy + r x
///   ay:   gain (ay_s cos(angle) - ax_s sin(angle)) + bias_ay,  ay_s = ay + r' x - r^2 y,
///         ax_s = vx' - r vy - r^2 x - r' y
///   beta: gain (atan2(vy_s, vx_s) - angle)
/// A sensor turned to the left by `angle` sees the car's motion turned to the right. Place and angle
/// are those given here and on top of them the car's (SingleTrack::sensors), for vy and beta its
/// mounting_angle too. Lag and delay are those of lib/vehicle/late_sensor.h.
///
/// Example:
///
///     const VehicleSensor at_the_dash{.quantity = VehicleQuantity::ay, .x = 0.8};
///     const VehicleReading reading(at_the_dash, car);
///     Motion turn{};
///     turn.r = 0.2, turn.ay = 4.0;
///     const double ay = reading.value(turn, 20.0);  // at 20 m/s
struct VehicleSensor {
  VehicleQuantity quantity = VehicleQuantity::r;
  double x = 0.0;      ///< [m]
  double y = 0.0;      ///< [m]
  double angle = 0.0;  ///< [rad]
};

class VehicleReading {
 public:
  VehicleReading(const VehicleSensor& sensor, const SingleTrack<>& car);

  /// What is measured at this motion and forward speed [m/s].
  double value(const Motion& motion, double vx) const;

  /// The lateral velocity of the centre of gravity [m/s] that a reading of a sensor of vy or beta
  /// means: value() turned round.
  /// @param r  yaw rate [rad/s]
  double lateral_velocity(double measured, double vx, double r) const;

  /// Its derivatives, from those of the motion.
  /// @param out  columns.columns of them
  void jacobian(const Motion& motion, double vx, const JacobianColumns& columns,
                const MotionJacobian& by, Eigen::Ref<Eigen::RowVectorXd> out) const;

 private:
  /// Without gain and bias.
  double true_value(const Motion& motion, double vx) const;

  VehicleQuantity quantity_;
  double x_, y_, angle_, cos_, sin_, gain_, bias_;
};

}  // namespace identikal
