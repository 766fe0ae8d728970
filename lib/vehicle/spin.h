// Where does a car spin, and where does its driver hold it in a slide?
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// A car that has lost its grip: rows from where the driver steers against the turn, or the sideslip
/// exceeds 12 deg, until it runs straight again.
struct Spin {
  Eigen::Index first = 0, rows = 0;
  double sideslip = 0.0;  ///< the largest, 0 to pi [rad]; NaN where it is not measured
};

/// What a spin shows in; NaN where missing, N samples each. A quantity without a sensor is empty.
struct SpinSignals {
  Eigen::VectorXd time;      ///< [s]
  Eigen::VectorXd steering;  ///< at the wheel or at the road, positive to the left
  Eigen::VectorXd vx;        ///< [m/s]
  Eigen::VectorXd r;         ///< [rad/s]
  Eigen::VectorXd vy;        ///< [m/s]; empty where sideslip is not measured
};

/// Spins of a drive. With sideslip measured: above 25 deg for 0.2 s, at more than 3 m/s. Without: the
/// driver steers against the yaw rate for 0.5 s while vx |r| is above 6 m/s^2, and steered with it
/// for most of the turning before; steering and yaw rate with opposite signs throughout are no spin.
/// A spin ends where for half a second |vx r| is below 2 m/s^2 and the sideslip, if measured, below 6
/// deg.
///
/// Example:
///
///     for (const Spin& spin : find_spins({time, u.row(0), u.row(1), y.row(0), {}})) {
///       std::printf("spins at %g s\n", time[spin.first]);
///     }
std::vector<Spin> find_spins(const SpinSignals& signals);

/// Slides that a driver holds by countersteering (a drift), outside of `spins`: he steers against a
/// turn of more than 3 m/s^2 for longer than twice the time vx/(10 g) in which a car on tyres of 10
/// 1/rad times its load answers, and for 0.3 s at least, and steered with most of the turning before.
/// Where sideslip is measured it exceeds 6 deg there.
std::vector<Spin> find_countersteering(const SpinSignals& signals, const std::vector<Spin>& spins);

}  // namespace identikal
