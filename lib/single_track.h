// How does a car move when it is steered? The single-track ("bicycle") model and its outputs.
// Everything is a template on the scalar, so that numbers with derivatives can run through it.
//
// Axes and signs: ISO 8855. x forward, y to the left, z up; steering, yaw rate and sideslip are
// positive to the left. Units: SI, angles in radians.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "lib/axle.h"
#include "lib/interpolation.h"

namespace identikal {

inline constexpr double kStandardGravity = 9.80665;  ///< [m/s^2]

/// Parameters of the car. The road-wheel angle is delta(t) = steering_gain (angle(t -
/// steering_delay) + steering_offset) / steering_ratio: the offset is added where the angle is
/// measured. When that is at the road wheel, the ratio is 1.
///
/// `bank` is the slope of the road across the car, a positive turn about x (left side up): gravity
/// pulls to the right with g sin(bank). Body roll is not part of it.
template <typename T, TyreCurve curve = TyreCurve::linear>
struct SingleTrack {
  T m = T(1.0);   ///< mass [kg]
  T a = T(1.0);   ///< centre of gravity to front axle [m]
  T b = T(1.0);   ///< centre of gravity to rear axle [m]
  T Iz = T(1.0);  ///< yaw moment of inertia [kg m^2]
  Axle<T, curve> front, rear;
  T steering_ratio = T(1.0);
  T steering_gain = T(1.0);
  T steering_offset = T(0.0);    ///< [rad], at the sensor
  T steering_delay = T(0.0);     ///< the wheels follow the measured angle by this much later [s]
  T bias_r = T(0.0);             ///< measured - true [rad/s]
  T bias_vy = T(0.0);            ///< measured - true [m/s]
  T bias_ay = T(0.0);            ///< measured - true [m/s^2]
  T mounting_angle = T(0.0);     ///< turn to the left of the sensor of vy and beta [rad]
  T bank = T(0.0);               ///< [rad]
  T relaxation_length = T(0.0);  ///< sigma of both axles [m]; 0: forces follow at once
  T cg_height = T(0.0);          ///< of the centre of gravity [m]; 0: axle loads are constant
  T load_sensitivity = T(1.0);   ///< relative change of stiffness over that of the axle's load
};

/// The scalar parameters in the order in which arrays of them are written here and elsewhere.
enum VehicleParameter {
  kMass,
  kA,
  kB,
  kYawInertia,
  kCf,
  kCr,
  kSteeringRatio,
  kSteeringGain,
  kSteeringOffset,
  kSteeringDelay,
  kBiasR,
  kBiasVy,
  kBiasAy,
  kMountingAngle,
  kBank,
  kRelaxationLength,
  kCgHeight,
  kLoadSensitivity,
  kSofteningFront,  ///< 1/(largest force)^2; to its user the largest force, "Ff_max"
  kSofteningRear,
  kCurveShape,      ///< "curve_shape"
  kCurveCurvature,  ///< "curve_curvature"
  kVehicleParameters
};

/// Name in model files.
std::string_view name_of(VehicleParameter parameter);
/// The parameter of that name, if there is one.
std::optional<VehicleParameter> vehicle_parameter(std::string_view name);

template <typename T>
using VehicleParameters = std::array<T, kVehicleParameters>;

/// Neutral values: gain, ratio and load sensitivity 1, no delay, offsets, biases, bank, relaxation,
/// load transfer or softening, CurveShape's defaults; NaN where there is no neutral value (m, a, b,
/// Iz, Cf, Cr).
VehicleParameters<double> neutral_vehicle();

/// The car of these parameters; a curve does not read what it does not have.
template <TyreCurve curve, typename T>
SingleTrack<T, curve> car_with(const VehicleParameters<T>& p) {
  SingleTrack<T, curve> car;
  car.m = p[kMass];
  car.a = p[kA];
  car.b = p[kB];
  car.Iz = p[kYawInertia];
  car.front = {p[kCf], p[kSofteningFront], p[kCurveShape], p[kCurveCurvature]};
  car.rear = {p[kCr], p[kSofteningRear], p[kCurveShape], p[kCurveCurvature]};
  car.steering_ratio = p[kSteeringRatio];
  car.steering_gain = p[kSteeringGain];
  car.steering_offset = p[kSteeringOffset];
  car.steering_delay = p[kSteeringDelay];
  car.bias_r = p[kBiasR];
  car.bias_vy = p[kBiasVy];
  car.bias_ay = p[kBiasAy];
  car.mounting_angle = p[kMountingAngle];
  car.bank = p[kBank];
  car.relaxation_length = p[kRelaxationLength];
  car.cg_height = p[kCgHeight];
  car.load_sensitivity = p[kLoadSensitivity];
  return car;
}

/// The car with linear axles.
template <typename T>
SingleTrack<T> linear_car(const VehicleParameters<T>& p) {
  return car_with<TyreCurve::linear>(p);
}

/// Calls visit(car) with the car of that curve: the curve is part of its type, so that linear axles
/// do not pay for the others.
template <typename T, typename Visit>
decltype(auto) with_car(TyreCurve curve, const VehicleParameters<T>& p, Visit&& visit) {
  switch (curve) {
    case TyreCurve::tanh:
      return visit(car_with<TyreCurve::tanh>(p));
    case TyreCurve::fiala:
      return visit(car_with<TyreCurve::fiala>(p));
    case TyreCurve::magic_formula:
      return visit(car_with<TyreCurve::magic_formula>(p));
    case TyreCurve::linear:
      break;
  }
  return visit(car_with<TyreCurve::linear>(p));
}

/// x' = A x + B delta with x = (vy, r) and delta the road-wheel angle, at constant vx > 0.
/// Sladká (2010), eq (7.4), with row 2, column 1 after the moment balance (7.3), -(a Cf - b Cr)/(Iz
/// vx); the source prints -(a Cf + b Cr). Without bank.
struct SingleTrackMatrices {
  Eigen::Matrix2d A;
  Eigen::Vector2d B;
};
SingleTrackMatrices single_track_matrices(const SingleTrack<double>& car, double vx);

// ---------------------------------------------------------------------------------------------
// Simulation

/// What moves: the state, and the accelerations that follow from it.
template <typename T>
struct Motion {
  T vy;  ///< lateral velocity of the centre of gravity [m/s]
  T r;   ///< yaw rate [rad/s]
  T ay;  ///< axle forces / m [m/s^2]: what an accelerometer at the centre of gravity feels,
         ///< vy' + vx r + g sin(bank)
  T yaw_acceleration;         ///< r' [rad/s^2]
  T slip_front, slip_rear;    ///< axle slip angles [rad]
  T force_front, force_rear;  ///< axle side forces [N]
  double vx_rate;             ///< vx' [m/s^2]
};

/// Inputs of one uninterrupted stretch of a recording, at every point of time that the integrator
/// visits. They are interpolated once; of the parameters only a steering delay moves them.
struct DrivenStretch {
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

/// Sum of the decay rates of both modes times vx [m/s^2]: (Cf + Cr)/m + (a^2 Cf + b^2 Cr)/Iz.
/// Divided by vx it bounds the fastest pole, which grows without limit as the car slows down.
template <typename Car>
double decay_rate_times_speed(const Car& car) {
  return (car.front.stiffness + car.rear.stiffness) / car.m +
         (car.a * car.a * car.front.stiffness + car.b * car.b * car.rear.stiffness) / car.Iz;
}

/// What the integration steps have to follow.
struct IntegrationDemand {
  double decay_rate = 0.0;         ///< decay_rate_times_speed() of the stiffest car to be expected
  double relaxation_length = 0.0;  ///< the shortest to be expected [m]; 0: none
  double longest_step = 0.01;      ///< [s], that of Sladká (2010), section 9.1
};

/// Prepares a stretch: steering and vx between samples by Pchip, Runge-Kutta steps of at most
/// `longest_step`, 0.35 / (decay_rate / vx) and 0.7 relaxation_length / vx. Before the first and
/// after the last sample, where a delay may reach, the steering stands still.
/// @param time      N >= 2 strictly increasing time stamps [s], any spacing
/// @param steering  N measured steering angles [rad]
/// @param vx        N forward speeds [m/s], > 0
/// @param delay     by which the steering is read earlier [s]
/// @throws std::invalid_argument when the shapes disagree, N < 2 or a speed is not positive
DrivenStretch drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay = 0.0);

/// Reads the steering anew with another delay; everything else stays.
/// @param time, steering  those the stretch was made of
void set_delay(DrivenStretch& stretch, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay);

/// Right-hand side of the model, with everything that is constant along the run computed once.
///   m (vy' + vx r) = Ff + Fr - m g sin(bank),  Iz r' = a Ff - b Fr,
///   alpha_f = (vy + a r)/vx - delta,  alpha_r = (vy - b r)/vx
/// (Sladká 2010, eq (7.3) with the angles of section 7.2 taken as small).
///
/// Braking and driving shift load between the axles, Fz_f/Fz_f0 = 1 - h vx'/(g b) and Fz_r/Fz_r0 =
/// 1 + h vx'/(g a) with h the height of the centre of gravity: the largest force grows with the
/// load, the stiffness with 1 + load_sensitivity (Fz/Fz0 - 1).
template <typename T, TyreCurve curve>
class Balance {
 public:
  /// @param delay  that of the stretch: the rest of the car's delay is taken to first order, which
  ///   is nothing but its derivative when the two agree
  explicit Balance(const SingleTrack<T, curve>& car, double delay = 0.0)
      : front_(car.front),
        rear_(car.rear),
        a_(car.a),
        b_(car.b),
        inverse_m_(1.0 / car.m),
        inverse_Iz_(1.0 / car.Iz),
        per_angle_(car.steering_gain / car.steering_ratio),
        delta_offset_(per_angle_ * car.steering_offset),
        later_(car.steering_delay - delay),
        load_sensitivity_(car.load_sensitivity) {
    using std::sin;
    gravity_ = kStandardGravity * sin(car.bank);
    front_load_ = car.cg_height / (-kStandardGravity * car.b);
    rear_load_ = car.cg_height / (kStandardGravity * car.a);
    delayed_ = car.steering_delay < 0.0 || 0.0 < car.steering_delay || has_derivative(later_);
    loaded_ = 0.0 < car.cg_height || has_derivative(car.cg_height);
  }

  // Inlined by force: handed back through memory, numbers with derivatives make it twice as slow.
  [[gnu::always_inline]] Motion<T> motion(const T& vy, const T& r,
                                          const DrivenStretch::Node& at) const {
    Motion<T> now = slips(vy, r, at);
    static_forces(now, at);
    accelerate(now);
    return now;
  }

  /// With forces that have not yet followed the slip (relaxation length).
  [[gnu::always_inline]] Motion<T> motion(const T& vy, const T& r, const T& force_front,
                                          const T& force_rear,
                                          const DrivenStretch::Node& at) const {
    Motion<T> now = slips(vy, r, at);
    now.force_front = force_front;
    now.force_rear = force_rear;
    accelerate(now);
    return now;
  }

  /// The forces that belong to the slip angles of `now`.
  [[gnu::always_inline]] void static_forces(Motion<T>& now, const DrivenStretch::Node& at) const {
    if (loaded_) {
      now.force_front = under_load(front_, front_load_ * at.vx_rate).force(now.slip_front);
      now.force_rear = under_load(rear_, rear_load_ * at.vx_rate).force(now.slip_rear);
    } else {
      now.force_front = front_.force(now.slip_front);
      now.force_rear = rear_.force(now.slip_rear);
    }
  }

  /// vy' [m/s^2].
  T lateral_rate(const Motion<T>& now, double vx) const { return now.ay - gravity_ - now.r * vx; }

 private:
  static bool has_derivative(const T& x) {
    if constexpr (std::is_same_v<T, double>) {
      return false;
    } else {
      for (const double each : x.v) {
        if (each != 0.0) return true;
      }
      return false;
    }
  }

  [[gnu::always_inline]] Motion<T> slips(const T& vy, const T& r,
                                         const DrivenStretch::Node& at) const {
    Motion<T> now;
    now.vy = vy;
    now.r = r;
    now.vx_rate = at.vx_rate;
    T delta = per_angle_ * at.steering + delta_offset_;
    if (delayed_) delta = delta - per_angle_ * (later_ * at.steering_rate);
    now.slip_front = (vy + a_ * r) * at.inverse_vx - delta;
    now.slip_rear = (vy - b_ * r) * at.inverse_vx;
    return now;
  }

  [[gnu::always_inline]] void accelerate(Motion<T>& now) const {
    now.ay = (now.force_front + now.force_rear) * inverse_m_;
    now.yaw_acceleration = (a_ * now.force_front - b_ * now.force_rear) * inverse_Iz_;
  }

  /// @param change  Fz/Fz0 - 1
  Axle<T, curve> under_load(Axle<T, curve> axle, const T& change) const {
    axle.stiffness = axle.stiffness * (1.0 + load_sensitivity_ * change);
    axle.softening = axle.softening / ((1.0 + change) * (1.0 + change));
    return axle;
  }

  Axle<T, curve> front_, rear_;
  T a_, b_, inverse_m_, inverse_Iz_, per_angle_, delta_offset_, later_, load_sensitivity_, gravity_;
  T front_load_, rear_load_;  // Fz/Fz0 - 1 per vx'
  bool delayed_ = false, loaded_ = false;
};

namespace detail {
/// Integrates a fixed number of states: (vy, r), then (Ff, Fr) where the forces relax.
template <int states, typename T, TyreCurve curve, typename Observe, typename Correct>
void integrate(const SingleTrack<T, curve>& car, const DrivenStretch& stretch, const T& vy,
               const T& r, Observe&& observe, Correct&& correct) {
  using State = std::array<T, states>;
  const Balance<T, curve> balance(car, stretch.delay);
  const DrivenStretch::Node* node = stretch.nodes.data();
  State x;
  x[0] = vy;
  x[1] = r;
  [[maybe_unused]] T per_length(0.0);
  if constexpr (states == 4) {
    // The forces begin as if they had followed.
    const Motion<T> begin = balance.motion(vy, r, *node);
    x[2] = begin.force_front;
    x[3] = begin.force_rear;
    per_length = 1.0 / car.relaxation_length;
  }
  const auto motion = [&](const State& at, const DrivenStretch::Node& when)
      __attribute__((always_inline)) {
    if constexpr (states == 4) {
      return balance.motion(at[0], at[1], at[2], at[3], when);
    } else {
      return balance.motion(at[0], at[1], when);
    }
  };
  const auto rates = [&](const Motion<T>& now, const DrivenStretch::Node& when)
      __attribute__((always_inline)) {
    State out;
    out[0] = balance.lateral_rate(now, when.vx);
    out[1] = now.yaw_acceleration;
    if constexpr (states == 4) {
      Motion<T> followed = now;
      balance.static_forces(followed, when);
      const T rate = per_length * when.vx;
      out[2] = rate * (followed.force_front - now.force_front);
      out[3] = rate * (followed.force_rear - now.force_rear);
    }
    return out;
  };
  const auto ahead = [&](const State& from, double h, const State& k)
      __attribute__((always_inline)) {
    State out;
    for (std::size_t i = 0; i < states; ++i) out[i] = from[i] + h * k[i];
    return out;
  };
  Eigen::Index row = 0;
  for (const DrivenStretch::Interval& interval : stretch.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      Motion<T> m1 = motion(x, node[0]);
      if (step == 0) {
        observe(row, m1, node[0].vx);
        if (correct(row, x[0], x[1])) m1 = motion(x, node[0]);
      }
      const State k1 = rates(m1, node[0]);
      const State x2 = ahead(x, half, k1);
      const State k2 = rates(motion(x2, node[1]), node[1]);
      const State x3 = ahead(x, half, k2);
      const State k3 = rates(motion(x3, node[1]), node[1]);
      const State x4 = ahead(x, h, k3);
      const State k4 = rates(motion(x4, node[2]), node[2]);
      for (std::size_t i = 0; i < states; ++i) {
        x[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
      }
    }
    ++row;
  }
  observe(row, motion(x, *node), node->vx);
}
}  // namespace detail

/// Runs the car along a stretch by the classical fourth-order Runge-Kutta method from the state
/// (vy, r) and calls observe(row, motion, vx) at every row of it, 0-based, in order. With a
/// relaxation length sigma the axle forces are states too, F' = vx/sigma (F(alpha) - F).
/// @param correct  correct(row, vy, r) may move the state after a row was observed, as a filter
///   does, and says whether it did
template <typename T, TyreCurve curve, typename Observe, typename Correct>
void simulate(const SingleTrack<T, curve>& car, const DrivenStretch& stretch, const T& vy,
              const T& r, Observe&& observe, Correct&& correct) {
  if (0.0 < car.relaxation_length) {
    detail::integrate<4>(car, stretch, vy, r, observe, correct);
  } else {
    detail::integrate<2>(car, stretch, vy, r, observe, correct);
  }
}
template <typename T, TyreCurve curve, typename Observe>
void simulate(const SingleTrack<T, curve>& car, const DrivenStretch& stretch, const T& vy,
              const T& r, Observe&& observe) {
  simulate(car, stretch, vy, r, observe, [](Eigen::Index, T&, T&) { return false; });
}

/// State (vy, r) of steady driving under constant inputs, for a start when nothing better is known;
/// zero when there is no steady state (at the critical speed).
Eigen::Vector2d steady_state(const SingleTrack<double>& car, const DrivenStretch::Node& at);

// ---------------------------------------------------------------------------------------------
// Outputs

enum class VehicleQuantity { r, vy, ay, beta };

/// The quantity of that name: "r", "vy", "ay" or "beta".
std::optional<VehicleQuantity> vehicle_quantity(std::string_view name);

/// What a sensor at (x, y) from the centre of gravity measures:
///   r:    r + bias_r
///   vy:   vy_s cos(angle) - vx_s sin(angle) + bias_vy,  vx_s = vx - r y,  vy_s = vy + r x
///   ay:   ay_s cos(angle) - ax_s sin(angle) + bias_ay,  ay_s = ay + r' x - r^2 y,
///         ax_s = vx' - r vy - r^2 x - r' y
///   beta: atan2(vy_s, vx_s) - angle
/// A sensor turned to the left by `angle` sees the car's motion turned to the right. The car's
/// mounting_angle comes on top of it for vy and beta.
struct VehicleSensor {
  VehicleQuantity quantity = VehicleQuantity::r;
  double x = 0.0;      ///< [m]
  double y = 0.0;      ///< [m]
  double angle = 0.0;  ///< [rad]
};

template <typename T, TyreCurve curve>
T measured(const VehicleSensor& sensor, const SingleTrack<T, curve>& car, const Motion<T>& motion,
           double vx) {
  using std::atan2;
  using std::cos;
  using std::sin;
  if (sensor.quantity == VehicleQuantity::r) return motion.r + car.bias_r;
  if (sensor.quantity == VehicleQuantity::ay) {
    const T turn = motion.r * motion.r;
    T ay = motion.ay + motion.yaw_acceleration * sensor.x - turn * sensor.y;
    if (sensor.angle != 0.0) {
      const T ax = motion.vx_rate - motion.r * motion.vy - turn * sensor.x -
                   motion.yaw_acceleration * sensor.y;
      ay = ay * std::cos(sensor.angle) - ax * std::sin(sensor.angle);
    }
    return ay + car.bias_ay;
  }
  const T vx_s = vx - motion.r * sensor.y, vy_s = motion.vy + motion.r * sensor.x;
  const T angle = car.mounting_angle + sensor.angle;
  if (sensor.quantity == VehicleQuantity::beta) return atan2(vy_s, vx_s) - angle;
  return vy_s * cos(angle) - vx_s * sin(angle) + car.bias_vy;
}

}  // namespace identikal
