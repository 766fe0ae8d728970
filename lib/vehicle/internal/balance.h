// Which forces and accelerations belong to a state of the car?
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Core>

#include "lib/vehicle/motion.h"

namespace identikal {

/// An axle force and its derivatives with respect to v, r, roll and the parameters of the car.
struct ForceJacobian {
  double by_vy = 0.0, by_r = 0.0, by_roll = 0.0, by_roll_rate = 0.0;
  VehicleParameters<double> by{};
};

/// The equations of motion, with everything that is constant along the run computed once.
class Balance {
 public:
  /// @param by_height, by_degression  derivatives with respect to the height of the centre of
  ///   gravity, and to what load transfer takes, are wanted
  Balance(const SingleTrack<>& car, double delay, double lag, bool by_height = false,
          bool by_degression = false)
      : car_(car),
        front_(car.front),
        rear_(car.rear),
        inverse_m_(1.0 / car.m),
        inverse_Iz_(1.0 / car.Iz),
        per_angle_(car.steering_gain / car.steering_ratio),
        later_(car.steering_delay - delay),
        slower_(car.steering_lag - lag),
        loaded_(car.cg_height > 0.0 || by_height),
        transfers_(car.degression != 0.0 || by_degression),
        inverse_ratio_(1.0 / car.steering_ratio),
        gravity_(kStandardGravity * std::sin(car.bank)),
        gravity_by_bank_(-kStandardGravity * std::cos(car.bank)),
        // Fz/Fz0 - 1 per vx' and height.
        front_load_(-1.0 / (kStandardGravity * car.b)),
        rear_load_(1.0 / (kStandardGravity * car.a)),
        roll_rate_(2.0 * std::numbers::pi * car.roll_frequency) {}

  const SingleTrack<>& car() const { return car_; }

  /// Slip angles at this velocity v of the centre of gravity, yaw rate and roll.
  Motion slips(double v, double r, double roll, double roll_rate,
               const DrivenSegment::Node& at) const {
    Motion now;
    now.vy = v + car_.roll_height * roll_rate;
    now.r = r;
    now.roll = roll;
    now.roll_rate = roll_rate;
    now.vx_rate = at.vx_rate;
    now.slip_front = (now.vy + car_.a * r) * at.inverse_vx - per_angle_ * angle(at) -
                     car_.front_steer_per_roll * roll;
    now.slip_rear = (now.vy - car_.b * r) * at.inverse_vx - car_.rear_steer_per_roll * roll;
    return now;
  }

  /// The forces that belong to the slip angles and the roll of `now`.
  Eigen::Vector2d forces(const Motion& now) const {
    const Eigen::Vector2d camber(car_.front_camber_per_roll * now.roll,
                                 car_.rear_camber_per_roll * now.roll);
    if (transfers_) {
      const AxlePair at = with_transfer(now, camber.sum());
      return camber + Eigen::Vector2d(at.front.value, at.rear.value);
    }
    if (loaded_) {
      const LoadChange change = load_change(car_, now.vx_rate);
      return camber + Eigen::Vector2d(loaded(car_.front, change.front).force(now.slip_front),
                                      loaded(car_.rear, change.rear).force(now.slip_rear));
    }
    return camber + Eigen::Vector2d(front_.force(now.slip_front), rear_.force(now.slip_rear));
  }

  void accelerate(Motion& now) const {
    now.ay = per_mass(now);
    if (now.roll != 0.0) now.ay += kStandardGravity * std::sin(now.roll);
    now.yaw_acceleration = (car_.a * now.force_front - car_.b * now.force_rear) * inverse_Iz_;
  }

  /// Axle forces / m [m/s^2].
  double per_mass(const Motion& now) const {
    return (now.force_front + now.force_rear) * inverse_m_;
  }

  /// Roll acceleration [rad/s^2].
  double roll_acceleration(const Motion& now) const {
    return roll_rate_ * (roll_rate_ * (car_.roll_gradient * per_mass(now) - now.roll) -
                         2.0 * car_.roll_damping * now.roll_rate);
  }
  double natural_roll_rate() const { return roll_rate_; }

  /// v' [m/s^2].
  double lateral_rate(const Motion& now, double vx) const {
    return per_mass(now) - gravity_ - now.r * vx;
  }
  double lateral_rate_by_bank() const { return gravity_by_bank_; }
  double inverse_m() const { return inverse_m_; }
  double inverse_Iz() const { return inverse_Iz_; }

  /// The forces with their derivatives. What a curve or a car without load transfer does not read
  /// stays zero in `front` and `rear`.
  Eigen::Vector2d forces_and_jacobian(const Motion& now, const DrivenSegment::Node& at,
                                      ForceJacobian& front, ForceJacobian& rear) const {
    const auto [change_front, change_rear] = load_change(car_, now.vx_rate);
    const Eigen::Vector2d camber(car_.front_camber_per_roll * now.roll,
                                 car_.rear_camber_per_roll * now.roll);
    AxlePair at_once = transfers_ ? with_transfer(now, camber.sum()) : without_transfer(now);
    if (transfers_) front = rear = {};
    AxleForce &Ff = at_once.front, &Fr = at_once.rear;
    // By the stiffness that braking leaves, of which turning takes its part.
    const double by_left_front = Ff.by_stiffness * at_once.stiffness_front,
                 by_left_rear = Fr.by_stiffness * at_once.stiffness_rear;
    Ff.by_stiffness *= at_once.left_front.value;
    Fr.by_stiffness *= at_once.left_rear.value;
    front.by_vy = Ff.by_slip * at.inverse_vx;
    front.by_r = front.by_vy * car_.a;
    by_roll(Ff, now, car_.front_steer_per_roll, car_.front_camber_per_roll, front);
    front.by[kFrontSteerPerRoll] = -Ff.by_slip * now.roll;
    front.by[kFrontCamberPerRoll] = now.roll;
    front.by[kA] = front.by_vy * now.r;
    front.by[kSteeringGain] = -Ff.by_slip * angle(at) * inverse_ratio_;
    front.by[kSteeringRatio] = Ff.by_slip * angle(at) * per_angle_ * inverse_ratio_;
    front.by[kSteeringOffset] = -Ff.by_slip * per_angle_;
    front.by[kSteeringDelay] = Ff.by_slip * per_angle_ * at.steering_rate;
    front.by[kLagOfSteering] = -Ff.by_slip * per_angle_ * at.steering_by_lag;
    rear.by_vy = Fr.by_slip * at.inverse_vx;
    rear.by_r = -rear.by_vy * car_.b;
    by_roll(Fr, now, car_.rear_steer_per_roll, car_.rear_camber_per_roll, rear);
    rear.by[kRearSteerPerRoll] = -Fr.by_slip * now.roll;
    rear.by[kRearCamberPerRoll] = now.roll;
    rear.by[kB] = -rear.by_vy * now.r;
    by_tyre(Ff, kCf, kInverseSaturationFront, front.by);
    by_tyre(Fr, kCr, kInverseSaturationRear, rear.by);
    if (loaded_) {
      const double by_change_front =
          by_load(car_.front, Ff, change_front, kCf, kInverseSaturationFront, front.by);
      const double by_change_rear =
          by_load(car_.rear, Fr, change_rear, kCr, kInverseSaturationRear, rear.by);
      front.by[kCgHeight] = by_change_front * front_load_ * now.vx_rate;
      front.by[kB] = -by_change_front * change_front / car_.b;
      rear.by[kCgHeight] = by_change_rear * rear_load_ * now.vx_rate;
      rear.by[kA] = -by_change_rear * change_rear / car_.a;
    }
    front.by[kSteeringCompliance] = Ff.by_compliance;
    const Eigen::Vector2d out = camber + Eigen::Vector2d(Ff.value, Fr.value);
    if (transfers_) {
      front.by[kDegression] = by_left_front * at_once.left_front.by_degression;
      front.by[kFrontLoadTransfer] = by_left_front * at_once.left_front.by_transfer;
      rear.by[kDegression] = by_left_rear * at_once.left_rear.by_degression;
      rear.by[kRearLoadTransfer] = by_left_rear * at_once.left_rear.by_transfer;
      by_acceleration(by_left_front * at_once.left_front.by_ay,
                      by_left_rear * at_once.left_rear.by_ay, out.sum() * inverse_m_, front, rear);
    }
    return out;
  }

 private:
  /// The tyres' forces of both axles, and the stiffness that braking, then turning left of them.
  struct AxlePair {
    AxleForce front, rear;
    double stiffness_front, stiffness_rear;
    LeftByLoadTransfer left_front = {}, left_rear = {};
  };

  AxlePair without_transfer(const Motion& now) const {
    if (!loaded_) {
      return {front_.force_and_jacobian(now.slip_front), rear_.force_and_jacobian(now.slip_rear),
              car_.front.stiffness, car_.rear.stiffness};
    }
    const LoadChange change = load_change(car_, now.vx_rate);
    const AxleCurve front = loaded(car_.front, change.front), rear = loaded(car_.rear, change.rear);
    return {front.force_and_jacobian(now.slip_front), rear.force_and_jacobian(now.slip_rear),
            front.axle().stiffness, rear.axle().stiffness};
  }

  /// The forces by the lateral acceleration that they make: Newton's method from above, where what
  /// is left is least.
  AxlePair with_transfer(const Motion& now, double camber) const {
    constexpr int kMostSteps = 60;
    constexpr double kExact = 1e-14;
    const LoadChange change = loaded_ ? load_change(car_, now.vx_rate) : LoadChange{};
    const Axle<> front = under_load(car_.front, change.front, car_.load_sensitivity),
                 rear = under_load(car_.rear, change.rear, car_.load_sensitivity);
    const auto at = [&](double ay) {
      AxlePair out{{},
                   {},
                   front.stiffness,
                   rear.stiffness,
                   left_by_load_transfer(car_.degression, car_.front_load_transfer, ay),
                   left_by_load_transfer(car_.degression, car_.rear_load_transfer, ay)};
      Axle<> left = front;
      left.stiffness *= out.left_front.value;
      out.front = AxleCurve(left).force_and_jacobian(now.slip_front);
      left = rear;
      left.stiffness *= out.left_rear.value;
      out.rear = AxleCurve(left).force_and_jacobian(now.slip_rear);
      return out;
    };
    AxlePair out = at(0.0);
    double ay = (out.front.value + out.rear.value + camber) * inverse_m_;
    double low = std::min(-1e-9, 1.5 * ay), high = std::max(1e-9, 1.5 * ay);
    for (int i = 0; i < kMostSteps; ++i) {
      out = at(ay);
      const double excess = ay - (out.front.value + out.rear.value + camber) * inverse_m_;
      (excess > 0.0 ? high : low) = ay;
      const double slope = 1.0 - (out.front.by_stiffness * front.stiffness * out.left_front.by_ay +
                                  out.rear.by_stiffness * rear.stiffness * out.left_rear.by_ay) *
                                     inverse_m_;
      double next = ay - excess / slope;
      if (!(next >= low && next <= high)) next = 0.5 * (low + high);
      const double by = std::abs(next - ay);
      if (by <= kExact * std::abs(ay)) break;
      ay = next;
    }
    return out;
  }

  /// Adds what the forces change by the lateral acceleration ay that follows from both.
  /// @param front_by, rear_by  their derivatives with respect to it
  void by_acceleration(double front_by, double rear_by, double ay, ForceJacobian& front,
                       ForceJacobian& rear) const {
    const double share = inverse_m_ / (1.0 - (front_by + rear_by) * inverse_m_);
    const auto add = [&](double& f, double& r, double more) {
      const double by = share * (f + r + more);
      f += front_by * by;
      r += rear_by * by;
    };
    add(front.by_vy, rear.by_vy, 0.0);
    add(front.by_r, rear.by_r, 0.0);
    add(front.by_roll, rear.by_roll, 0.0);
    add(front.by_roll_rate, rear.by_roll_rate, 0.0);
    for (std::size_t p = 0; p < kFirstOfSensors; ++p) {
      add(front.by[p], rear.by[p], p == kMass ? -ay : 0.0);
    }
  }

  double angle(const DrivenSegment::Node& at) const {
    return at.steering + car_.steering_offset - later_ * at.steering_rate +
           slower_ * at.steering_by_lag;
  }

  /// @param steer, camber  of the axle, per roll
  void by_roll(const AxleForce& force, const Motion& now, double steer, double camber,
               ForceJacobian& out) const {
    out.by_roll = camber - force.by_slip * steer;
    out.by_roll_rate = out.by_vy * car_.roll_height;
    out.by[kRollHeight] = out.by_vy * now.roll_rate;
  }

  /// @param change  Fz/Fz0 - 1
  AxleCurve loaded(const Axle<>& axle, double change) const {
    return AxleCurve(under_load(axle, change, car_.load_sensitivity));
  }

  static void by_tyre(const AxleForce& force, VehicleParameter stiffness,
                      VehicleParameter softening, VehicleParameters<double>& by) {
    by[stiffness] = force.by_stiffness;
    by[softening] = force.by_softening;
    by[kCurveShape] = force.by_shape;
    by[kCurveCurvature] = force.by_curvature;
  }

  /// Derivatives by what the load changes; returns that by the load's change.
  double by_load(const Axle<>& at_rest, const AxleForce& force, double change,
                 VehicleParameter stiffness, VehicleParameter softening,
                 VehicleParameters<double>& by) const {
    const double load = 1.0 + change, inverse_square = 1.0 / (load * load);
    by[stiffness] = force.by_stiffness * (1.0 + car_.load_sensitivity * change);
    by[softening] = force.by_softening * inverse_square;
    by[kLoadSensitivity] = force.by_stiffness * at_rest.stiffness * change;
    if (change <= kLeastLoadChange) return 0.0;
    return force.by_stiffness * at_rest.stiffness * car_.load_sensitivity -
           2.0 * force.by_softening * at_rest.softening * inverse_square / load;
  }

  SingleTrack<> car_;
  AxleCurve front_, rear_;
  double inverse_m_, inverse_Iz_, per_angle_, later_, slower_;
  bool loaded_, transfers_;
  double inverse_ratio_, gravity_, gravity_by_bank_;
  double front_load_, rear_load_;
  double roll_rate_;  // natural, [rad/s]
};

}  // namespace identikal
