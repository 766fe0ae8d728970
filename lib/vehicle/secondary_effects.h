// How does a car move whose steering and tyres lag, whose body rolls and whose sensors filter?
#pragma once

#include <array>
#include <functional>
#include <string_view>

#include "lib/vehicle/motion.h"

namespace identikal {

/// What a single track leaves out, each zero where it is absent.
enum SecondaryEffect {
  kSteeringSmoothing,  ///< time constant of a filter without phase on the measured angle, which is
                       ///< noisy or stepped [s]
  kSteeringLag,        ///< time constant between the measured angle and the wheels [s]
  kTyreRelaxation,     ///< sigma of both axles [m], F' = vx/sigma (F(alpha) - F)
  kRollGradient,       ///< steady roll angle over lateral acceleration [rad/(m/s^2)]
  kRollSteerFront,     ///< steady slip angle of the front axle that comes by roll, camber thrust
                       ///< included, over lateral acceleration: part of its stiffness in steady
                       ///< cornering, late in all other [rad/(m/s^2)]
  kRollSteerRear,      ///< the same of the rear axle
  kRollQuickness,      ///< logarithm of the natural frequency of roll over 1.5 Hz
  kRollDecay,          ///< logarithm of the damping of roll over 0.35
  kRollArm,            ///< centre of gravity above the roll axis, less kUsualRollArm wheelbases [m]
  kHeightOfAy,         ///< how far its sensor sits above the centre of gravity [m]
  kTyreSoftening,      ///< (axle load / largest force)^2 of the front axle, with the curve tanh
  kRearSoftening,      ///< logarithm of the rear axle's over it
  kWideAngles,         ///< 1: angles may be of any size; 0: wheels turn and slip by small ones, as
                       ///< in many simulators; between them so much of the difference
  kFrontDrive,         ///< share of the front wheels in drive and brake, where angles are wide
  kLagOfR,             ///< time constant of the sensor's filter [s]
  kLagOfVy,            ///< of vy and beta [s]
  kLagOfAy,            ///< [s]
  kArmOfVy,            ///< how far its sensor sits ahead of where the model has it [m]
  kArmOfAy,            ///< the same [m]
  kHeightOfVy,         ///< how far its sensor sits above the roll axis [m]
  kSecondaryEffects,
  kFirstEffectOfSensors = kLagOfR  ///< from here on they leave the car's motion as it is
};

inline constexpr double kUsualRollArm = 0.17;  ///< over the wheelbase

using SecondaryEffects = std::array<double, kSecondaryEffects>;

/// "steering lag", "relaxation length", ...
std::string_view name_of(SecondaryEffect effect);

/// Value of x' = (u - x)/T a time t later, where u goes evenly from `from` to `to`; u itself where T
/// is zero.
double lagged(double x, double from, double to, double t, double T);

/// Runs the car along a segment, as simulate() does, with
///   m (vy' + vx r) = Ff + Fr - m g sin(bank) + m h phi'',  Iz r' = a Ff - b Fr,
///   Ff, Fr follow F(alpha) by the relaxation length,
///   alpha_f = (vy + a r)/vx - delta - roll_steer_front (psi - vx r),
///   alpha_r = (vy - b r)/vx - roll_steer_rear (psi - vx r),
///   psi'' = w^2 ((Ff + Fr)/m - psi) - 2 zeta w psi',  phi = roll_gradient psi,
/// delta following the measured steering by its lag, roll of w = 2 pi 1.5 Hz exp(roll_quickness),
/// zeta = 0.35 exp(roll_decay) about an axis h = kUsualRollArm (a + b) + roll_arm below the centre of
/// gravity, which a roll angle phi > 0 (left side up) moves to the right. Motion::ay holds what a
/// sensor fixed to the body feels, g sin(phi) - height_of_ay phi'' included. Where angles are wide,
/// slip angles are atan((vy + a r)/vx) - delta ..., and in place of Ff the equations have
///   Ff cos(delta) + front_drive tan(delta) (m (vx' - vy r) + Ff sin(delta)),
/// drive that keeps vx as it is included.
/// Integrated by a midpoint rule that is exact for the lags (exponential), so that these may be as
/// short as they like; where all effects are zero it agrees with simulate() to its own second order.
/// Filters and places of other sensors are the reader's (from kLagOfR on). The roll of a car that has
/// its own (SingleTrack::roll_gradient), or whose roll is measured, is that of motion_at(); the
/// effects' then has to be zero.
///
/// Example:
///
///     const Eigen::VectorXd vx = Eigen::VectorXd::Constant(time.size(), 60.0 / 3.6);
///     const auto segment = drive(time, u.row(0), vx, {.longest_step = 0.005});
///     simulate_with_effects(car, {.01}, segment, 0.0, 0.0,  // the angle is smoothed by 10 ms
///                           [](Eigen::Index, const Motion& at, double) { std::printf("%g\n", at.r); });
///
/// @param car      its tyres bend where the softening is above zero
/// @param segment  of drive(), its steps at most 5 ms
void simulate_with_effects(const SingleTrack<>& car, const SecondaryEffects& effects,
                           const DrivenSegment& segment, double vy, double r,
                           const ObserveMotion& observe);

}  // namespace identikal
