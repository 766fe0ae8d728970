#include "lib/vehicle/motion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>

#include "lib/base/interpolation.h"
#include "lib/base/message.h"

namespace identikal {
namespace {

// Largest step in units of the fastest time constant. One Runge-Kutta step of this length errs by
// about 0.35^5 / 120 = 4e-5 of a mode that has already decayed to 70 % within it.
constexpr double kStepPerTimeConstant = 0.35;
// The same for the lag of the forces, which is fed smoothly.
constexpr double kStepPerRelaxation = 0.7;

/// An axle force and its derivatives with respect to vy, r and the parameters of the car.
struct ForceJacobian {
  double by_vy = 0.0, by_r = 0.0;
  VehicleParameters<double> by{};
};

/// The equations of motion, with everything that is constant along the run computed once.
class Balance {
 public:
  /// @param by_height  derivatives with respect to the height of the centre of gravity are wanted
  Balance(const SingleTrack<>& car, double delay, bool by_height = false)
      : car_(car),
        front_(car.front),
        rear_(car.rear),
        inverse_m_(1.0 / car.m),
        inverse_Iz_(1.0 / car.Iz),
        per_angle_(car.steering_gain / car.steering_ratio),
        later_(car.steering_delay - delay),
        loaded_(car.cg_height > 0.0 || by_height),
        inverse_ratio_(1.0 / car.steering_ratio),
        gravity_(kStandardGravity * std::sin(car.bank)),
        gravity_by_bank_(-kStandardGravity * std::cos(car.bank)),
        // Fz/Fz0 - 1 per vx' and height.
        front_load_(-1.0 / (kStandardGravity * car.b)),
        rear_load_(1.0 / (kStandardGravity * car.a)) {}

  const SingleTrack<>& car() const { return car_; }

  Motion slips(double vy, double r, const DrivenSegment::Node& at) const {
    Motion now;
    now.vy = vy;
    now.r = r;
    now.vx_rate = at.vx_rate;
    now.slip_front = (vy + car_.a * r) * at.inverse_vx - per_angle_ * angle(at);
    now.slip_rear = (vy - car_.b * r) * at.inverse_vx;
    return now;
  }

  /// The forces that belong to the slip angles of `now`.
  Eigen::Vector2d forces(const Motion& now) const {
    if (loaded_) {
      const LoadChange change = load_change(car_, now.vx_rate);
      return {loaded(car_.front, change.front).force(now.slip_front),
              loaded(car_.rear, change.rear).force(now.slip_rear)};
    }
    return {front_.force(now.slip_front), rear_.force(now.slip_rear)};
  }

  void accelerate(Motion& now) const {
    now.ay = (now.force_front + now.force_rear) * inverse_m_;
    now.yaw_acceleration = (car_.a * now.force_front - car_.b * now.force_rear) * inverse_Iz_;
  }

  /// vy' [m/s^2].
  double lateral_rate(const Motion& now, double vx) const { return now.ay - gravity_ - now.r * vx; }
  double lateral_rate_by_bank() const { return gravity_by_bank_; }
  double inverse_m() const { return inverse_m_; }
  double inverse_Iz() const { return inverse_Iz_; }

  /// The forces with their derivatives. What a curve or a car without load transfer does not read
  /// stays zero in `front` and `rear`.
  Eigen::Vector2d forces_and_jacobian(const Motion& now, const DrivenSegment::Node& at,
                                      ForceJacobian& front, ForceJacobian& rear) const {
    const auto [change_front, change_rear] = load_change(car_, now.vx_rate);
    const AxleForce Ff = loaded_
                             ? loaded(car_.front, change_front).force_and_jacobian(now.slip_front)
                             : front_.force_and_jacobian(now.slip_front);
    const AxleForce Fr = loaded_ ? loaded(car_.rear, change_rear).force_and_jacobian(now.slip_rear)
                                 : rear_.force_and_jacobian(now.slip_rear);
    front.by_vy = Ff.by_slip * at.inverse_vx;
    front.by_r = front.by_vy * car_.a;
    front.by[kA] = front.by_vy * now.r;
    front.by[kSteeringGain] = -Ff.by_slip * angle(at) * inverse_ratio_;
    front.by[kSteeringRatio] = Ff.by_slip * angle(at) * per_angle_ * inverse_ratio_;
    front.by[kSteeringOffset] = -Ff.by_slip * per_angle_;
    front.by[kSteeringDelay] = Ff.by_slip * per_angle_ * at.steering_rate;
    rear.by_vy = Fr.by_slip * at.inverse_vx;
    rear.by_r = -rear.by_vy * car_.b;
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
    return {Ff.value, Fr.value};
  }

 private:
  double angle(const DrivenSegment::Node& at) const {
    return at.steering + car_.steering_offset - later_ * at.steering_rate;
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
  double inverse_m_, inverse_Iz_, per_angle_, later_;
  bool loaded_;
  double inverse_ratio_, gravity_, gravity_by_bank_;
  double front_load_, rear_load_;
};

/// The state: (vy, r), then (Ff, Fr) where the forces relax.
template <std::size_t states>
using State = std::array<double, states>;

template <std::size_t states>
Motion motion_of(const Balance& balance, const State<states>& x, const DrivenSegment::Node& at) {
  Motion now = balance.slips(x[0], x[1], at);
  if constexpr (states == 4) {
    now.force_front = x[2];
    now.force_rear = x[3];
  } else {
    const Eigen::Vector2d F = balance.forces(now);
    now.force_front = F[0];
    now.force_rear = F[1];
  }
  balance.accelerate(now);
  return now;
}

template <std::size_t states>
State<states> rates_of(const Balance& balance, const Motion& now, const DrivenSegment::Node& at) {
  State<states> out;
  out[0] = balance.lateral_rate(now, at.vx);
  out[1] = now.yaw_acceleration;
  if constexpr (states == 4) {
    const Eigen::Vector2d F = balance.forces(now);
    const double rate = at.vx / balance.car().relaxation_length;
    out[2] = rate * (F[0] - now.force_front);
    out[3] = rate * (F[1] - now.force_rear);
  }
  return out;
}

constexpr std::size_t kSlopeLanes = 4;
using JacobianLanes = Eigen::Array<double, kSlopeLanes, 1>;

/// The linearised equations: derivatives of the rates from those of the state, row by row.
template <std::size_t states>
class Linearised {
 public:
  Linearised(const Balance& balance, const JacobianColumns& columns)
      : balance_(balance),
        columns_(columns),
        // What has no column is written into a last one. Whole vectors leave no remainder.
        width_((static_cast<std::size_t>(columns.columns) + kSlopeLanes) / kSlopeLanes *
               kSlopeLanes),
        direct_(states * width_, 0.0) {
    for (std::size_t p = 0; p < kVehicleParameters; ++p) {
      const Eigen::Index at = columns.parameter[p];
      column_[p] = at < 0 ? width_ - 1 : static_cast<std::size_t>(at);
      if (at >= 0) asked_.push_back(p);
    }
  }

  /// The rates at x, and their derivatives k (states x columns, row after row) from those of x.
  State<states> rates(const State<states>& x, const DrivenSegment::Node& at, const double* s,
                      double* k, Motion& now) {
    const SingleTrack<>& car = balance_.car();
    now = balance_.slips(x[0], x[1], at);
    const Eigen::Vector2d F = balance_.forces_and_jacobian(now, at, front_, rear_);
    now.force_front = states == 4 ? x[states - 2] : F[0];
    now.force_rear = states == 4 ? x[states - 1] : F[1];
    balance_.accelerate(now);
    const double inverse_m = balance_.inverse_m(), inverse_Iz = balance_.inverse_Iz();
    const double yaw_front = car.a * inverse_Iz, yaw_rear = -car.b * inverse_Iz;

    double A[states][states] = {};
    State<states> out;
    out[0] = balance_.lateral_rate(now, at.vx);
    out[1] = now.yaw_acceleration;
    if constexpr (states == 4) {
      const double rate = at.vx / car.relaxation_length;
      out[2] = rate * (F[0] - now.force_front);
      out[3] = rate * (F[1] - now.force_rear);
      A[0][1] = -at.vx;
      A[0][2] = A[0][3] = inverse_m;
      A[1][2] = yaw_front;
      A[1][3] = yaw_rear;
      A[2][0] = rate * front_.by_vy;
      A[2][1] = rate * front_.by_r;
      A[3][0] = rate * rear_.by_vy;
      A[3][1] = rate * rear_.by_r;
      A[2][2] = A[3][3] = -rate;
      for (const std::size_t p : asked_) {
        direct(0, p) = direct(1, p) = 0.0;
        direct(2, p) = rate * front_.by[p];
        direct(3, p) = rate * rear_.by[p];
      }
      direct(2, kRelaxationLength) -= out[2] / car.relaxation_length;
      direct(3, kRelaxationLength) -= out[3] / car.relaxation_length;
    } else {
      A[0][0] = (front_.by_vy + rear_.by_vy) * inverse_m;
      A[0][1] = (front_.by_r + rear_.by_r) * inverse_m - at.vx;
      A[1][0] = yaw_front * front_.by_vy + yaw_rear * rear_.by_vy;
      A[1][1] = yaw_front * front_.by_r + yaw_rear * rear_.by_r;
      for (const std::size_t p : asked_) {
        direct(0, p) = (front_.by[p] + rear_.by[p]) * inverse_m;
        direct(1, p) = yaw_front * front_.by[p] + yaw_rear * rear_.by[p];
      }
    }
    for (std::size_t i = 0; i < states; ++i) direct_[i * width_ + width_ - 1] = 0.0;
    direct(0, kMass) -= now.ay * inverse_m;
    direct(0, kBank) += balance_.lateral_rate_by_bank();
    direct(1, kA) += now.force_front * inverse_Iz;
    direct(1, kB) -= now.force_rear * inverse_Iz;
    direct(1, kYawInertia) -= now.yaw_acceleration * inverse_Iz;

    for (std::size_t i = 0; i < states; ++i) {
      const double* d = direct_.data() + i * width_;
      double* to = k + i * width_;
      for (std::size_t j = 0; j < width_; j += kSlopeLanes) {
        JacobianLanes sum = JacobianLanes::Map(d + j);
        for (std::size_t l = 0; l < states; ++l)
          sum += A[i][l] * JacobianLanes::Map(s + l * width_ + j);
        JacobianLanes::Map(to + j) = sum;
      }
    }
    return out;
  }

  /// Distance between the rows of derivatives.
  std::size_t width() const { return width_; }

  /// Derivatives of the forces at rest, where relaxing ones begin.
  void begin_forces(const Motion& now, const DrivenSegment::Node& at, double* s) {
    balance_.forces_and_jacobian(now, at, front_, rear_);
    for (std::size_t j = 0; j < width_; ++j) {
      s[2 * width_ + j] = front_.by_vy * s[j] + front_.by_r * s[width_ + j];
      s[3 * width_ + j] = rear_.by_vy * s[j] + rear_.by_r * s[width_ + j];
    }
    for (const std::size_t p : asked_) {
      s[2 * width_ + column_[p]] += front_.by[p];
      s[3 * width_ + column_[p]] += rear_.by[p];
    }
  }

  /// Derivatives of the accelerations, from those of the rates.
  void accelerations(const double* s, const double* k, double vx, MotionJacobian& out) const {
    const Eigen::Index n = columns_.columns;
    using Row = Eigen::Map<const Eigen::RowVectorXd>;
    out.ay = Row(k, n) + vx * Row(s + width_, n);
    out.yaw_acceleration = Row(k + width_, n);
    const Eigen::Index bank = columns_.parameter[kBank];
    if (bank >= 0) out.ay[bank] -= balance_.lateral_rate_by_bank();
  }

 private:
  double& direct(std::size_t state, std::size_t parameter) {
    return direct_[state * width_ + column_[parameter]];
  }

  const Balance& balance_;
  const JacobianColumns& columns_;
  std::size_t width_;
  std::vector<double> direct_;  // derivatives of the rates at a given state
  std::array<std::size_t, kVehicleParameters> column_;
  std::vector<std::size_t> asked_;
  ForceJacobian front_, rear_;
};

template <std::size_t states>
State<states> ahead(const State<states>& from, double h, const State<states>& k) {
  State<states> out;
  for (std::size_t i = 0; i < states; ++i) out[i] = from[i] + h * k[i];
  return out;
}

template <std::size_t states>
void integrate(const SingleTrack<>& car, const DrivenSegment& segment, double vy, double r,
               const ObserveMotion& observe,
               const std::function<bool(Eigen::Index, double&, double&)>& correct) {
  const Balance balance(car, segment.delay);
  const DrivenSegment::Node* node = segment.nodes.data();
  State<states> x{vy, r};
  if constexpr (states == 4) {
    const Motion begin = motion_of<2>(balance, {vy, r}, *node);
    x[2] = begin.force_front;
    x[3] = begin.force_rear;
  }
  const auto rates = [&](const State<states>& at, const DrivenSegment::Node& when) {
    return rates_of<states>(balance, motion_of<states>(balance, at, when), when);
  };
  Eigen::Index row = 0;
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      Motion now = motion_of<states>(balance, x, node[0]);
      if (step == 0) {
        observe(row, now, node[0].vx);
        if (correct && correct(row, x[0], x[1])) now = motion_of<states>(balance, x, node[0]);
      }
      const State<states> k1 = rates_of<states>(balance, now, node[0]);
      const State<states> k2 = rates(ahead(x, half, k1), node[1]);
      const State<states> k3 = rates(ahead(x, half, k2), node[1]);
      const State<states> k4 = rates(ahead(x, h, k3), node[2]);
      for (std::size_t i = 0; i < states; ++i) {
        x[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
      }
    }
    ++row;
  }
  observe(row, motion_of<states>(balance, x, *node), node->vx);
}

template <std::size_t states>
void integrate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                             double r, const JacobianColumns& columns,
                             const ObserveJacobian& observe, const CorrectJacobian& correct,
                             const ObserveJacobian& corrected) {
  const Balance balance(car, segment.delay, columns.parameter[kCgHeight] >= 0);
  Linearised<states> linearised(balance, columns);
  const DrivenSegment::Node* node = segment.nodes.data();
  const std::size_t width = linearised.width(), size = states * width;
  std::vector<double> s(size, 0.0), between(size), k1(size), k(size), sum(size);
  State<states> x{vy, r};
  if (columns.vy >= 0) s[columns.vy] = 1.0;
  if (columns.r >= 0) s[width + static_cast<std::size_t>(columns.r)] = 1.0;
  if constexpr (states == 4) {
    const Motion begin = motion_of<2>(balance, {vy, r}, *node);
    x[2] = begin.force_front;
    x[3] = begin.force_rear;
    linearised.begin_forces(begin, *node, s.data());
  }
  const auto step_to = [&](double h, const std::vector<double>& slope) {
    for (std::size_t j = 0; j < size; j += kSlopeLanes) {
      JacobianLanes::Map(&between[j]) =
          JacobianLanes::Map(&s[j]) + h * JacobianLanes::Map(&slope[j]);
    }
  };
  const auto add = [&](double weight, const std::vector<double>& slope, std::vector<double>& to) {
    for (std::size_t j = 0; j < size; j += kSlopeLanes) {
      JacobianLanes::Map(&to[j]) += weight * JacobianLanes::Map(&slope[j]);
    }
  };

  MotionJacobian jacobian;
  for (Eigen::RowVectorXd* each :
       {&jacobian.vy, &jacobian.r, &jacobian.ay, &jacobian.yaw_acceleration}) {
    each->setZero(columns.columns);
  }
  Motion now;
  const auto look = [&](Eigen::Index row, const ObserveJacobian& at) {
    jacobian.vy = Eigen::Map<const Eigen::RowVectorXd>(s.data(), columns.columns);
    jacobian.r = Eigen::Map<const Eigen::RowVectorXd>(s.data() + width, columns.columns);
    linearised.accelerations(s.data(), k1.data(), node->vx, jacobian);
    at(row, now, jacobian, node->vx);
  };
  // The rates at a row, after it was observed and perhaps corrected.
  const auto rates_at_row = [&](Eigen::Index row) {
    const State<states> k1x = linearised.rates(x, *node, s.data(), k1.data(), now);
    look(row, observe);
    if (!correct || !correct(row, x[0], x[1], jacobian)) return k1x;
    Eigen::Map<Eigen::RowVectorXd>(s.data(), columns.columns) = jacobian.vy;
    Eigen::Map<Eigen::RowVectorXd>(s.data() + width, columns.columns) = jacobian.r;
    const State<states> moved = linearised.rates(x, *node, s.data(), k1.data(), now);
    if (corrected) look(row, corrected);
    return moved;
  };
  Eigen::Index row = 0;
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      const State<states> k1x =
          step == 0 ? rates_at_row(row) : linearised.rates(x, node[0], s.data(), k1.data(), now);
      sum = k1;
      step_to(half, k1);
      const State<states> k2x =
          linearised.rates(ahead(x, half, k1x), node[1], between.data(), k.data(), now);
      add(2.0, k, sum);
      step_to(half, k);
      const State<states> k3x =
          linearised.rates(ahead(x, half, k2x), node[1], between.data(), k.data(), now);
      add(2.0, k, sum);
      step_to(h, k);
      const State<states> k4x =
          linearised.rates(ahead(x, h, k3x), node[2], between.data(), k.data(), now);
      add(1.0, k, sum);
      for (std::size_t i = 0; i < states; ++i) {
        x[i] += (h / 6.0) * (k1x[i] + 2.0 * (k2x[i] + k3x[i]) + k4x[i]);
      }
      add(h / 6.0, sum, s);
    }
    ++row;
  }
  rates_at_row(row);
}

}  // namespace

DrivenSegment drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay) {
  const Eigen::Index n = time.size();
  if (n < 2 || steering.size() != n || vx.size() != n || !(vx.minCoeff() > 0.0)) {
    const std::string smallest =
        vx.size() > 0 ? message({" (smallest ", vx.minCoeff(), " m/s)"}) : std::string();
    throw std::invalid_argument(message({"drive: ", n, " time stamps, ", steering.size(),
                                         " steering angles, ", vx.size(), " speeds", smallest}));
  }
  const Pchip vx_at(time, vx);
  DrivenSegment out;
  out.intervals.reserve(static_cast<std::size_t>(n - 1));
  const auto add_node = [&](Eigen::Index k, double t) {
    const double speed = vx_at.in_interval(k, t);
    out.nodes.push_back({0.0, speed, 1.0 / speed, 0.0, vx_at.slope_in_interval(k, t)});
  };
  add_node(0, time[0]);
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const double length = time[k + 1] - time[k];
    const double slowest = std::min(vx[k], vx[k + 1]), fastest = std::max(vx[k], vx[k + 1]);
    double limit =
        std::min(demand.longest_step, kStepPerTimeConstant * slowest / demand.decay_rate);
    if (demand.relaxation_length > 0.0) {
      limit = std::min(limit, kStepPerRelaxation * demand.relaxation_length / fastest);
    }
    // A step that is too long by rounding only is not worth a second one.
    const int steps = std::max(1, static_cast<int>(std::ceil(length / limit - 1e-6)));
    const double step = length / steps;
    out.intervals.push_back({steps, step});
    for (int half = 1; half < 2 * steps; ++half) add_node(k, time[k] + 0.5 * half * step);
    add_node(k, time[k + 1]);
  }
  set_delay(out, time, steering, delay);
  return out;
}

void set_delay(DrivenSegment& segment, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay) {
  const Pchip steering_at(time, steering);
  const Eigen::Index n = time.size();
  segment.delay = delay;
  Eigen::Index from = 0;  // interval that holds the time to read at
  const auto read = [&](DrivenSegment::Node& node, double t) {
    if (t < time[0] || t > time[n - 1]) {
      node.steering = steering[t < time[0] ? 0 : n - 1];
      node.steering_rate = 0.0;
      return;
    }
    while (from + 2 < n && time[from + 1] < t) ++from;
    node.steering = steering_at.in_interval(from, t);
    node.steering_rate = steering_at.slope_in_interval(from, t);
  };
  std::size_t at = 0;
  read(segment.nodes[at++], time[0] - delay);
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const DrivenSegment::Interval& interval = segment.intervals[k];
    for (int half = 1; half < 2 * interval.steps; ++half) {
      read(segment.nodes[at++], time[k] + 0.5 * half * interval.step - delay);
    }
    read(segment.nodes[at++], time[k + 1] - delay);
  }
}

DrivenSegment with_every_step(const DrivenSegment& segment) {
  DrivenSegment out = segment;
  out.intervals.clear();
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    out.intervals.insert(out.intervals.end(), static_cast<std::size_t>(interval.steps),
                         {1, interval.step});
  }
  return out;
}

Eigen::VectorXd times_of_steps(const DrivenSegment& segment, const Eigen::VectorXd& time) {
  Eigen::VectorXd out((static_cast<Eigen::Index>(segment.nodes.size()) + 1) / 2);
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < segment.intervals.size(); ++k) {
    const DrivenSegment::Interval& interval = segment.intervals[k];
    for (int step = 0; step < interval.steps; ++step) {
      out[at++] = time[static_cast<Eigen::Index>(k)] + step * interval.step;
    }
  }
  out[at] = time[time.size() - 1];
  return out;
}

Motion motion_at(const SingleTrack<>& car, double vy, double r, const DrivenSegment::Node& at) {
  return motion_of<2>(Balance(car, car.steering_delay), {vy, r}, at);
}

void simulate(const SingleTrack<>& car, const DrivenSegment& segment, double vy, double r,
              const ObserveMotion& observe,
              const std::function<bool(Eigen::Index, double&, double&)>& correct) {
  const auto run = car.relaxation_length > 0.0 ? integrate<4> : integrate<2>;
  run(car, segment, vy, r, observe, correct);
}

void simulate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                            double r, const JacobianColumns& columns,
                            const ObserveJacobian& observe, const CorrectJacobian& correct,
                            const ObserveJacobian& corrected) {
  const auto run =
      car.relaxation_length > 0.0 ? integrate_with_jacobian<4> : integrate_with_jacobian<2>;
  run(car, segment, vy, r, columns, observe, correct, corrected);
}

Eigen::Vector2d steady_state(const SingleTrack<>& car, const DrivenSegment::Node& at) {
  const SingleTrackMatrices model = single_track_matrices(car, at.vx);
  const double delta = car.steering_gain * (at.steering + car.steering_offset) / car.steering_ratio;
  Eigen::Vector2d forcing = model.B * delta;
  forcing[0] -= kStandardGravity * std::sin(car.bank);
  const Eigen::Vector2d x = -model.A.inverse() * forcing;
  // Near the critical speed the steady state diverges; no car is found there.
  return x.allFinite() && std::abs(x[0]) < at.vx ? x : Eigen::Vector2d::Zero();
}

}  // namespace identikal
