#include "lib/vehicle/sensor.h"

#include <cmath>

namespace identikal {

std::optional<VehicleQuantity> vehicle_quantity(std::string_view name) {
  if (name == "r") return VehicleQuantity::r;
  if (name == "vy") return VehicleQuantity::vy;
  if (name == "ay") return VehicleQuantity::ay;
  if (name == "beta") return VehicleQuantity::beta;
  return std::nullopt;
}

VehicleReading::VehicleReading(const VehicleSensor& sensor, const SingleTrack<>& car)
    : quantity_(sensor.quantity), bias_(0.0) {
  const SensorFault<>& fault = car.sensors[static_cast<std::size_t>(quantity_)];
  x_ = sensor.x + fault.x;
  y_ = sensor.y + fault.y;
  angle_ = sensor.angle + fault.angle;
  gain_ = fault.gain;
  if (quantity_ == VehicleQuantity::r) bias_ = car.bias_r;
  if (quantity_ == VehicleQuantity::ay) bias_ = car.bias_ay;
  if (quantity_ == VehicleQuantity::vy) bias_ = car.bias_vy;
  if (quantity_ == VehicleQuantity::vy || quantity_ == VehicleQuantity::beta) {
    angle_ += car.mounting_angle;
  }
  cos_ = std::cos(angle_);
  sin_ = std::sin(angle_);
}

double VehicleReading::true_value(const Motion& motion, double vx) const {
  const double r = motion.r, w = motion.yaw_acceleration;
  switch (quantity_) {
    case VehicleQuantity::r:
      return r;
    case VehicleQuantity::ay: {
      const double ay = motion.ay + w * x_ - r * r * y_;
      const double ax = motion.vx_rate - r * motion.vy - r * r * x_ - w * y_;
      return ay * cos_ - ax * sin_;
    }
    case VehicleQuantity::vy:
      return (motion.vy + r * x_) * cos_ - (vx - r * y_) * sin_;
    case VehicleQuantity::beta:
      break;
  }
  return std::atan2(motion.vy + r * x_, vx - r * y_) - angle_;
}

double VehicleReading::value(const Motion& motion, double vx) const {
  return gain_ * true_value(motion, vx) + bias_;
}

double VehicleReading::lateral_velocity(double measured, double vx, double r) const {
  const double vx_there = vx - r * y_, is = (measured - bias_) / gain_;
  const double vy_there = quantity_ == VehicleQuantity::beta ? vx_there * std::tan(is + angle_)
                                                             : (is + vx_there * sin_) / cos_;
  return vy_there - r * x_;
}

void VehicleReading::jacobian(const Motion& motion, double vx, const JacobianColumns& columns,
                              const MotionJacobian& by, Eigen::Ref<Eigen::RowVectorXd> out) const {
  const double r = motion.r, w = motion.yaw_acceleration;
  const double vx_s = vx - r * y_, vy_s = motion.vy + r * x_;
  const double lever = cos_ * x_ + sin_ * y_;
  const auto add = [&](VehicleParameter parameter, double slope) {
    const Eigen::Index at = columns.parameter[parameter];
    if (at >= 0) out[at] += slope;
  };
  const auto add_fault = [&](SensorProperty property, double slope) {
    add(sensor_parameter(quantity_, property), gain_ * slope);
  };
  switch (quantity_) {
    case VehicleQuantity::r:
      out = gain_ * by.r;
      add(kBiasR, 1.0);
      break;
    case VehicleQuantity::ay: {
      const double ay_s = motion.ay + w * x_ - r * r * y_;
      const double ax_s = motion.vx_rate - r * motion.vy - r * r * x_ - w * y_;
      out = gain_ *
            (cos_ * by.ay + lever * by.yaw_acceleration +
             (2.0 * r * (sin_ * x_ - cos_ * y_) + sin_ * motion.vy) * by.r + (sin_ * r) * by.vy);
      add_fault(SensorProperty::x, cos_ * w + sin_ * r * r);
      add_fault(SensorProperty::y, sin_ * w - cos_ * r * r);
      add_fault(SensorProperty::angle, -sin_ * ay_s - cos_ * ax_s);
      add(kBiasAy, 1.0);
      break;
    }
    case VehicleQuantity::vy: {
      const double by_angle = -sin_ * vy_s - cos_ * vx_s;
      out = gain_ * (cos_ * by.vy + lever * by.r);
      add_fault(SensorProperty::x, cos_ * r);
      add_fault(SensorProperty::y, sin_ * r);
      add_fault(SensorProperty::angle, by_angle);
      add(kMountingAngle, gain_ * by_angle);
      add(kBiasVy, 1.0);
      break;
    }
    case VehicleQuantity::beta: {
      const double square = vx_s * vx_s + vy_s * vy_s;
      out = gain_ * ((vx_s / square) * by.vy + ((vx_s * x_ + vy_s * y_) / square) * by.r);
      add_fault(SensorProperty::x, vx_s * r / square);
      add_fault(SensorProperty::y, vy_s * r / square);
      add_fault(SensorProperty::angle, -1.0);
      add(kMountingAngle, -gain_);
      break;
    }
  }
  add(sensor_parameter(quantity_, SensorProperty::gain), true_value(motion, vx));
}

}  // namespace identikal
