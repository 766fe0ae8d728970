#include "lib/vehicle/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "lib/vehicle/internal/balance.h"

namespace identikal {
namespace {

/// The state: (v, r), then (phi, phi') of a body whose roll is simulated, then (Ff, Fr) where the
/// forces relax.
template <bool rolling, bool relaxing>
struct Layout {
  static constexpr std::size_t states = 2 + (rolling ? 2 : 0) + (relaxing ? 2 : 0);
  static constexpr std::size_t forces = states - 2;  // where they begin
  using State = std::array<double, states>;
};
template <bool rolling, bool relaxing>
using StateOf = typename Layout<rolling, relaxing>::State;

template <bool rolling, bool relaxing>
Motion slips_of(const Balance& balance, const StateOf<rolling, relaxing>& x,
                const DrivenSegment::Node& at) {
  if constexpr (rolling) return balance.slips(x[0], x[1], x[2], x[3], at);
  return balance.slips(x[0], x[1], at.roll, at.roll_rate, at);
}

template <bool rolling, bool relaxing>
Motion motion_of(const Balance& balance, const StateOf<rolling, relaxing>& x,
                 const DrivenSegment::Node& at) {
  Motion now = slips_of<rolling, relaxing>(balance, x, at);
  if constexpr (relaxing) {
    now.force_front = x[Layout<rolling, relaxing>::forces];
    now.force_rear = x[Layout<rolling, relaxing>::forces + 1];
  } else {
    const Eigen::Vector2d F = balance.forces(now);
    now.force_front = F[0];
    now.force_rear = F[1];
  }
  balance.accelerate(now);
  return now;
}

/// @param F  forces that belong to the slip angles, which relaxing ones follow
template <bool rolling, bool relaxing>
StateOf<rolling, relaxing> rates_of(const Balance& balance, const Motion& now,
                                    const DrivenSegment::Node& at, const Eigen::Vector2d& F) {
  StateOf<rolling, relaxing> out;
  out[0] = balance.lateral_rate(now, at.vx);
  out[1] = now.yaw_acceleration;
  if constexpr (rolling) {
    out[2] = now.roll_rate;
    out[3] = balance.roll_acceleration(now);
  }
  if constexpr (relaxing) {
    constexpr std::size_t forces = Layout<rolling, relaxing>::forces;
    const double rate = at.vx / balance.car().relaxation_length;
    out[forces] = rate * (F[0] - now.force_front);
    out[forces + 1] = rate * (F[1] - now.force_rear);
  }
  return out;
}

/// The state where a segment begins: roll as of the forces of a body that stands upright, then the
/// forces as of that roll.
template <bool rolling, bool relaxing>
StateOf<rolling, relaxing> begin_at(const Balance& balance, double vy, double r,
                                    const DrivenSegment::Node& at) {
  StateOf<rolling, relaxing> x{vy, r};
  if constexpr (rolling) {
    const Motion upright = motion_of<true, false>(balance, {vy, r, 0.0, 0.0}, at);
    x[2] = balance.car().roll_gradient * balance.per_mass(upright);
  } else {
    x[0] -= balance.car().roll_height * at.roll_rate;
  }
  if constexpr (relaxing) {
    StateOf<rolling, false> steady;
    std::copy_n(x.begin(), steady.size(), steady.begin());
    const Motion begin = motion_of<rolling, false>(balance, steady, at);
    x[Layout<rolling, relaxing>::forces] = begin.force_front;
    x[Layout<rolling, relaxing>::forces + 1] = begin.force_rear;
  }
  return x;
}

constexpr std::size_t kSlopeLanes = 4;
using JacobianLanes = Eigen::Array<double, kSlopeLanes, 1>;

/// The linearised equations: derivatives of the rates from those of the state, row by row.
template <bool rolling, bool relaxing>
class Linearised {
  static constexpr std::size_t states = Layout<rolling, relaxing>::states;
  static constexpr std::size_t forces = Layout<rolling, relaxing>::forces;
  using State = StateOf<rolling, relaxing>;

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
  State rates(const State& x, const DrivenSegment::Node& at, const double* s, double* k,
              Motion& now) {
    now = slips_of<rolling, relaxing>(balance_, x, at);
    const Eigen::Vector2d F = balance_.forces_and_jacobian(now, at, front_, rear_);
    now.force_front = relaxing ? x[forces] : F[0];
    now.force_rear = relaxing ? x[forces + 1] : F[1];
    balance_.accelerate(now);
    const State out = rates_of<rolling, relaxing>(balance_, now, at, F);

    double A[states][states] = {};
    balances(A);
    if constexpr (relaxing) relaxation(at.vx / balance_.car().relaxation_length, out, A);
    for (std::size_t i = 0; i < states; ++i) direct_[i * width_ + width_ - 1] = 0.0;
    direct(0, kMass) -= balance_.per_mass(now) * balance_.inverse_m();
    if constexpr (rolling) roll(now, A);
    A[0][1] -= at.vx;
    direct(0, kBank) += balance_.lateral_rate_by_bank();
    direct(1, kA) += now.force_front * balance_.inverse_Iz();
    direct(1, kB) -= now.force_rear * balance_.inverse_Iz();
    direct(1, kYawInertia) -= now.yaw_acceleration * balance_.inverse_Iz();

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

  /// Derivatives of the state that begin_at() gives, from those of v and r in s.
  void begin(const State& x, const DrivenSegment::Node& at, double* s) {
    if constexpr (rolling) {
      const Motion upright = motion_of<true, false>(balance_, {x[0], x[1], 0.0, 0.0}, at);
      const double gain = balance_.car().roll_gradient * balance_.inverse_m();
      balance_.forces_and_jacobian(upright, at, front_, rear_);
      for (const ForceJacobian* axle : {&front_, &rear_}) {
        add_force_of_motion(*axle, gain, s, s + 2 * width_);
      }
      s[2 * width_ + column_[kMass]] -= gain * balance_.per_mass(upright);
      s[2 * width_ + column_[kRollPerAcceleration]] += balance_.per_mass(upright);
    } else {
      s[column_[kRollHeight]] -= at.roll_rate;
    }
    if constexpr (relaxing) {
      balance_.forces_and_jacobian(slips_of<rolling, relaxing>(balance_, x, at), at, front_, rear_);
      const ForceJacobian* axles[] = {&front_, &rear_};
      for (std::size_t i = 0; i < 2; ++i) {
        double* to = s + (forces + i) * width_;
        add_force_of_motion(*axles[i], 1.0, s, to);
        if constexpr (rolling) {
          for (std::size_t j = 0; j < width_; ++j) to[j] += axles[i]->by_roll * s[2 * width_ + j];
        }
      }
    }
    for (std::size_t i = 0; i < states; ++i) s[i * width_ + width_ - 1] = 0.0;
  }

  /// Derivatives of vy, from those of the state.
  void lateral_velocity(const double* s, const Motion& now, Eigen::RowVectorXd& out) const {
    out = Row(s, columns_.columns);
    if constexpr (rolling) {
      out += balance_.car().roll_height * Row(s + 3 * width_, columns_.columns);
    }
    const Eigen::Index height = columns_.parameter[kRollHeight];
    if (height >= 0) out[height] += now.roll_rate;
  }

  /// Derivatives of the accelerations, from those of the rates.
  void accelerations(const double* s, const double* k, const Motion& now, double vx,
                     MotionJacobian& out) const {
    const Eigen::Index n = columns_.columns;
    out.ay = Row(k, n) + vx * Row(s + width_, n);
    out.yaw_acceleration = Row(k + width_, n);
    const Eigen::Index bank = columns_.parameter[kBank];
    if (bank >= 0) out.ay[bank] -= balance_.lateral_rate_by_bank();
    if constexpr (rolling) {
      out.ay += kStandardGravity * std::cos(now.roll) * Row(s + 2 * width_, n);
    }
  }

 private:
  using Row = Eigen::Map<const Eigen::RowVectorXd>;

  /// Force and moment, without the turning of the axes.
  void balances(double (&A)[states][states]) {
    const double inverse_m = balance_.inverse_m(), inverse_Iz = balance_.inverse_Iz();
    const double yaw_front = balance_.car().a * inverse_Iz,
                 yaw_rear = -balance_.car().b * inverse_Iz;
    if constexpr (relaxing) {
      A[0][forces] = A[0][forces + 1] = inverse_m;
      A[1][forces] = yaw_front;
      A[1][forces + 1] = yaw_rear;
      for (const std::size_t p : asked_) direct(0, p) = direct(1, p) = 0.0;
      return;
    }
    const auto add = [&](std::size_t state, double front, double rear) {
      A[0][state] = (front + rear) * inverse_m;
      A[1][state] = yaw_front * front + yaw_rear * rear;
    };
    add(0, front_.by_vy, rear_.by_vy);
    add(1, front_.by_r, rear_.by_r);
    if constexpr (rolling) {
      add(2, front_.by_roll, rear_.by_roll);
      add(3, front_.by_roll_rate, rear_.by_roll_rate);
    }
    for (const std::size_t p : asked_) {
      direct(0, p) = (front_.by[p] + rear_.by[p]) * inverse_m;
      direct(1, p) = yaw_front * front_.by[p] + yaw_rear * rear_.by[p];
    }
  }

  /// @param rate  vx / sigma
  void relaxation(double rate, const State& rates, double (&A)[states][states]) {
    const ForceJacobian* axles[] = {&front_, &rear_};
    for (std::size_t i = 0; i < 2; ++i) {
      const ForceJacobian& axle = *axles[i];
      double* row = A[forces + i];
      row[0] = rate * axle.by_vy;
      row[1] = rate * axle.by_r;
      if constexpr (rolling) {
        row[2] = rate * axle.by_roll;
        row[3] = rate * axle.by_roll_rate;
      }
      row[forces + i] = -rate;
      for (const std::size_t p : asked_) direct(forces + i, p) = rate * axle.by[p];
      direct(forces + i, kRelaxationLength) -= rates[forces + i] / balance_.car().relaxation_length;
    }
  }

  /// From row 0, which has the derivatives of force over mass.
  void roll(const Motion& now, double (&A)[states][states]) {
    const SingleTrack<>& car = balance_.car();
    const double w = balance_.natural_roll_rate(), gain = w * w * car.roll_gradient;
    for (std::size_t j = 0; j < states; ++j) A[3][j] = gain * A[0][j];
    A[2][3] = 1.0;
    A[3][2] -= w * w;
    A[3][3] -= 2.0 * w * car.roll_damping;
    for (const std::size_t p : asked_) {
      direct(2, p) = 0.0;
      direct(3, p) = gain * direct(0, p);
    }
    const double steady = car.roll_gradient * balance_.per_mass(now);
    direct(3, kRollPerAcceleration) += w * w * balance_.per_mass(now);
    direct(3, kRollFrequency) +=
        4.0 * std::numbers::pi * (w * (steady - now.roll) - car.roll_damping * now.roll_rate);
    direct(3, kRollDamping) -= 2.0 * w * now.roll_rate;
  }

  /// Adds gain times the derivatives of an axle's force, from those of v and r.
  void add_force_of_motion(const ForceJacobian& axle, double gain, const double* s, double* to) {
    for (std::size_t j = 0; j < width_; ++j) {
      to[j] += gain * (axle.by_vy * s[j] + axle.by_r * s[width_ + j]);
    }
    for (const std::size_t p : asked_) to[column_[p]] += gain * axle.by[p];
  }

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

template <typename State>
State ahead(const State& from, double h, const State& k) {
  State out;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = from[i] + h * k[i];
  return out;
}

template <bool rolling, bool relaxing>
void integrate(const SingleTrack<>& car, const DrivenSegment& segment, double vy, double r,
               const ObserveMotion& observe,
               const std::function<bool(Eigen::Index, double&, double&)>& correct) {
  using State = StateOf<rolling, relaxing>;
  const Balance balance(car, segment.delay, segment.lag);
  const DrivenSegment::Node* node = segment.nodes.data();
  State x = begin_at<rolling, relaxing>(balance, vy, r, *node);
  const auto motion = [&](const State& at, const DrivenSegment::Node& when) {
    return motion_of<rolling, relaxing>(balance, at, when);
  };
  const auto rates_in = [&](const Motion& now, const DrivenSegment::Node& when) {
    Eigen::Vector2d F;
    if constexpr (relaxing) F = balance.forces(now);
    return rates_of<rolling, relaxing>(balance, now, when, F);
  };
  const auto rates = [&](const State& at, const DrivenSegment::Node& when) {
    return rates_in(motion(at, when), when);
  };
  Eigen::Index row = 0;
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      Motion now = motion(x, node[0]);
      if (step == 0) {
        observe(row, now, node[0].vx);
        if (correct && correct(row, x[0], x[1])) now = motion(x, node[0]);
      }
      const State k1 = rates_in(now, node[0]);
      const State k2 = rates(ahead(x, half, k1), node[1]);
      const State k3 = rates(ahead(x, half, k2), node[1]);
      const State k4 = rates(ahead(x, h, k3), node[2]);
      for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
      }
    }
    ++row;
  }
  observe(row, motion(x, *node), node->vx);
}

template <bool rolling, bool relaxing>
void integrate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                             double r, const JacobianColumns& columns,
                             const ObserveJacobian& observe, const CorrectJacobian& correct,
                             const ObserveJacobian& corrected) {
  using State = StateOf<rolling, relaxing>;
  const Balance balance(car, segment.delay, segment.lag, columns.parameter[kCgHeight] >= 0,
                        columns.parameter[kDegression] >= 0);
  Linearised<rolling, relaxing> linearised(balance, columns);
  const DrivenSegment::Node* node = segment.nodes.data();
  const std::size_t width = linearised.width(), size = State().size() * width;
  std::vector<double> s(size, 0.0), between(size), k1(size), k(size), sum(size);
  State x = begin_at<rolling, relaxing>(balance, vy, r, *node);
  if (columns.vy >= 0) s[columns.vy] = 1.0;
  if (columns.r >= 0) s[width + static_cast<std::size_t>(columns.r)] = 1.0;
  linearised.begin(x, *node, s.data());
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
    linearised.lateral_velocity(s.data(), now, jacobian.vy);
    jacobian.r = Eigen::Map<const Eigen::RowVectorXd>(s.data() + width, columns.columns);
    linearised.accelerations(s.data(), k1.data(), now, node->vx, jacobian);
    at(row, now, jacobian, node->vx);
  };
  // The rates at a row, after it was observed and perhaps corrected.
  const auto rates_at_row = [&](Eigen::Index row) {
    const State k1x = linearised.rates(x, *node, s.data(), k1.data(), now);
    look(row, observe);
    if (!correct || !correct(row, x[0], x[1], jacobian)) return k1x;
    Eigen::Map<Eigen::RowVectorXd>(s.data(), columns.columns) = jacobian.vy;
    Eigen::Map<Eigen::RowVectorXd>(s.data() + width, columns.columns) = jacobian.r;
    const State moved = linearised.rates(x, *node, s.data(), k1.data(), now);
    if (corrected) look(row, corrected);
    return moved;
  };
  Eigen::Index row = 0;
  for (const DrivenSegment::Interval& interval : segment.intervals) {
    const double h = interval.step, half = 0.5 * h;
    for (int step = 0; step < interval.steps; ++step, node += 2) {
      const State k1x =
          step == 0 ? rates_at_row(row) : linearised.rates(x, node[0], s.data(), k1.data(), now);
      sum = k1;
      step_to(half, k1);
      const State k2x =
          linearised.rates(ahead(x, half, k1x), node[1], between.data(), k.data(), now);
      add(2.0, k, sum);
      step_to(half, k);
      const State k3x =
          linearised.rates(ahead(x, half, k2x), node[1], between.data(), k.data(), now);
      add(2.0, k, sum);
      step_to(h, k);
      const State k4x = linearised.rates(ahead(x, h, k3x), node[2], between.data(), k.data(), now);
      add(1.0, k, sum);
      for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] += (h / 6.0) * (k1x[i] + 2.0 * (k2x[i] + k3x[i]) + k4x[i]);
      }
      add(h / 6.0, sum, s);
    }
    ++row;
  }
  rates_at_row(row);
}

}  // namespace

Motion motion_at(const SingleTrack<>& car, double vy, double r, const DrivenSegment::Node& at) {
  return motion_of<false, false>(Balance(car, car.steering_delay, car.steering_lag),
                                 {vy - car.roll_height * at.roll_rate, r}, at);
}

void simulate(const SingleTrack<>& car, const DrivenSegment& segment, double vy, double r,
              const ObserveMotion& observe,
              const std::function<bool(Eigen::Index, double&, double&)>& correct) {
  const bool rolls = car.roll_gradient > 0.0, relaxes = car.relaxation_length > 0.0;
  const auto run = rolls ? (relaxes ? integrate<true, true> : integrate<true, false>)
                         : (relaxes ? integrate<false, true> : integrate<false, false>);
  run(car, segment, vy, r, observe, correct);
}

void simulate_with_jacobian(const SingleTrack<>& car, const DrivenSegment& segment, double vy,
                            double r, const JacobianColumns& columns,
                            const ObserveJacobian& observe, const CorrectJacobian& correct,
                            const ObserveJacobian& corrected) {
  const bool rolls = car.roll_gradient > 0.0 || columns.parameter[kRollPerAcceleration] >= 0;
  const bool relaxes = car.relaxation_length > 0.0;
  const auto run =
      rolls ? (relaxes ? integrate_with_jacobian<true, true> : integrate_with_jacobian<true, false>)
            : (relaxes ? integrate_with_jacobian<false, true>
                       : integrate_with_jacobian<false, false>);
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
