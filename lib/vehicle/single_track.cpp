#include "lib/vehicle/single_track.h"

#include <algorithm>

#include "lib/base/constants.h"

namespace identikal {
namespace {

constexpr std::array<std::string_view, kVehicleParameters> kNames = {"m",
                                                                     "a",
                                                                     "b",
                                                                     "Iz",
                                                                     "Cf",
                                                                     "Cr",
                                                                     "steering_ratio",
                                                                     "steering_gain",
                                                                     "steering_offset",
                                                                     "steering_delay",
                                                                     "bias_r",
                                                                     "bias_vy",
                                                                     "bias_ay",
                                                                     "mounting_angle",
                                                                     "bank",
                                                                     "relaxation_length",
                                                                     "cg_height",
                                                                     "load_sensitivity",
                                                                     "Ff_max",
                                                                     "Fr_max",
                                                                     "curve_shape",
                                                                     "curve_curvature",
                                                                     "steering_lag",
                                                                     "roll_gradient",
                                                                     "roll_height",
                                                                     "roll_frequency",
                                                                     "roll_damping",
                                                                     "roll_steer_front",
                                                                     "roll_steer_rear",
                                                                     "roll_camber_front",
                                                                     "roll_camber_rear",
                                                                     "steering_compliance",
                                                                     "degression",
                                                                     "load_transfer_front",
                                                                     "load_transfer_rear",
                                                                     "gain_r",
                                                                     "delay_r",
                                                                     "lag_r",
                                                                     "x_r",
                                                                     "y_r",
                                                                     "angle_r",
                                                                     "gain_vy",
                                                                     "delay_vy",
                                                                     "lag_vy",
                                                                     "x_vy",
                                                                     "y_vy",
                                                                     "angle_vy",
                                                                     "gain_ay",
                                                                     "delay_ay",
                                                                     "lag_ay",
                                                                     "x_ay",
                                                                     "y_ay",
                                                                     "angle_ay",
                                                                     "gain_beta",
                                                                     "delay_beta",
                                                                     "lag_beta",
                                                                     "x_beta",
                                                                     "y_beta",
                                                                     "angle_beta"};

}  // namespace

std::string_view name_of(VehicleParameter parameter) { return kNames[parameter]; }

std::optional<VehicleParameter> vehicle_parameter(std::string_view name) {
  const auto found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<VehicleParameter>(found - kNames.begin());
}

VehicleParameters<double> neutral_vehicle() {
  VehicleParameters<double> p{};
  for (const VehicleParameter known : {kMass, kA, kB, kYawInertia, kCf, kCr}) {
    p[known] = kNaN;
  }
  p[kSteeringRatio] = 1.0;
  p[kSteeringGain] = 1.0;
  p[kLoadSensitivity] = 1.0;
  p[kCurveShape] = CurveShape().shape;
  p[kCurveCurvature] = CurveShape().curvature;
  p[kRollFrequency] = SingleTrack<>().roll_frequency;
  p[kRollDamping] = SingleTrack<>().roll_damping;
  for (int q = 0; q < kVehicleQuantities; ++q) {
    p[sensor_parameter(static_cast<VehicleQuantity>(q), SensorProperty::gain)] = 1.0;
  }
  return p;
}

SingleTrackMatrices single_track_matrices(const SingleTrack<>& car, double vx) {
  const double Cf = car.front.effective_stiffness(), Cr = car.rear.effective_stiffness();
  const double a = car.a, b = car.b;
  SingleTrackMatrices out;
  out.A << -(Cf + Cr) / (car.m * vx), -vx - (a * Cf - b * Cr) / (car.m * vx),
      -(a * Cf - b * Cr) / (car.Iz * vx), -(a * a * Cf + b * b * Cr) / (car.Iz * vx);
  out.B << Cf / car.m, a * Cf / car.Iz;
  return out;
}

LoadChange load_change(const SingleTrack<>& car, double vx_rate) {
  const double moment = car.cg_height * vx_rate / kStandardGravity;
  return {std::max(kLeastLoadChange, -moment / car.b), std::max(kLeastLoadChange, moment / car.a)};
}

Axle<> under_load(Axle<> axle, double change, double sensitivity) {
  axle.stiffness *= 1.0 + sensitivity * change;
  axle.softening /= (1.0 + change) * (1.0 + change);
  return axle;
}

LeftByLoadTransfer left_by_load_transfer(double degression, double transfer, double ay) {
  const double moved = transfer * ay;
  if (moved * moved >= 1.0) return {1.0 - degression, -1.0, 0.0, 0.0};
  return {1.0 - degression * moved * moved, -moved * moved, -2.0 * degression * moved * ay,
          -2.0 * degression * moved * transfer};
}

SingleTrack<> with_load_transfer(SingleTrack<> car, double ay) {
  car.front.stiffness *= left_by_load_transfer(car.degression, car.front_load_transfer, ay).value;
  car.rear.stiffness *= left_by_load_transfer(car.degression, car.rear_load_transfer, ay).value;
  return car;
}

double decay_rate_times_speed(const SingleTrack<>& car) {
  const double Cf = car.front.effective_stiffness(), Cr = car.rear.effective_stiffness();
  return (Cf + Cr) / car.m + (car.a * car.a * Cf + car.b * car.b * Cr) / car.Iz;
}

SingleTrack<> car_with(TyreCurve curve, const VehicleParameters<double>& p) {
  SingleTrack<> car;
  car.m = p[kMass];
  car.a = p[kA];
  car.b = p[kB];
  car.Iz = p[kYawInertia];
  car.front = {p[kCf], p[kInverseSaturationFront], p[kCurveShape], p[kCurveCurvature], curve};
  car.rear = {p[kCr], p[kInverseSaturationRear], p[kCurveShape], p[kCurveCurvature], curve};
  car.front.compliance = p[kSteeringCompliance];
  car.degression = p[kDegression];
  car.front_load_transfer = p[kFrontLoadTransfer];
  car.rear_load_transfer = p[kRearLoadTransfer];
  car.steering_ratio = p[kSteeringRatio];
  car.steering_gain = p[kSteeringGain];
  car.steering_offset = p[kSteeringOffset];
  car.steering_delay = p[kSteeringDelay];
  car.bias_r = p[kBiasR];
  car.bias_vy = p[kBiasVy];
  car.bias_ay = p[kBiasAy];
  car.mounting_angle = p[kMountingAngle];
  car.bank = p[kBank];
  car.relaxation_length = p[kRelaxationLength];
  car.cg_height = p[kCgHeight];
  car.load_sensitivity = p[kLoadSensitivity];
  car.steering_lag = p[kLagOfSteering];
  car.roll_gradient = p[kRollPerAcceleration];
  car.roll_height = p[kRollHeight];
  car.roll_frequency = p[kRollFrequency];
  car.roll_damping = p[kRollDamping];
  car.front_steer_per_roll = p[kFrontSteerPerRoll];
  car.rear_steer_per_roll = p[kRearSteerPerRoll];
  car.front_camber_per_roll = p[kFrontCamberPerRoll];
  car.rear_camber_per_roll = p[kRearCamberPerRoll];
  for (int q = 0; q < kVehicleQuantities; ++q) {
    const auto of = [&](SensorProperty property) {
      return p[sensor_parameter(static_cast<VehicleQuantity>(q), property)];
    };
    using enum SensorProperty;
    car.sensors[q] = {of(gain), of(delay), of(lag), of(x), of(y), of(angle)};
  }
  return car;
}

SingleTrack<> linear_car(const VehicleParameters<double>& p) {
  return car_with(TyreCurve::linear, p);
}

}  // namespace identikal
