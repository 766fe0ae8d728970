// What does a sensor that filters and is late show?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Samples in rows: column 0 is a signal, the others are its derivatives by the caller's unknowns.
using SignalRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The solution of T y' = x - y, y = x at the first sample, in place. x goes evenly from sample to
/// sample, and the solution is exact for that, whatever T is.
/// @param time    N >= 2 increasing time stamps [s]
/// @param lag     T >= 0 [s]
/// @param x       N rows
/// @param by_lag  column of the derivative by T, to which it is added; -1: none
void filter_by_lag(const Eigen::VectorXd& time, double lag, SignalRows& x,
                   Eigen::Index by_lag = -1);

/// y(t - delay) by cubics through four neighbouring samples; before the first sample and after the
/// last one y stands still.
///
/// Example:
///
///     SignalRows yaw_rate = y.row(0).transpose();  // one column, samples at `time`
///     filter_by_lag(time, 0.02, yaw_rate);            // a filter of 8 Hz
///     yaw_rate = late(time, yaw_rate, time, 0.1);     // 100 ms on its way
///
/// @param at        increasing times to read at [s]
/// @param delay     [s]; negative: what comes later
/// @param by_delay  column of the derivative by the delay, to which it is added; -1: none
/// @return as many rows as `at` has
SignalRows late(const Eigen::VectorXd& time, const SignalRows& y, const Eigen::VectorXd& at,
                double delay, Eigen::Index by_delay = -1);

}  // namespace identikal
