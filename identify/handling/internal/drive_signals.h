// What did the car do, measured or simulated, in the same quantities?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "identify/vehicle/usable_data.h"
#include "lib/vehicle/single_track.h"

namespace identikal {

/// Rows of a log, SI; NaN where there is nothing. Biases of the sensors that the car's parameters
/// name are taken off.
struct DriveSignals {
  std::vector<VehicleRun::Segment> segments;
  double step = kNone;       ///< between rows [s]
  Eigen::VectorXd time;      ///< [s]
  Eigen::VectorXd steering;  ///< as measured [rad]
  Eigen::VectorXd vx;        ///< [m/s]
  Eigen::VectorXd r;         ///< [rad/s]
  Eigen::VectorXd ay;        ///< where its sensor sits [m/s^2]
  Eigen::VectorXd beta;      ///< vy / vx of the centre of gravity [rad]
};

/// What was measured.
DriveSignals measured_signals(const VehicleRun& run, const VehicleParameters<double>& p);

/// What the car of these parameters does along the same steering and speed, every segment from the
/// measured state or that of steady driving.
DriveSignals simulated_signals(const VehicleRun& run, TyreCurve curve,
                               const VehicleParameters<double>& p);

/// Straight driving at this speed and then a step of steering (ISO 7401) to the angle of this
/// steady lateral acceleration, as the car's sensor of the angle sees it: five seconds, from which
/// simulated_signals() and the figures of steps are made as from a log. Its yaw rate is an output
/// without any sample.
VehicleRun step_run(TyreCurve curve, const VehicleParameters<double>& p, double vx, double ay);

}  // namespace identikal
