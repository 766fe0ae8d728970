#include "lib/vehicle/secondary_effects.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "lib/base/constants.h"
#include "lib/vehicle/first_order_lag.h"

namespace identikal {
namespace {

constexpr double kUsualRollFrequency = 2.0 * std::numbers::pi * 1.5;  // [rad/s]
constexpr double kUsualRollDamping = 0.35;

struct RollingState {
  double vy, r;
  double roll, roll_rate;  // over the roll gradient: the lateral acceleration that it follows
};

struct AxleForces {
  double front, rear;
};

/// What acts across the car: front force `across`, and `along` by every m/s^2 of drive.
struct FrontWheel {
  double angle, across = 1.0, along = 0.0;
};

class RollingCar {
 public:
  RollingCar(const SingleTrack<>& car, const SecondaryEffects& effects)
      : car_(car),
        effects_(effects),
        front_(bent(car.front, effects[kTyreSoftening],
                    car.m * kStandardGravity * car.b / (car.a + car.b))),
        rear_(bent(car.rear, effects[kTyreSoftening] * std::exp(effects[kRearSoftening]),
                   car.m * kStandardGravity * car.a / (car.a + car.b))),
        gradient_(effects[kRollGradient]),
        frequency_(kUsualRollFrequency * std::exp(effects[kRollQuickness])),
        damping_(kUsualRollDamping * std::exp(effects[kRollDecay])),
        arm_(kUsualRollArm * (car.a + car.b) + effects[kRollArm]),
        gravity_(kStandardGravity * std::sin(car.bank)),
        wide_(effects[kWideAngles]) {
    if (!(car.roll_gradient > 0.0)) return;
    gradient_ = car.roll_gradient;
    frequency_ = 2.0 * std::numbers::pi * car.roll_frequency;
    damping_ = car.roll_damping;
    arm_ = car.roll_height;
  }

  /// Of the body: simulated, and measured.
  double roll_angle(const RollingState& x, const DrivenSegment::Node& at) const {
    return gradient_ * x.roll + at.roll;
  }

  FrontWheel turned(double angle) const {
    if (wide_ == 0.0) return {angle};
    const double sine = std::sin(angle), cosine = std::cos(angle);
    const double tangent = effects_[kFrontDrive] * sine / cosine;
    const double across = cosine + tangent * sine;
    return {angle, 1.0 + wide_ * (across - 1.0), wide_ * car_.m * tangent};
  }

  AxleForces steady_forces(const RollingState& x, const DrivenSegment::Node& at,
                           const FrontWheel& wheel) const {
    const double late = x.roll - at.vx * x.r, roll = roll_angle(x, at);
    const double vy = axis_velocity(x, at);
    const double front = slip((vy + car_.a * x.r) * at.inverse_vx) - wheel.angle -
                         effects_[kRollSteerFront] * late - car_.front_steer_per_roll * roll;
    const double rear = slip((vy - car_.b * x.r) * at.inverse_vx) -
                        effects_[kRollSteerRear] * late - car_.rear_steer_per_roll * roll;
    const AxleForces camber{car_.front_camber_per_roll * roll, car_.rear_camber_per_roll * roll};
    if (car_.degression != 0.0) return with_transfer(front, rear, camber, at);
    if (!(car_.cg_height > 0.0)) {
      return {front_.force(front) + camber.front, rear_.force(rear) + camber.rear};
    }
    const LoadChange change = load_change(car_, at.vx_rate);
    const auto loaded = [&](const AxleCurve& axle, double by) {
      return AxleCurve(under_load(axle.axle(), by, car_.load_sensitivity));
    };
    return {loaded(front_, change.front).force(front) + camber.front,
            loaded(rear_, change.rear).force(rear) + camber.rear};
  }

  RollingState rate(const RollingState& x, const AxleForces& F, const DrivenSegment::Node& at,
                    const FrontWheel& wheel) const {
    const double front = front_force(x, F, at, wheel);
    const double ay = (front + F.rear) / car_.m, late = roll_acceleration(x, ay);
    return {ay - gravity_ - at.vx * x.r + arm_ * gradient_ * late,
            (car_.a * front - car_.b * F.rear) / car_.Iz, x.roll_rate, late};
  }

  Motion motion(const RollingState& x, const AxleForces& F, const DrivenSegment::Node& at,
                const FrontWheel& wheel) const {
    const double front = front_force(x, F, at, wheel);
    Motion out{};
    out.vy = axis_velocity(x, at);
    out.r = x.r;
    out.roll = roll_angle(x, at);
    out.roll_rate = gradient_ * x.roll_rate + at.roll_rate;
    const double ay = (front + F.rear) / car_.m;
    out.ay = ay + kStandardGravity * std::sin(out.roll) -
             effects_[kHeightOfAy] * gradient_ * roll_acceleration(x, ay);
    out.yaw_acceleration = (car_.a * front - car_.b * F.rear) / car_.Iz;
    out.slip_front = slip((out.vy + car_.a * x.r) * at.inverse_vx) - wheel.angle;
    out.slip_rear = slip((out.vy - car_.b * x.r) * at.inverse_vx);
    out.force_front = F.front;
    out.force_rear = F.rear;
    out.vx_rate = at.vx_rate;
    return out;
  }

  double wheel_angle(const DrivenSegment::Node& at) const {
    return car_.steering_gain * (at.steering + car_.steering_offset) / car_.steering_ratio;
  }

 private:
  double slip(double tangent) const {
    return wide_ == 0.0 ? tangent : tangent + wide_ * (std::atan(tangent) - tangent);
  }

  double front_force(const RollingState& x, const AxleForces& F, const DrivenSegment::Node& at,
                     const FrontWheel& wheel) const {
    return wheel.across * F.front + wheel.along * (at.vx_rate - x.vy * x.r);
  }

  /// psi''.
  double roll_acceleration(const RollingState& x, double ay) const {
    return frequency_ * (frequency_ * (ay - x.roll) - 2.0 * damping_ * x.roll_rate);
  }

  /// With the lateral acceleration that the forces make: a contraction, by far less than a half.
  AxleForces with_transfer(double front, double rear, const AxleForces& camber,
                           const DrivenSegment::Node& at) const {
    constexpr int kMostSteps = 50;
    constexpr double kExact = 1e-12;
    const LoadChange change = load_change(car_, at.vx_rate);
    const auto left = [&](const AxleCurve& axle, double by, double transfer, double ay) {
      Axle<> out = under_load(axle.axle(), by, car_.load_sensitivity);
      out.stiffness *= left_by_load_transfer(car_.degression, transfer, ay).value;
      return AxleCurve(out);
    };
    AxleForces out{};
    double ay = 0.0;
    for (int i = 0; i < kMostSteps; ++i) {
      out = {left(front_, change.front, car_.front_load_transfer, ay).force(front) + camber.front,
             left(rear_, change.rear, car_.rear_load_transfer, ay).force(rear) + camber.rear};
      // Half of the way: two values that take turns meet.
      const double next = 0.5 * (ay + (out.front + out.rear) / car_.m);
      if (std::abs(next - ay) <= kExact * std::abs(next)) break;
      ay = next;
    }
    return out;
  }

  /// Where roll is measured the state holds the velocity of the centre of gravity.
  double axis_velocity(const RollingState& x, const DrivenSegment::Node& at) const {
    return x.vy + car_.roll_height * at.roll_rate;
  }

  static AxleCurve bent(Axle<> axle, double softening, double load) {
    if (softening > 0.0) {
      axle.curve = TyreCurve::tanh;
      axle.softening = softening / (load * load);
    }
    return AxleCurve(axle);
  }

  SingleTrack<> car_;
  SecondaryEffects effects_;
  AxleCurve front_, rear_;
  double gradient_, frequency_, damping_, arm_, gravity_;
  double wide_;
};

RollingState moved(const RollingState& x, const RollingState& rate, double t) {
  return {x.vy + t * rate.vy, x.r + t * rate.r, x.roll + t * rate.roll,
          x.roll_rate + t * rate.roll_rate};
}

// At every node.
std::vector<double> wheel_angles(const RollingCar& car, const DrivenSegment& segment,
                                 double smoothing, double lag) {
  std::vector<double> out, half;
  out.reserve(segment.nodes.size());
  half.reserve(segment.nodes.size());
  for (const DrivenSegment::Node& node : segment.nodes) out.push_back(car.wheel_angle(node));
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    half.insert(half.end(), 2 * interval.steps, 0.5 * interval.step);
  }
  for (int pass = 0; pass < (smoothing > 0.0 ? 2 : 0); ++pass) {
    for (std::size_t i = 0; i < half.size(); ++i) {
      const double share = 1.0 - std::exp(-half[i] / smoothing);
      out[i + 1] = out[i] + share * (out[i + 1] - out[i]);
    }
    for (std::size_t i = half.size(); i-- > 0;) {
      const double share = 1.0 - std::exp(-half[i] / smoothing);
      out[i] = out[i + 1] + share * (out[i] - out[i + 1]);
    }
  }
  if (lag > 0.0) {
    double input = out[0];
    for (std::size_t i = 0; i < half.size(); ++i) {
      const double to = out[i + 1];
      out[i + 1] = lagged(out[i], input, to, half[i], lag);
      input = to;
    }
  }
  return out;
}

}  // namespace

std::string_view name_of(SecondaryEffect effect) {
  constexpr std::array<std::string_view, kSecondaryEffects> kNames = {
      "steering smoothing", "steering lag",    "relaxation length", "roll gradient",
      "roll steer front",   "roll steer rear", "roll quickness",    "roll decay",
      "roll arm",           "height of ay",    "tyre softening",    "rear tyre softening",
      "wide angles",        "front drive",     "lag of r",          "lag of vy",
      "lag of ay",          "lever arm of vy", "lever arm of ay",   "height of vy"};
  return kNames[effect];
}

double lagged(double x, double from, double to, double t, double T) {
  if (T < 1e-9) return to;
  const double lag = T * (to - from) / t;
  return to - lag + (x - from + lag) * std::exp(-t / T);
}

void simulate_with_effects(const SingleTrack<>& given, const SecondaryEffects& effects,
                           const DrivenSegment& segment, double vy, double r,
                           const ObserveMotion& observe) {
  const RollingCar car(given, effects);
  std::vector<FrontWheel> wheel;
  wheel.reserve(segment.nodes.size());
  for (const double angle :
       wheel_angles(car, segment, effects[kSteeringSmoothing], effects[kSteeringLag])) {
    wheel.push_back(car.turned(angle));
  }
  RollingState x{vy - given.roll_height * segment.nodes[0].roll_rate, r, 0.0, 0.0};
  AxleForces F = car.steady_forces(x, segment.nodes[0], wheel[0]);
  x.roll = (F.front + F.rear) / given.m;
  AxleForces steady = car.steady_forces(x, segment.nodes[0], wheel[0]);
  F = steady;
  observe(0, car.motion(x, F, segment.nodes[0], wheel[0]), segment.nodes[0].vx);
  std::size_t at = 0;
  for (std::size_t k = 0; k < segment.intervals.size(); ++k) {
    const double h = segment.intervals[k].step;
    for (int i = 0; i < segment.intervals[k].steps; ++i, at += 2) {
      const DrivenSegment::Node &begin = segment.nodes[at], &middle = segment.nodes[at + 1],
                                &end = segment.nodes[at + 2];
      const auto followed = [&](const AxleForces& to, double t, double vx) {
        const FirstOrderLag lag(effects[kTyreRelaxation] / vx, t);
        return AxleForces{lag.next(F.front, steady.front, to.front),
                          lag.next(F.rear, steady.rear, to.rear)};
      };
      const RollingState halfway = moved(x, car.rate(x, F, begin, wheel[at]), 0.5 * h);
      const AxleForces between =
          followed(car.steady_forces(halfway, middle, wheel[at + 1]), 0.5 * h, begin.vx);
      x = moved(x, car.rate(halfway, between, middle, wheel[at + 1]), h);
      const AxleForces after = car.steady_forces(x, end, wheel[at + 2]);
      F = followed(after, h, middle.vx);
      steady = after;
    }
    observe(static_cast<Eigen::Index>(k) + 1, car.motion(x, F, segment.nodes[at], wheel[at]),
            segment.nodes[at].vx);
  }
}

}  // namespace identikal
