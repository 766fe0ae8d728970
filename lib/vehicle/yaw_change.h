// How quickly does the yaw rate of a drive change?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Root mean square of the change from one mean over `block` seconds to the next, over that of the
/// means: about pi block f for a yaw rate that swings at f < 1/(2 block) Hz, 0 in a steady turn. Yaw
/// inertia acts only on what changes. What is no motion is taken out: of each mean the variance that
/// the scatter of its samples about a line leaves it, which is that of noise and of single wild rows,
/// and the variance step^2/12 of a sensor's steps, where it shows five levels or more.
/// @param time  [s], N entries; where it does not go on by the usual step no block reaches across
/// @param r     yaw rate in any unit, N entries; NaN where it is missing or does not count
/// @return NaN of fewer than four blocks in all
///
/// Example:
///
///     const double change = yaw_change(time, y.row(0).transpose(), 0.5);
///     if (change < 0.15) std::puts("steady turns: Iz stays open");
double yaw_change(const Eigen::VectorXd& time, const Eigen::VectorXd& r, double block);

/// Whether the car was in steady turns all the time: yaw_change() is below 0.15 over half a second,
/// and below half of that over an eighth of a second, where half a second averages quick steering out.
bool turns_steadily(const Eigen::VectorXd& time, const Eigen::VectorXd& r);

}  // namespace identikal
