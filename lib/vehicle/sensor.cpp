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
    : quantity_(sensor.quantity), x_(sensor.x), y_(sensor.y), angle_(sensor.angle) {
  switch (quantity_) {
    case VehicleQuantity::r:
      bias_ = car.bias_r;
      break;
    case VehicleQuantity::ay:
      bias_ = car.bias_ay;
      break;
    case VehicleQuantity::vy:
      bias_ = car.bias_vy;
      angle_ += car.mounting_angle;
      break;
    case VehicleQuantity::beta:
      angle_ += car.mounting_angle;
      bias_ = -angle_;
      break;
  }
  cos_ = std::cos(angle_);
  sin_ = std::sin(angle_);
}

double VehicleReading::value(const Motion& motion, double vx) const {
  const double r = motion.r, w = motion.yaw_acceleration;
  switch (quantity_) {
    case VehicleQuantity::r:
      return r + bias_;
    case VehicleQuantity::ay: {
      const double ay = motion.ay + w * x_ - r * r * y_;
      const double ax = motion.vx_rate - r * motion.vy - r * r * x_ - w * y_;
      return ay * cos_ - ax * sin_ + bias_;
    }
    case VehicleQuantity::vy:
      return (motion.vy + r * x_) * cos_ - (vx - r * y_) * sin_ + bias_;
    case VehicleQuantity::beta:
      break;
  }
  return std::atan2(motion.vy + r * x_, vx - r * y_) + bias_;
}

double VehicleReading::lateral_velocity(double measured, double vx, double r) const {
  const double vx_there = vx - r * y_;
  const double vy_there = quantity_ == VehicleQuantity::beta
                              ? vx_there * std::tan(measured - bias_)
                              : (measured - bias_ + vx_there * sin_) / cos_;
  return vy_there - r * x_;
}

void VehicleReading::jacobian(const Motion& motion, double vx, const JacobianColumns& columns,
                              const MotionJacobian& by, Eigen::Ref<Eigen::RowVectorXd> out) const {
  const auto add = [&](VehicleParameter parameter, double slope) {
    const Eigen::Index at = columns.parameter[parameter];
    if (at >= 0) out[at] += slope;
  };
  const double vx_s = vx - motion.r * y_, vy_s = motion.vy + motion.r * x_;
  const double lever = cos_ * x_ + sin_ * y_;
  switch (quantity_) {
    case VehicleQuantity::r:
      out = by.r;
      add(kBiasR, 1.0);
      return;
    case VehicleQuantity::ay:
      out = cos_ * by.ay + lever * by.yaw_acceleration +
            (2.0 * motion.r * (sin_ * x_ - cos_ * y_) + sin_ * motion.vy) * by.r +
            (sin_ * motion.r) * by.vy;
      add(kBiasAy, 1.0);
      return;
    case VehicleQuantity::vy:
      out = cos_ * by.vy + lever * by.r;
      add(kMountingAngle, -sin_ * vy_s - cos_ * vx_s);
      add(kBiasVy, 1.0);
      return;
    case VehicleQuantity::beta: {
      const double square = vx_s * vx_s + vy_s * vy_s;
      out = (vx_s / square) * by.vy + ((vx_s * x_ + vy_s * y_) / square) * by.r;
      add(kMountingAngle, -1.0);
      return;
    }
  }
}

}  // namespace identikal
