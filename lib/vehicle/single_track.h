// Which numbers make the single-track ("bicycle") model of a car?
//
// Axes and signs: ISO 8855. x forward, y to the left, z up; steering, yaw rate and sideslip are
// positive to the left. Units: SI, angles in radians.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "lib/base/constants.h"
#include "lib/vehicle/axle.h"

namespace identikal {

/// What sensors measure: yaw rate [rad/s], lateral velocity [m/s], lateral acceleration [m/s^2],
/// sideslip angle [rad].
enum class VehicleQuantity { r, vy, ay, beta };
inline constexpr int kVehicleQuantities = 4;

/// How the sensor of a quantity departs from an ideal one at its given place.
template <typename T = double>
struct SensorFault {
  T gain = T(1.0);   ///< measured over true
  T delay = T(0.0);  ///< what it shows is that much older [s]
  T lag = T(0.0);    ///< time constant of its first-order filter [s]
  T x = T(0.0);      ///< further ahead of the centre of gravity than given [m]
  T y = T(0.0);      ///< further to the left [m]
  T angle = T(0.0);  ///< turned further to the left [rad]
};

/// Parameters of the car. The road-wheel angle is delta(t) = steering_gain (angle(t -
/// steering_delay) + steering_offset) / steering_ratio: the offset is added where the angle is
/// measured. When that is at the road wheel, the ratio is 1.
///
/// `bank` is the slope of the road across the car, a positive turn about x (left side up): gravity
/// pulls to the right with g sin(bank). Body roll is not part of it.
/// The scalar may carry derivatives (lib/base/dual.h).
template <typename T = double>
struct SingleTrack {
  T m = T(1.0);   ///< mass [kg]
  T a = T(1.0);   ///< centre of gravity to front axle [m]
  T b = T(1.0);   ///< centre of gravity to rear axle [m]
  T Iz = T(1.0);  ///< yaw moment of inertia [kg m^2]
  Axle<T> front, rear;
  T steering_ratio = T(1.0);
  T steering_gain = T(1.0);
  T steering_offset = T(0.0);    ///< [rad], at the sensor
  T steering_delay = T(0.0);     ///< the wheels follow the measured angle by this much later [s]
  T bias_r = T(0.0);             ///< measured - true [rad/s]
  T bias_vy = T(0.0);            ///< measured - true [m/s]
  T bias_ay = T(0.0);            ///< measured - true [m/s^2]
  T mounting_angle = T(0.0);     ///< turn to the left of the sensor of vy and beta [rad]
  T bank = T(0.0);               ///< [rad]
  T relaxation_length = T(0.0);  ///< sigma of both axles [m]; 0: forces follow at once
  T cg_height = T(0.0);          ///< of the centre of gravity [m]; 0: axle loads are constant
  T load_sensitivity = T(1.0);   ///< relative change of stiffness over that of the axle's load
  T steering_lag = T(0.0);       ///< time constant between the measured angle and the wheels [s]
  T roll_gradient = T(0.0);   ///< steady roll angle over axle forces / m [rad/(m/s^2)]; 0: no roll
  T roll_height = T(0.0);     ///< of the centre of gravity above the roll axis [m]
  T roll_frequency = T(1.5);  ///< [Hz]
  T roll_damping = T(0.35);   ///< over the critical one
  T front_steer_per_roll = T(0.0), rear_steer_per_roll = T(0.0);    ///< [rad/rad]
  T front_camber_per_roll = T(0.0), rear_camber_per_roll = T(0.0);  ///< camber thrust [N/rad]
  T degression = T(0.0);  ///< of a wheel's stiffness with its load, over (dFz/Fz)^2, below 1
  T front_load_transfer = T(0.0), rear_load_transfer = T(0.0);  ///< dFz/Fz over ay [1/(m/s^2)]
  std::array<SensorFault<T>, kVehicleQuantities> sensors{};     ///< in the order of VehicleQuantity
};

/// The scalar parameters in the order in which arrays of them are written here and elsewhere.
enum VehicleParameter {
  kMass,
  kA,
  kB,
  kYawInertia,
  kCf,
  kCr,
  kSteeringRatio,
  kSteeringGain,
  kSteeringOffset,
  kSteeringDelay,
  kBiasR,
  kBiasVy,
  kBiasAy,
  kMountingAngle,
  kBank,
  kRelaxationLength,
  kCgHeight,
  kLoadSensitivity,
  kInverseSaturationFront,  ///< 1/(largest force)^2; to its user the largest force, "Ff_max"
  kInverseSaturationRear,
  kCurveShape,           ///< "curve_shape"
  kCurveCurvature,       ///< "curve_curvature"
  kLagOfSteering,        ///< "steering_lag"
  kRollPerAcceleration,  ///< "roll_gradient"
  kRollHeight,
  kRollFrequency,
  kRollDamping,
  kFrontSteerPerRoll,   ///< "roll_steer_front"
  kRearSteerPerRoll,    ///< "roll_steer_rear"
  kFrontCamberPerRoll,  ///< "roll_camber_front"
  kRearCamberPerRoll,   ///< "roll_camber_rear"
  kSteeringCompliance,  ///< "steering_compliance", of the front axle
  kDegression,          ///< "degression"
  kFrontLoadTransfer,   ///< "load_transfer_front"
  kRearLoadTransfer,    ///< "load_transfer_rear"
  kFirstOfSensors,      ///< SensorProperty of r, vy, ay, beta: sensor_parameter()
  kVehicleParameters = kFirstOfSensors + 6 * kVehicleQuantities
};

/// The entries of SensorFault: "gain_r", "delay_r", "lag_r", "x_r", "y_r", "angle_r", "gain_vy", ...
enum class SensorProperty { gain, delay, lag, x, y, angle };
inline constexpr int kSensorProperties = 6;

/// The parameter that is this property of the sensor of that quantity.
constexpr VehicleParameter sensor_parameter(VehicleQuantity quantity, SensorProperty property) {
  return static_cast<VehicleParameter>(kFirstOfSensors +
                                       kSensorProperties * static_cast<int>(quantity) +
                                       static_cast<int>(property));
}
/// Of a parameter from kFirstOfSensors on: which sensor's, and what of it.
constexpr VehicleQuantity quantity_of(VehicleParameter sensor) {
  return static_cast<VehicleQuantity>((sensor - kFirstOfSensors) / kSensorProperties);
}
constexpr SensorProperty property_of(VehicleParameter sensor) {
  return static_cast<SensorProperty>((sensor - kFirstOfSensors) % kSensorProperties);
}

/// Name in model files.
std::string_view name_of(VehicleParameter parameter);
/// The parameter of that name, if there is one.
std::optional<VehicleParameter> vehicle_parameter(std::string_view name);

template <typename T>
using VehicleParameters = std::array<T, kVehicleParameters>;

/// Neutral values: gains, ratio and load sensitivity 1, no delay, offsets, biases, bank, relaxation,
/// load transfer, compliance, lag, roll or softening, the defaults of CurveShape and of roll's frequency and
/// damping; NaN where there is no neutral value (m, a, b,
/// Iz, Cf, Cr).
VehicleParameters<double> neutral_vehicle();

/// The car of these parameters; a curve does not read what it does not have.
SingleTrack<> car_with(TyreCurve curve, const VehicleParameters<double>& p);

/// The car with linear axles.
SingleTrack<> linear_car(const VehicleParameters<double>& p);

/// A glitch of the measured speed must not lift a wheel off the road.
inline constexpr double kLeastLoadChange = -0.9;

/// Change of an axle's load over its load at standstill that braking and driving make, but no less
/// than kLeastLoadChange: front -h vx'/(g b), rear h vx'/(g a) with h the height of the centre of gravity.
struct LoadChange {
  double front = 0.0, rear = 0.0;
};
LoadChange load_change(const SingleTrack<>& car, double vx_rate);

/// The axle with its load changed by that share: the largest force grows with it, the stiffness with
/// `sensitivity` of it.
Axle<> under_load(Axle<> axle, double change, double sensitivity);

/// What load that goes from the inner wheels to the outer leaves of an axle's stiffness. Of a wheel
/// whose stiffness grows with its load less and less, c(Fz) = p Fz - q Fz^2, two of loads Fz -+ dFz
/// have c(Fz - dFz) + c(Fz + dFz) = 2 c(Fz) - 2 q dFz^2: of the axle remains
///   1 - k (dFz/Fz)^2,  k = q Fz / (p - q Fz),  dFz/Fz = transfer |ay|, at most 1,
/// beyond which the inner wheel has left the road (Milliken & Milliken 1995, chapter 18). A rigid
/// body with its centre of gravity at height h on axles of track t, of which an axle carries the
/// share s of the roll moment, has transfer = 2 h s (a + b)/(g t b) in front and 2 h s (a + b)/(g t a)
/// behind; with shares as the axle loads both are 2 h/(g t).
///
/// Example:
///
///     const double transfer = 2.0 * 0.5 / (9.81 * 1.5);  // h = .5 m, t = 1.5 m
///     const double left = left_by_load_transfer(0.3, transfer, 6.0).value;  // .95 at 6 m/s^2
///
/// @param degression  k
struct LeftByLoadTransfer {
  double value = 1.0;
  double by_degression = 0.0, by_transfer = 0.0, by_ay = 0.0;
};
LeftByLoadTransfer left_by_load_transfer(double degression, double transfer, double ay);

/// The car with stiffnesses as that lateral acceleration leaves them.
SingleTrack<> with_load_transfer(SingleTrack<> car, double ay);

/// x' = A x + B delta with x = (vy, r) and delta the road-wheel angle, at constant vx > 0.
/// Sladká (2010), eq (7.4), with row 2, column 1 after the moment balance (7.3), -(a Cf - b Cr)/(Iz
/// vx); the source prints -(a Cf + b Cr). Without bank.
///
/// Example:
///
///     VehicleParameters<double> p = neutral_vehicle();
///     p[kMass] = 1446.0, p[kYawInertia] = 2319.0, p[kA] = 0.987, p[kB] = 1.525;
///     p[kCf] = p[kCr] = 88107.7;
///     const SingleTrackMatrices at_60_km_h = single_track_matrices(linear_car(p), 60.0 / 3.6);
struct SingleTrackMatrices {
  Eigen::Matrix2d A;
  Eigen::Vector2d B;
};
SingleTrackMatrices single_track_matrices(const SingleTrack<>& car, double vx);

/// Sum of the decay rates of both modes times vx [m/s^2]: (Cf + Cr)/m + (a^2 Cf + b^2 Cr)/Iz.
/// Divided by vx it bounds the fastest pole, which grows without limit as the car slows down.
double decay_rate_times_speed(const SingleTrack<>& car);

}  // namespace identikal
