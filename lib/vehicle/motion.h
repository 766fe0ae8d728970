// How does a car move when it is steered? The single-track model, integrated.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/vehicle/single_track.h"

namespace identikal {

/// What moves: the state, and the accelerations that follow from it.
struct Motion {
  double vy;  ///< lateral velocity of the centre of gravity [m/s]
  double r;   ///< yaw rate [rad/s]
  double ay;  ///< axle forces / m [m/s^2]: what an accelerometer at the centre of gravity feels,
              ///< vy' + vx r + g sin(bank)
  double yaw_acceleration;         ///< r' [rad/s^2]
  double slip_front, slip_rear;    ///< axle slip angles [rad]
  double force_front, force_rear;  ///< axle side forces [N]
  double vx_rate;                  ///< vx' [m/s^2]
};

/// Inputs of one uninterrupted segment of a recording, at every point of time that the integrator
/// visits. They are interpolated once; of the parameters only a steering delay moves them.
struct DrivenSegment {
  struct Node {
    double steering;  ///< as measured, `delay` earlier [rad]
    double vx;        ///< [m/s]
    double inverse_vx;
    double steering_rate = 0.0;  ///< [rad/s]
    double vx_rate = 0.0;        ///< [m/s^2]
  };
  struct Interval {
    int steps;    ///< Runge-Kutta steps between two samples
    double step;  ///< of this length [s]
  };
  std::vector<Interval> intervals;  ///< N - 1
  std::vector<Node> nodes;  ///< begin, middle and end of every step; neighbours share theirs
  double delay = 0.0;       ///< that the steering was read with [s]
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
/// @param time      N >= 2 strictly increasing time stamps [s], any spacing
/// @param steering  N measured steering angles [rad]
/// @param vx        N forward speeds [m/s], > 0
/// @param delay     by which the steering is read earlier [s]
/// @throws std::invalid_argument when the shapes disagree, N < 2 or a speed is not positive
DrivenSegment drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay = 0.0);

/// Reads the steering again with another delay; everything else stays.
/// @param time, steering  those the segment was made of
void set_delay(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay);

/// The same segment with a row at every integration step, and the times of these rows.
/// @param time  those the segment was made of
DrivenSegment with_every_step(const DrivenSegment& segment);
Eigen::VectorXd times_of_steps(const DrivenSegment& segment, const Eigen::VectorXd& time);

/// Motion under the inputs of a node in the state (vy, r), forces following at once:
///   m (vy' + vx r) = Ff + Fr - m g sin(bank),  Iz r' = a Ff - b Fr,
///   alpha_f = (vy + a r)/vx - delta,  alpha_r = (vy - b r)/vx
/// (Sladká 2010, eq (7.3) with the angles of section 7.2 taken as small).
///
/// Braking and driving shift load between the axles, Fz_f/Fz_f0 = 1 - h vx'/(g b) and Fz_r/Fz_r0 =
/// 1 + h vx'/(g a) with h the height of the centre of gravity: the largest force grows with the
/// load, the stiffness with 1 + load_sensitivity (Fz/Fz0 - 1).
Motion motion_at(const SingleTrack<>& car, double vy, double r, const DrivenSegment::Node& at);

/// Looks at the motion at a row of the segment, 0-based.
using ObserveMotion = std::function<void(Eigen::Index row, const Motion& motion, double vx)>;

/// Runs the car along a segment by the classical fourth-order Runge-Kutta method from the state
/// (vy, r) and calls observe at every row of it in order. With a relaxation length sigma the axle
/// forces are states too, F' = vx/sigma (F(alpha) - F), and begin as if they had followed.
///
/// Example:
///
///     const Eigen::VectorXd vx = Eigen::VectorXd::Constant(time.size(), 60.0 / 3.6);
///     const auto segment = drive(time, u.row(0), vx, {.decay_rate = decay_rate_times_speed(car)});
///     simulate(car, segment, 0.0, 0.0, [](Eigen::Index row, const Motion& motion, double) {
///       std::printf("%td: r = %g rad/s\n", row, motion.r);
///     });
///
/// @param correct  correct(row, vy, r) may move the state after a row was observed, as a filter
///   does, and says whether it did; may be empty
void simulate(const SingleTrack<>& car, const DrivenSegment& segment, double vy, double r,
              const ObserveMotion& observe,
              const std::function<bool(Eigen::Index row, double& vy, double& r)>& correct = {});

/// Where the derivatives with respect to the parameters and the initial state stand in a row of
/// `columns` derivatives; what is not requested is -1. Columns of nothing are the caller's own.
struct JacobianColumns {
  Eigen::Index columns = 0;
  std::array<Eigen::Index, kVehicleParameters> parameter;
  Eigen::Index vy = -1, r = -1;
  JacobianColumns() { parameter.fill(-1); }
};

/// Derivatives of the motion, a row each, SI.
struct MotionJacobian {
  Eigen::RowVectorXd vy, r, ay, yaw_acceleration;
};

/// Looks at the motion and its derivatives.
using ObserveJacobian = std::function<void(Eigen::Index row, const Motion& motion,
                                           const MotionJacobian& jacobian, double vx)>;
/// Moves the state and its derivatives, jacobian.vy and jacobian.r; says whether it did.
using CorrectJacobian =
    std::function<bool(Eigen::Index row, double& vy, double& r, MotionJacobian& jacobian)>;

/// simulate() with exact derivatives of the discrete solution: the linearised equations go through
/// the same Runge-Kutta steps. A steering delay in the columns is derived at the delay the segment
/// was read with.
/// @param correct  called after every row was observed; may be empty
/// @param corrected  looks again where `correct` moved the state; may be empty
void simulate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                            double r, const JacobianColumns& columns,
                            const ObserveJacobian& observe, const CorrectJacobian& correct = {},
                            const ObserveJacobian& corrected = {});

/// State (vy, r) of steady driving of the linear car under constant inputs, for a start when
/// nothing better is known; zero when there is no steady state (at the critical speed).
Eigen::Vector2d steady_state(const SingleTrack<>& car, const DrivenSegment::Node& at);

}  // namespace identikal
