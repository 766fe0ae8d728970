// What is a car given along a segment of a recording: steering, speed and measured roll at every
// point of time that the integrator visits.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Inputs of one uninterrupted segment of a recording, at every point of time that the integrator
/// visits. They are interpolated once; of the parameters only a steering delay moves them.
struct DrivenSegment {
  struct Node {
    double steering;  ///< as measured, `delay` earlier and filtered by `lag` [rad]
    double vx;        ///< [m/s]
    double inverse_vx;
    double steering_rate = 0.0;    ///< [rad/s]
    double vx_rate = 0.0;          ///< [m/s^2]
    double steering_by_lag = 0.0;  ///< derivative of `steering` by the lag [rad/s]
    double roll = 0.0;             ///< of the body where it is measured, left side up [rad]
    double roll_rate = 0.0;        ///< [rad/s]
  };
  struct Interval {
    int steps;    ///< Runge-Kutta steps between two samples
    double step;  ///< of this length [s]
  };
  std::vector<Interval> intervals;  ///< N - 1
  std::vector<Node> nodes;  ///< begin, middle and end of every step; neighbours share theirs
  double delay = 0.0;       ///< that the steering was read with [s]
  double lag = 0.0;         ///< time constant between the measured angle and the wheels [s]
  Eigen::Index rows() const { return static_cast<Eigen::Index>(intervals.size()) + 1; }
};

/// What the integration steps have to follow.
struct IntegrationDemand {
  double decay_rate = 0.0;         ///< decay_rate_times_speed() of the stiffest car to be expected
  double relaxation_length = 0.0;  ///< the shortest to be expected [m]; 0: none
  double longest_step = 0.01;      ///< [s], that of Sladká (2010), section 9.1
};

/// Prepares a segment: steering and vx between samples by Pchip, Runge-Kutta steps of at most
/// `longest_step`, 0.35 / (decay_rate / vx) and 0.7 relaxation_length / vx. Before the first and
/// after the last sample, where a delay may reach, the steering stands still.
///
/// Example:
///
///     const IntegrationDemand demand{decay_rate_times_speed(car)};
///     const DrivenSegment driven = drive(time, u.row(0), u.row(1), demand);
///
/// @param time      N >= 2 strictly increasing time stamps [s], any spacing
/// @param steering  N measured steering angles [rad]
/// @param vx        N forward speeds [m/s], > 0
/// @param delay     by which the steering is read earlier [s]
/// @param lag       time constant of the first-order filter that it then passes [s]
/// @throws std::invalid_argument when the shapes disagree, N < 2 or a speed is not positive
DrivenSegment drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay = 0.0,
                    double lag = 0.0);

/// Reads the steering again with another delay and lag; everything else stays. The filter begins at
/// rest.
/// @param time, steering  those the segment was made of
void set_delay(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay, double lag = 0.0);

/// Gives the body a measured roll angle, N values [rad]; its rate is the slope of straight lines
/// through the samples within 40 ms.
void set_roll(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& roll);

/// The same segment with a row at every integration step, and the times of these rows.
/// @param time  those the segment was made of
DrivenSegment with_every_step(const DrivenSegment& segment);
Eigen::VectorXd times_of_steps(const DrivenSegment& segment, const Eigen::VectorXd& time);

}  // namespace identikal
