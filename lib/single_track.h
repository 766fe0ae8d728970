// How does a car answer to steering? The single-track ("bicycle") model, its outputs and its
// characteristic values. Everything is a template on the scalar, so that numbers with derivatives
// can run through it.
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

namespace identikal {

inline constexpr double kStandardGravity = 9.80665;  ///< [m/s^2]

/// Linear axle: F = -C alpha.
template <typename T>
struct LinearAxle {
  T stiffness = T(0.0);  ///< C, both wheels together [N/rad], > 0

  T force(const T& slip) const { return -stiffness * slip; }
};

/// tanh(sqrt(z)) / sqrt(z), smooth at z = 0 (value 1, slope -1/3); z >= 0.
template <typename T>
T tanh_ratio(const T& z) {
  using std::sqrt;
  using std::tanh;
  if (z < 0.01) {  // six terms of the series leave less than 1e-14 here
    return 1.0 + z * (-1.0 / 3.0 +
                      z * (2.0 / 15.0 +
                           z * (-17.0 / 315.0 + z * (62.0 / 2835.0 - z * (1382.0 / 155925.0)))));
  }
  const T root = sqrt(z);
  return tanh(root) / root;
}

/// Axle whose force saturates: F = -tanh(s C alpha) / s with s = sqrt(softening), that is a largest
/// force of 1/s. Written in softening = s^2 the linear axle is the point 0, where the force is
/// differentiable: dF/d(softening) = (C alpha)^3 / 3.
template <typename T>
struct SofteningAxle {
  T stiffness = T(0.0);  ///< C at zero slip [N/rad], > 0
  T softening = T(0.0);  ///< [1/N^2], >= 0

  T force(const T& slip) const {
    const T linear = -stiffness * slip;
    return linear * tanh_ratio(T(softening * linear * linear));
  }
};

/// Parameters of the car. The road-wheel angle is delta = steering_gain (angle + steering_offset) /
/// steering_ratio: the offset is added where the angle is measured. When that is at the road wheel,
/// the ratio is 1.
///
/// `bank` is the slope of the road across the car, a positive turn about x (left side up): gravity
/// pulls to the right with g sin(bank). Body roll is not part of it.
template <typename T, typename Axle = LinearAxle<T>>
struct SingleTrack {
  T m = T(1.0);   ///< mass [kg]
  T a = T(1.0);   ///< centre of gravity to front axle [m]
  T b = T(1.0);   ///< centre of gravity to rear axle [m]
  T Iz = T(1.0);  ///< yaw moment of inertia [kg m^2]
  Axle front, rear;
  T steering_ratio = T(1.0);
  T steering_gain = T(1.0);
  T steering_offset = T(0.0);  ///< [rad], at the sensor
  T bias_r = T(0.0);           ///< measured - true [rad/s]
  T bias_vy = T(0.0);          ///< measured - true [m/s]
  T bias_ay = T(0.0);          ///< measured - true [m/s^2]
  T bank = T(0.0);             ///< [rad]
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
  kBiasR,
  kBiasVy,
  kBiasAy,
  kBank,
  kSofteningFront,
  kSofteningRear,
  kVehicleParameters
};

/// Name in model files; "softening_f" and "softening_r" for the last two.
std::string_view name_of(VehicleParameter parameter);
/// The parameter of that name, if there is one.
std::optional<VehicleParameter> vehicle_parameter(std::string_view name);

template <typename T>
using VehicleParameters = std::array<T, kVehicleParameters>;

/// Neutral values: gain and ratio 1, no offsets, biases, bank or softening; NaN where there is no
/// neutral value (m, a, b, Iz, Cf, Cr).
VehicleParameters<double> neutral_vehicle();

namespace detail {
template <typename T, typename Axle>
SingleTrack<T, Axle> without_axles(const VehicleParameters<T>& p) {
  SingleTrack<T, Axle> car;
  car.m = p[kMass];
  car.a = p[kA];
  car.b = p[kB];
  car.Iz = p[kYawInertia];
  car.steering_ratio = p[kSteeringRatio];
  car.steering_gain = p[kSteeringGain];
  car.steering_offset = p[kSteeringOffset];
  car.bias_r = p[kBiasR];
  car.bias_vy = p[kBiasVy];
  car.bias_ay = p[kBiasAy];
  car.bank = p[kBank];
  return car;
}
}  // namespace detail

/// The car with linear axles; the softening entries are not read.
template <typename T>
SingleTrack<T> linear_car(const VehicleParameters<T>& p) {
  auto car = detail::without_axles<T, LinearAxle<T>>(p);
  car.front.stiffness = p[kCf];
  car.rear.stiffness = p[kCr];
  return car;
}

/// The car with axles that saturate.
template <typename T>
SingleTrack<T, SofteningAxle<T>> softening_car(const VehicleParameters<T>& p) {
  auto car = detail::without_axles<T, SofteningAxle<T>>(p);
  car.front = {p[kCf], p[kSofteningFront]};
  car.rear = {p[kCr], p[kSofteningRear]};
  return car;
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
  T yaw_acceleration;       ///< r' [rad/s^2]
  T slip_front, slip_rear;  ///< axle slip angles [rad]
};

/// Inputs of one uninterrupted stretch of a recording, at every point of time that the integrator
/// visits. They do not depend on the parameters and are interpolated once.
struct DrivenStretch {
  struct Node {
    double steering;  ///< as measured [rad]
    double vx;        ///< [m/s]
    double inverse_vx;
  };
  struct Interval {
    int steps;    ///< Runge-Kutta steps between two samples
    double step;  ///< of this length [s]
  };
  std::vector<Interval> intervals;  ///< N - 1
  std::vector<Node> nodes;  ///< begin, middle and end of every step; neighbours share theirs
  Eigen::Index rows() const { return static_cast<Eigen::Index>(intervals.size()) + 1; }
};

/// Sum of the decay rates of both modes times vx [m/s^2]: (Cf + Cr)/m + (a^2 Cf + b^2 Cr)/Iz.
/// Divided by vx it bounds the fastest pole, which grows without limit as the car slows down.
template <typename Car>
double decay_rate_times_speed(const Car& car) {
  return (car.front.stiffness + car.rear.stiffness) / car.m +
         (car.a * car.a * car.front.stiffness + car.b * car.b * car.rear.stiffness) / car.Iz;
}

/// Prepares a stretch: steering and vx between samples by Pchip, Runge-Kutta steps of at most
/// `max_step` and at most 0.35 / (decay_rate / vx).
/// @param time      N >= 2 strictly increasing time stamps [s], any spacing
/// @param steering  N measured steering angles [rad]
/// @param vx        N forward speeds [m/s], > 0
/// @param decay_rate  decay_rate_times_speed() of the stiffest car to be expected
/// @throws std::invalid_argument when the shapes disagree, N < 2 or a speed is not positive
DrivenStretch drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, double decay_rate, double max_step = 0.01);

/// Right-hand side of the model, with everything that is constant along the run computed once.
///   m (vy' + vx r) = Ff + Fr - m g sin(bank),  Iz r' = a Ff - b Fr,
///   alpha_f = (vy + a r)/vx - delta,  alpha_r = (vy - b r)/vx
/// (Sladká 2010, eq (7.3) with the angles of section 7.2 taken as small).
template <typename T, typename Axle>
class Balance {
 public:
  explicit Balance(const SingleTrack<T, Axle>& car)
      : front_(car.front),
        rear_(car.rear),
        a_(car.a),
        b_(car.b),
        inverse_m_(1.0 / car.m),
        inverse_Iz_(1.0 / car.Iz),
        per_angle_(car.steering_gain / car.steering_ratio),
        delta_offset_(per_angle_ * car.steering_offset) {
    using std::sin;
    gravity_ = kStandardGravity * sin(car.bank);
  }

  // Inlined by force: handed back through memory, numbers with derivatives make it twice as slow.
  [[gnu::always_inline]] Motion<T> motion(const T& vy, const T& r,
                                          const DrivenStretch::Node& at) const {
    Motion<T> now;
    now.vy = vy;
    now.r = r;
    now.slip_front = (vy + a_ * r) * at.inverse_vx - (per_angle_ * at.steering + delta_offset_);
    now.slip_rear = (vy - b_ * r) * at.inverse_vx;
    const T front = front_.force(now.slip_front), rear = rear_.force(now.slip_rear);
    now.ay = (front + rear) * inverse_m_;
    now.yaw_acceleration = (a_ * front - b_ * rear) * inverse_Iz_;
    return now;
  }

  /// vy' [m/s^2].
  T lateral_rate(const Motion<T>& now, double vx) const { return now.ay - gravity_ - now.r * vx; }

 private:
  Axle front_, rear_;
  T a_, b_, inverse_m_, inverse_Iz_, per_angle_, delta_offset_, gravity_;
};

/// Runs the car along a stretch by the classical fourth-order Runge-Kutta method from the state
/// (vy, r) and calls observe(row, motion, vx) at every row of it, 0-based, in order.
template <typename T, typename Axle, typename Observe>
void simulate(const SingleTrack<T, Axle>& car, const DrivenStretch& stretch, T vy, T r,
              Observe&& observe) {
  const Balance<T, Axle> balance(car);
  const DrivenStretch::Node* node = stretch.nodes.data();
  Eigen::Index row = 0;
  for (const DrivenStretch::Interval& interval : stretch.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      const Motion<T> m1 = balance.motion(vy, r, node[0]);
      if (step == 0) observe(row, m1, node[0].vx);
      const T v1 = balance.lateral_rate(m1, node[0].vx);
      const Motion<T> m2 = balance.motion(vy + half * v1, r + half * m1.yaw_acceleration, node[1]);
      const T v2 = balance.lateral_rate(m2, node[1].vx);
      const Motion<T> m3 = balance.motion(vy + half * v2, r + half * m2.yaw_acceleration, node[1]);
      const T v3 = balance.lateral_rate(m3, node[1].vx);
      const Motion<T> m4 = balance.motion(vy + h * v3, r + h * m3.yaw_acceleration, node[2]);
      const T v4 = balance.lateral_rate(m4, node[2].vx);
      vy += (h / 6.0) * (v1 + 2.0 * (v2 + v3) + v4);
      r += (h / 6.0) * (m1.yaw_acceleration + 2.0 * (m2.yaw_acceleration + m3.yaw_acceleration) +
                        m4.yaw_acceleration);
    }
    ++row;
  }
  observe(row, balance.motion(vy, r, *node), node->vx);
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
///   r + bias_r;  vy + r x + bias_vy;  ay + r' x - r^2 y + bias_ay;  atan2(vy + r x, vx - r y).
struct VehicleSensor {
  VehicleQuantity quantity = VehicleQuantity::r;
  double x = 0.0;  ///< [m]
  double y = 0.0;  ///< [m]
};

template <typename T, typename Axle>
T measured(const VehicleSensor& sensor, const SingleTrack<T, Axle>& car, const Motion<T>& motion,
           double vx) {
  using std::atan2;
  switch (sensor.quantity) {
    case VehicleQuantity::r:
      return motion.r + car.bias_r;
    case VehicleQuantity::vy:
      return motion.vy + motion.r * sensor.x + car.bias_vy;
    case VehicleQuantity::ay:
      return motion.ay + motion.yaw_acceleration * sensor.x - motion.r * motion.r * sensor.y +
             car.bias_ay;
    case VehicleQuantity::beta:
      break;
  }
  return atan2(T(motion.vy + motion.r * sensor.x), T(vx - motion.r * sensor.y));
}

// ---------------------------------------------------------------------------------------------
// Characteristic values of the linear car (Mitschke & Wallentowitz 2014, part D; Bundorf & Leffert
// 1976 for the cornering compliances). All for the road-wheel angle, whatever the steering ratio.

/// K = m (b Cr - a Cf) / (L Cf Cr) [rad/(m/s^2)], L = a + b; > 0 understeers. Equals
/// front_compliance - rear_compliance.
template <typename T>
T understeer_gradient(const SingleTrack<T>& car) {
  const T &Cf = car.front.stiffness, &Cr = car.rear.stiffness;
  return car.m * (car.b * Cr - car.a * Cf) / ((car.a + car.b) * Cf * Cr);
}

/// Slip angle per lateral acceleration of the front axle, m b / (L Cf) [rad/(m/s^2)].
template <typename T>
T front_compliance(const SingleTrack<T>& car) {
  return car.m * car.b / ((car.a + car.b) * car.front.stiffness);
}

/// The same of the rear axle, m a / (L Cr) [rad/(m/s^2)].
template <typename T>
T rear_compliance(const SingleTrack<T>& car) {
  return car.m * car.a / ((car.a + car.b) * car.rear.stiffness);
}

/// sqrt(L / |K|) [m/s]: the characteristic speed of a car that understeers, the critical speed of
/// one that oversteers, where it becomes unstable. Infinite for K = 0.
template <typename T>
T characteristic_speed(const SingleTrack<T>& car) {
  using std::abs;
  using std::sqrt;
  return sqrt(T((car.a + car.b) / abs(understeer_gradient(car))));
}

/// Response to the road-wheel angle at one speed:
/// r/delta(s) = yaw_gain (1 + Tz s) / (1 + 2 zeta s/wn + s^2/wn^2).
template <typename T>
struct SteeringResponse {
  T yaw_gain;           ///< steady r / delta [1/s]
  T ay_gain;            ///< steady ay / delta [m/s^2 per rad]
  T sideslip_gain;      ///< steady beta / delta [-]
  T natural_frequency;  ///< wn [rad/s]; NaN above the critical speed
  T damping;            ///< zeta [-]
  T yaw_lead_time;      ///< Tz = m a u / (L Cr) [s]
};

/// @param u  forward speed [m/s], > 0
template <typename T>
SteeringResponse<T> steering_response(const SingleTrack<T>& car, double u) {
  using std::sqrt;
  const T &Cf = car.front.stiffness, &Cr = car.rear.stiffness;
  const T L = car.a + car.b;
  const T effective = L + understeer_gradient(car) * (u * u);
  const T wn_squared =
      Cf * Cr * L * L / (car.m * car.Iz * (u * u)) + (car.b * Cr - car.a * Cf) / car.Iz;
  const T decay =
      (Cf + Cr) / (car.m * u) + (car.a * car.a * Cf + car.b * car.b * Cr) / (car.Iz * u);
  SteeringResponse<T> out;
  out.yaw_gain = u / effective;
  out.ay_gain = u * u / effective;
  out.sideslip_gain = (car.b - car.m * car.a * (u * u) / (L * Cr)) / effective;
  out.natural_frequency = sqrt(wn_squared);
  out.damping = decay / (2.0 * out.natural_frequency);
  out.yaw_lead_time = car.m * car.a * u / (L * Cr);
  return out;
}

}  // namespace identikal
