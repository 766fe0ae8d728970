// How does a car move when it is steered? The single-track model, integrated.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/vehicle/driven_segment.h"
#include "lib/vehicle/single_track.h"

namespace identikal {

/// What moves: the state, and the accelerations that follow from it.
struct Motion {
  double vy;  ///< lateral velocity of the roll axis below the centre of gravity [m/s]
  double r;   ///< yaw rate [rad/s]
  double ay;  ///< what an accelerometer at the centre of gravity feels [m/s^2]: axle forces / m +
              ///< g sin(phi); without roll that is vy' + vx r + g sin(bank)
  double yaw_acceleration;         ///< r' [rad/s^2]
  double slip_front, slip_rear;    ///< axle slip angles [rad]
  double force_front, force_rear;  ///< axle side forces [N]
  double vx_rate;                  ///< vx' [m/s^2]
  double roll = 0.0;               ///< phi of the body, left side up [rad]
  double roll_rate = 0.0;          ///< [rad/s]
};

/// Motion under the inputs of a node in the state (vy, r), forces following at once:
///   m (vy' + vx r) = Ff + Fr - m g sin(bank),  Iz r' = a Ff - b Fr,
///   alpha_f = (vy + a r)/vx - delta,  alpha_r = (vy - b r)/vx
/// (Sladká 2010, eq (7.3) with the angles of section 7.2 taken as small).
///
/// Braking and driving shift load between the axles, Fz_f/Fz_f0 = 1 - h vx'/(g b) and Fz_r/Fz_r0 =
/// 1 + h vx'/(g a) with h the height of the centre of gravity: the largest force grows with the
/// load, the stiffness with 1 + load_sensitivity (Fz/Fz0 - 1).
///
/// A front axle whose steering gives: Axle::compliance; slip angles of Motion are those of the axle.
/// Load that turning moves across the car leaves left_by_load_transfer() of both stiffnesses, with
/// the ay = (Ff + Fr)/m that follows from them, at once (the roll that it waits for is left out).
///
/// A body that rolls by phi (left side up) about an axis h = roll_height below the centre of gravity:
///   vy = v + h phi',  m (v' + vx r) = Ff + Fr - m g sin(bank),
///   alpha_f = (vy + a r)/vx - delta - e_f phi,  alpha_r = (vy - b r)/vx - e_r phi,
///   F = F(alpha) + G phi,
/// with v the velocity of the centre of gravity, vy that of the axis, e roll steer [rad/rad] and G camber
/// thrust over roll [N/rad]. phi is measured (DrivenSegment), or follows
///   phi'' = w^2 (roll_gradient (Ff + Fr)/m - phi) - 2 zeta w phi',  w = 2 pi roll_frequency,
/// from its steady value (Milliken & Milliken 1995, chapters 5 and 16; the sprung mass taken as m).
Motion motion_at(const SingleTrack<>& car, double vy, double r, const DrivenSegment::Node& at);

/// Looks at the motion at a row of the segment, 0-based.
using ObserveMotion = std::function<void(Eigen::Index row, const Motion& motion, double vx)>;

/// Runs the car along a segment by the classical fourth-order Runge-Kutta method from the state
/// (vy, r) and calls observe at every row of it in order. With a relaxation length sigma the axle
/// forces are states too, F' = vx/sigma (F(alpha) - F), and begin as if they had followed. Roll and
/// its rate are states where roll_gradient is above 0.
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
/// @param correct  called after every row was observed; may be empty; not for a body that rolls
/// @param corrected  looks again where `correct` moved the state; may be empty
void simulate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                            double r, const JacobianColumns& columns,
                            const ObserveJacobian& observe, const CorrectJacobian& correct = {},
                            const ObserveJacobian& corrected = {});

/// State (vy, r) of steady driving of the linear car under constant inputs, for a start when
/// nothing better is known; zero when there is no steady state (at the critical speed).
Eigen::Vector2d steady_state(const SingleTrack<>& car, const DrivenSegment::Node& at);

}  // namespace identikal
