#include "tests/campaigns/vehicle_drive_bound.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"

namespace identikal {
namespace {

/// Rows r, vy, ay, without noise.
Eigen::MatrixXd outputs(const SingleTrack<>& car, const SecondaryEffects& effects,
                        const VehicleDrive& drive) {
  const DrivenSegment driven = identikal::drive(
      drive.recording.time, drive.steering,
      Eigen::VectorXd::Constant(drive.steering.size(), drive.speed), {.longest_step = 0.005});
  Eigen::MatrixXd out(3, drive.steering.size());
  simulate_with_effects(car, effects, driven, 0.0, 0.0,
                        [&](Eigen::Index k, const Motion& motion, double) {
                          out.col(k) << motion.r, motion.vy, motion.ay;
                        });
  return out;
}

struct Unknown {
  SecondaryEffect effect;
  double sd;  // as draw_vehicle_drive() has it: none of it in two of five cars
};

/// Standard deviation of what is zero in two of five, else even from low to high.
double drawn(double low, double high) {
  const double mean = 0.5 * (low + high), spread = (high - low) * (high - low) / 12.0;
  return std::sqrt(0.6 * (mean * mean + spread) - 0.36 * mean * mean);
}

std::vector<Unknown> unknown_effects(const SingleTrack<>& car) {
  const double wheelbase = car.a + car.b;
  const double front = car.m * car.b / wheelbase / car.front.stiffness;
  const double rear = car.m * car.a / wheelbase / car.rear.stiffness;
  return {{kTyreRelaxation, drawn(0.02, 0.2) * wheelbase},
          {kSteeringLag, drawn(0.0, 0.02)},
          {kRollGradient, drawn(0.0, 0.012)},
          {kRollSteerFront, drawn(-0.15, 0.15) * front},
          {kRollSteerRear, drawn(-0.15, 0.15) * rear},
          {kTyreSoftening, 0.9 / std::sqrt(12.0)}};
}

}  // namespace

std::array<double, 3> least_errors(const VehicleDrive& drive, Insight insight) {
  const std::vector<Unknown> effects =
      insight == Insight::everything ? std::vector<Unknown>{} : unknown_effects(drive.car);
  const Eigen::MatrixXd at = outputs(drive.car, drive.effects, drive);
  const double small = drive.car.m < 50.0 ? 0.1 : 1.0;
  const Eigen::Vector3d sd(0.12 / kDegreesPerRadian, 0.025 * small, 0.06);
  std::vector<Eigen::MatrixXd> by;
  const auto add = [&](SingleTrack<> car, const SecondaryEffects& with, double step) {
    by.push_back((outputs(car, with, drive) - at) / step);
  };
  for (double SingleTrack<>::*free : {&SingleTrack<>::Iz, &SingleTrack<>::steering_offset}) {
    SingleTrack<> car = drive.car;
    constexpr double step = 1e-3;
    car.*free = free == &SingleTrack<>::Iz ? car.*free * (1.0 + step) : step;
    add(car, drive.effects, step);
  }
  for (Axle<> SingleTrack<>::*axle : {&SingleTrack<>::front, &SingleTrack<>::rear}) {
    SingleTrack<> car = drive.car;
    (car.*axle).stiffness *= 1.001;
    add(car, drive.effects, 1e-3);
  }
  for (const Unknown& unknown : effects) {
    SecondaryEffects more = drive.effects;
    more[unknown.effect] += 0.05 * unknown.sd;
    add(drive.car, more, 0.05);  // over its standard deviation
  }
  const auto parameters = static_cast<Eigen::Index>(by.size());
  const auto samples = at.cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(parameters, parameters);
  const std::array<const char*, 3> names = {"r", "vy", "ay"};
  for (Eigen::Index j = 0; j < 3; ++j) {
    const auto& measured = drive.recording.outputs;
    if (std::none_of(measured.begin(), measured.end(), [&](const auto& channel) {
          return channel.name == names[static_cast<std::size_t>(j)];
        })) {
      continue;
    }
    Eigen::MatrixXd J(samples, parameters);
    for (Eigen::Index i = 0; i < parameters; ++i) {
      J.col(i) = by[static_cast<std::size_t>(i)].row(j).transpose() / sd[j];
    }
    J.rowwise() -= J.colwise().mean().eval();  // its bias is unknown
    information += J.transpose() * J;
  }
  for (Eigen::Index i = 4; i < parameters; ++i) information(i, i) += 1.0;
  const Eigen::MatrixXd covariance =
      information.ldlt().solve(Eigen::MatrixXd::Identity(parameters, parameters));
  return {std::sqrt(covariance(2, 2)), std::sqrt(covariance(3, 3)), std::sqrt(covariance(0, 0))};
}

}  // namespace identikal
