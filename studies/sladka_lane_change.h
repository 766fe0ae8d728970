// What would the recording of Sladká (2010), chapter 8, have been without noise?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/vehicle/manoeuvre.h"

namespace identikal {

inline constexpr Eigen::Index kSladka2010Samples = 70;  ///< section 8.3: 7 s at 10 Hz
inline constexpr double kSladka2010Step = 0.1;          ///< [s]

struct TrueDrive {
  Eigen::VectorXd time, steering, vx;  ///< of the samples, SI; angle at the steering wheel
  Eigen::MatrixXd states;              ///< 2 x N: vy [m/s], r [rad/s]
  Eigen::Matrix3Xd track;              ///< 3 x N (lib/vehicle/trajectory.h)
};

/// The car of table 8.1 through a lane change, integrated from steering in continuous time.
/// @param from_speed, to_speed  [m/s], in between linear in time
TrueDrive true_drive(const SevereLaneChange& manoeuvre, double from_speed, double to_speed);

/// A model file for that car, in SI: mass, lengths and steering ratio known; Iz free from its true
/// value, Cf and Cr free from 8e4 N/rad; inputs steering_wheel_angle and vx.
/// @param outputs  of "r", "vy", "ay", "beta"
Model sladka2010_model(const std::vector<std::string>& outputs = {"r", "vy"});

}  // namespace identikal
