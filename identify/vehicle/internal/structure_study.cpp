#include "identify/vehicle/internal/structure_study.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "identify/vehicle/internal/robust_noise.h"
#include "lib/base/constants.h"
#include "lib/vehicle/late_sensor.h"

namespace identikal {
namespace {

constexpr int kMostIterations = 20;
constexpr int kReweighted = 4;        // iterations; then the weights stay, so that it converges
constexpr double kSettled = 0.03;     // of a standard deviation
constexpr double kNearEnough = 0.3;   // where derivatives by differences lead no further
constexpr double kLeastShare = 0.01;  // of a step
constexpr double kLongestStudyStep = 0.005;
constexpr double kStateStep = 1e-4;  // for differences, over kStateScale
constexpr double kUncorrelated = 0.05;

struct StudyUnknown {
  enum class Kind { free, known, effect } kind;  // to the model: free, known, or not there
  int index;                                     // VehicleParameter or SecondaryEffect
  double step;                                   // for differences
  double lower, upper;
  double mean = 0.0, sd = kInfinity;  // of the prior
  std::string unit, separated_by;
};

struct StudyPoint {
  VehicleParameters<double> p;
  SecondaryEffects effects{};
  Eigen::VectorXd states;  // (vy, r) at the begin of every segment, over kStateScale
};

double& entry(StudyPoint& point, const StudyUnknown& unknown) {
  return unknown.kind == StudyUnknown::Kind::effect ? point.effects[unknown.index]
                                                    : point.p[unknown.index];
}
double entry(const StudyPoint& point, const StudyUnknown& unknown) {
  return unknown.kind == StudyUnknown::Kind::effect ? point.effects[unknown.index]
                                                    : point.p[unknown.index];
}

SecondaryEffect filter_of(VehicleQuantity quantity) {
  if (quantity == VehicleQuantity::r) return kLagOfR;
  return quantity == VehicleQuantity::ay ? kLagOfAy : kLagOfVy;
}

/// The unknowns of the study: what the model frees, then the causes. Their priors are those of
/// passenger cars to trucks on public roads and of common test equipment: two thirds of them within
/// one standard deviation.
class StudyUnknowns {
 public:
  StudyUnknowns(const VehicleProblem& problem, const VehicleParameters<double>& p)
      : problem_(problem), p_(p) {
    const VehicleUnknowns& u = problem.unknowns;
    for (std::size_t i = 0; i < u.free.size(); ++i) add_free(i);
    add_known(kSteeringDelay, 0.008, 0.25, "s", "the delay of the steering channel at standstill");
    if (u.find(kSteeringRatio) < 0) {
      add_known(kSteeringGain, 0.01, 0.5, "", "the steering ratio on a turn table");
    }
    const double road_wheel = p[kSteeringRatio] / 15.0 / kDegreesPerRadian;
    add_known(kSteeringOffset, 1.5 * road_wheel, 20.0 * road_wheel, "rad", "driving straight on");
    add_sensor_biases();
    add_effects();
  }

  std::vector<StudyUnknown> all;

 private:
  bool measured(VehicleQuantity quantity) const { return problem_.run->find(quantity) >= 0; }

  VehicleQuantity sideslip_sensor() const {
    return measured(VehicleQuantity::vy) ? VehicleQuantity::vy : VehicleQuantity::beta;
  }
  /// Whether the model file says, or frees, this of the sensor.
  bool has(VehicleQuantity quantity, SensorProperty property) const {
    return has(sensor_parameter(quantity, property));
  }
  bool has_roll() const { return problem_.run->roll.size() > 0 || has(kRollPerAcceleration); }
  /// Of what is absent at 0.
  bool has(VehicleParameter parameter) const {
    return problem_.unknowns.find(parameter) >= 0 || p_[parameter] != 0.0;
  }

  void add_free(std::size_t i) {
    const VehicleUnknowns& u = problem_.unknowns;
    const auto n = static_cast<Eigen::Index>(i);
    const bool effect = u.free[i] == kRelaxationLength;
    const double size = std::max(std::abs(p_[u.free[i]]), 0.1 * u.scale[n]);
    all.push_back({effect ? StudyUnknown::Kind::effect : StudyUnknown::Kind::free,
                   effect ? static_cast<int>(kTyreRelaxation) : static_cast<int>(u.free[i]),
                   1e-3 * size, u.lower[n], u.upper[n], 0.0, kInfinity, "", ""});
  }

  void add_known(VehicleParameter parameter, double sd, double limit, const std::string& unit,
                 const std::string& separated_by) {
    if (problem_.unknowns.find(parameter) >= 0) return;
    const double at = p_[parameter];
    all.push_back({StudyUnknown::Kind::known, parameter, 0.1 * sd, at - limit, at + limit, at, sd,
                   unit, separated_by});
  }

  void add_effect(SecondaryEffect effect, double mean, double sd, const std::string& unit,
                  const std::string& separated_by, bool positive = true) {
    all.push_back({StudyUnknown::Kind::effect, effect, 0.1 * sd, positive ? 0.0 : mean - 8.0 * sd,
                   mean + 8.0 * sd, mean, sd, unit, separated_by});
  }

  void add_sensor_biases() {
    const std::string straight = "driving straight on";
    if (measured(VehicleQuantity::r)) {
      add_known(kBiasR, 0.2 / kDegreesPerRadian, 0.1, "rad/s", straight);
    }
    if (measured(VehicleQuantity::ay)) add_known(kBiasAy, 0.1, 2.0, "m/s^2", straight);
    if (measured(VehicleQuantity::vy) || measured(VehicleQuantity::beta)) {
      add_known(kBiasVy, 0.05, 1.0, "m/s", straight);
    }
  }

  void add_effects() {
    const double wheelbase = p_[kA] + p_[kB];
    add_effect(kSteeringSmoothing, 0.0, 0.01, "s", "a finer steering sensor");
    if (!has(kLagOfSteering)) {
      add_effect(kSteeringLag, 0.0, 0.015, "s", "the angle of a road wheel");
    }
    if (problem_.unknowns.find(kRelaxationLength) < 0 && !(p_[kRelaxationLength] > 0.0)) {
      add_effect(kTyreRelaxation, 0.1 * wheelbase, 0.1 * wheelbase, "m", "two more speeds");
    }
    // A share of the slip angle that belongs to the lateral acceleration.
    const double front = 0.15 * p_[kMass] * p_[kB] / wheelbase / p_[kCf];
    const double rear = 0.15 * p_[kMass] * p_[kA] / wheelbase / p_[kCr];
    if (has_roll()) {
      add_steer_of_roll(front, rear);
    } else {
      add_roll(front, rear);
    }
    if (problem_.unknowns.curve == TyreCurve::linear) {
      add_effect(kTyreSoftening, 0.8, 0.5, "", "gentler driving, or `tyre: {curve: tanh}`");
    }
    add_sensor_effects(wheelbase);
  }

  /// @param front, rear  slip angles that may come by roll, over lateral acceleration
  void add_roll(double front, double rear) {
    const std::string roll = "the roll angle, or ay levelled by it";
    add_effect(kRollGradient, 0.005, 0.005, "rad/(m/s^2)", roll);
    add_effect(kRollSteerFront, 0.0, front, "rad/(m/s^2)", roll, false);
    add_effect(kRollSteerRear, 0.0, rear, "rad/(m/s^2)", roll, false);
  }

  /// Of a body whose roll the model has: steer and camber by it, where the file says nothing of them.
  void add_steer_of_roll(double front, double rear) {
    const double gradient =
        std::max(0.002, p_[kRollPerAcceleration] > 0.0 ? p_[kRollPerAcceleration] : 0.005);
    const std::string suspension = "the kinematics of the suspension";
    if (!has(kFrontSteerPerRoll) && !has(kFrontCamberPerRoll)) {
      add_known(kFrontSteerPerRoll, front / gradient, 8.0 * front / gradient, "", suspension);
    }
    if (!has(kRearSteerPerRoll) && !has(kRearCamberPerRoll)) {
      add_known(kRearSteerPerRoll, rear / gradient, 8.0 * rear / gradient, "", suspension);
    }
  }

  void add_sensor_effects(double wheelbase) {
    const bool sideslip = measured(VehicleQuantity::vy) || measured(VehicleQuantity::beta);
    const std::string place = "the place of the sensor";
    if (sideslip && !has(sideslip_sensor(), SensorProperty::x)) {
      add_effect(kArmOfVy, 0.0, 0.02 * wheelbase, "m", place, false);
    }
    if (measured(VehicleQuantity::ay) && !has(VehicleQuantity::ay, SensorProperty::x)) {
      add_effect(kArmOfAy, 0.0, 0.02 * wheelbase, "m", place, false);
    }
    const std::string filters = "sensors that are filtered alike";
    const auto add_filter = [&](bool any, VehicleQuantity quantity) {
      if (!any || has(quantity, SensorProperty::lag)) return;
      add_effect(filter_of(quantity), 0.0, 0.004, "s", filters);
    };
    add_filter(measured(VehicleQuantity::r), VehicleQuantity::r);
    add_filter(sideslip, sideslip_sensor());
    add_filter(measured(VehicleQuantity::ay), VehicleQuantity::ay);
  }

  const VehicleProblem& problem_;
  const VehicleParameters<double>& p_;
};

/// Of a sensor that may sit elsewhere.
double reading(const SecondaryEffects& effects, const VehicleSensor& sensor,
               const VehicleReading& as_given, const Motion& motion, double vx) {
  const double value = as_given.value(motion, vx);
  switch (sensor.quantity) {
    case VehicleQuantity::vy:
      return value + effects[kArmOfVy] * motion.r;
    case VehicleQuantity::beta:
      return value + effects[kArmOfVy] * motion.r / vx;
    case VehicleQuantity::ay:
      return value + effects[kArmOfAy] * motion.yaw_acceleration;
    case VehicleQuantity::r:
      break;
  }
  return value;
}

/// A sensor behind two filters, its own and one that the study allows for.
struct FilteredSensor {
  double own_lag, allowed_lag;
  double input = 0.0, between = 0.0, value = 0.0;

  /// @param step  since the sample before [s]; 0: there is none
  double next(double now, double step) {
    const double after_own = step > 0.0 ? lagged(between, input, now, step, own_lag) : now;
    value = step > 0.0 ? lagged(value, between, after_own, step, allowed_lag) : now;
    input = now;
    between = after_own;
    return value;
  }
};

/// What the sensors say of the car with its secondary effects, minus what was measured.
class SecondarySimulation {
 public:
  SecondarySimulation(const VehicleProblem& problem, double delay) : problem_(problem) {
    IntegrationDemand demand = problem.demand;
    demand.relaxation_length = 0.0;
    demand.longest_step = kLongestStudyStep;
    const VehicleRun& run = *problem.run;
    for (const VehicleRun::Segment& s : run.segments) {
      driven_.push_back(drive(
          run.time.segment(s.first, s.rows), run.steering.segment(s.first, s.rows),
          run.vx.segment(s.first, s.rows), demand, delay, problem.unknowns.value[kLagOfSteering]));
      if (run.roll.size() > 0) {
        set_roll(driven_.back(), run.time.segment(s.first, s.rows),
                 run.roll.segment(s.first, s.rows));
      }
    }
  }

  Eigen::VectorXd errors(const StudyPoint& point) {
    SingleTrack<> car = car_with(problem_.unknowns.curve, point.p);
    const std::vector<VehicleReading> sensors = readings(*problem_.run, car);
    Eigen::VectorXd e(problem_.residuals());
    Eigen::Index n = 0;
    for (std::size_t s = 0; s < driven_.size(); ++s) add_segment(point, car, sensors, s, n, e);
    return e;
  }

 private:
  void add_segment(const StudyPoint& point, const SingleTrack<>& car,
                   const std::vector<VehicleReading>& sensors, std::size_t s, Eigen::Index& n,
                   Eigen::VectorXd& e) {
    const VehicleRun& run = *problem_.run;
    const auto [first, rows] = run.segments[s];
    const double delay = point.p[kSteeringDelay], lag = point.p[kLagOfSteering];
    if (driven_[s].delay != delay || driven_[s].lag != lag) {
      set_delay(driven_[s], run.time.segment(first, rows), run.steering.segment(first, rows), delay,
                lag);
    }
    std::vector<FilteredSensor> filtered;
    for (const VehicleRun::Output& output : run.outputs) {
      const VehicleQuantity quantity = output.sensor.quantity;
      filtered.push_back({car.sensors[static_cast<std::size_t>(quantity)].lag,
                          point.effects[filter_of(quantity)]});
    }
    SignalRows value(rows, static_cast<Eigen::Index>(sensors.size()));
    const Eigen::Index begin = n;
    const Eigen::Index at = 2 * static_cast<Eigen::Index>(s);
    const double vy = point.states[at] * kStateScale[0], r = point.states[at + 1] * kStateScale[1];
    const auto observe = [&, first = first](Eigen::Index k, const Motion& motion, double vx) {
      const Eigen::Index row = first + k;
      const double step = k == 0 ? 0.0 : run.time[row] - run.time[row - 1];
      for (std::size_t j = 0; j < sensors.size(); ++j) {
        const double now = reading(point.effects, run.outputs[j].sensor, sensors[j], motion, vx);
        value(k, static_cast<Eigen::Index>(j)) = filtered[j].next(now, step);
      }
      for (; n < e.size() && problem_.row[n] == row; ++n) {
        e[n] = value(k, problem_.output[n]) - problem_.sample[n];
      }
    };
    simulate_with_effects(car, point.effects, driven_[s], vy, r, observe);
    if (problem_.late_sensors) show_late(car, s, value, begin, n, e);
  }

  /// Errors of what the sensors showed, which are late.
  void show_late(const SingleTrack<>& car, std::size_t s, const SignalRows& value,
                 Eigen::Index begin, Eigen::Index end, Eigen::VectorXd& e) const {
    const VehicleRun& run = *problem_.run;
    const auto [first, rows] = run.segments[s];
    const Eigen::VectorXd time = run.time.segment(first, rows);
    for (std::size_t j = 0; j < run.outputs.size(); ++j) {
      const auto quantity = static_cast<std::size_t>(run.outputs[j].sensor.quantity);
      const auto column = static_cast<Eigen::Index>(j);
      if (car.sensors[quantity].delay == 0.0) continue;
      const SignalRows shown = late(time, value.col(column), time, car.sensors[quantity].delay);
      for (Eigen::Index n = begin; n < end; ++n) {
        if (problem_.output[n] == column)
          e[n] = shown(problem_.row[n] - first) - problem_.sample[n];
      }
    }
  }

  const VehicleProblem& problem_;
  std::vector<DrivenSegment> driven_;
};

/// The search. Differences make the derivatives: every column is a simulation.
class StructureSearch {
 public:
  StructureSearch(const VehicleProblem& problem, const VehicleOptimum& optimum)
      : problem_(problem), simulation_(problem, problem.unknowns.value[kSteeringDelay]) {
    at_.p = parameters_at(problem, optimum.z);
    at_.states = optimum.z.tail(2 * static_cast<Eigen::Index>(problem.run->segments.size()));
    unknowns_ = StudyUnknowns(problem, at_.p).all;
    at_.effects[kTyreRelaxation] = at_.p[kRelaxationLength];
    for (const StudyUnknown& u : unknowns_) {
      if (u.kind == StudyUnknown::Kind::effect && u.sd < kInfinity) entry(at_, u) = u.mean;
    }
  }

  StructureStudy run() {
    StructureStudy out;
    Eigen::VectorXd e = simulation_.errors(at_);
    if (!e.allFinite()) return out;
    for (int iteration = 0; iteration < kMostIterations && !out.converged; ++iteration) {
      if (iteration < kReweighted) weigh(e);
      differentiate(e);
      const double wanted = move(e);
      out.converged = wanted < (stalled_ ? kNearEnough : kSettled);
      if (stalled_) break;
    }
    weigh(e);
    differentiate(e);
    eliminate_states(e);
    report(out);
    out.errors = std::move(e);
    return out;
  }

 private:
  Eigen::Index count() const { return static_cast<Eigen::Index>(unknowns_.size()); }

  /// Weights of the samples: noise of their output, its autocorrelation, and, with robust noise,
  /// how much of an outlier they are.
  void weigh(const Eigen::VectorXd& e) {
    const Eigen::VectorXd sd = noise_sd(problem_, e);
    Eigen::VectorXd factor(sd.size());
    for (Eigen::Index j = 0; j < sd.size(); ++j) factor[j] = correlated_samples(e, j);
    weight_.resize(e.size());
    for (Eigen::Index n = 0; n < e.size(); ++n) {
      const Eigen::Index j = problem_.output[n];
      const double outlier = noise_cost(problem_.robust, e[n] / sd[j]).weight;
      weight_[n] = (problem_.robust ? outlier : 1.0) / (sd[j] * sd[j] * factor[j]);
    }
  }

  /// How many samples of the output tell what one independent sample would.
  double correlated_samples(const Eigen::VectorXd& e, Eigen::Index output) const {
    std::vector<double> of;
    for (Eigen::Index n = 0; n < e.size(); ++n) {
      if (problem_.output[n] == output) of.push_back(e[n]);
    }
    const Eigen::Map<const Eigen::VectorXd> x(of.data(), static_cast<Eigen::Index>(of.size()));
    const double power = x.squaredNorm();
    double factor = 1.0;
    for (Eigen::Index lag = 1; lag < x.size() / 4; ++lag) {
      const double rho = x.head(x.size() - lag).dot(x.tail(x.size() - lag)) / power;
      if (rho < kUncorrelated) break;
      factor += 2.0 * rho;
    }
    return factor;
  }

  double cost(const StudyPoint& point, const Eigen::VectorXd& e) const {
    double sum = weight_.dot(e.cwiseAbs2());
    for (const StudyUnknown& u : unknowns_) sum += std::pow((entry(point, u) - u.mean) / u.sd, 2);
    const Eigen::VectorXd z = coordinates(point);
    for (Eigen::Index i = 0; i < problem_.parameters(); ++i) {
      sum += std::pow(prior_residual(problem_, z, i).value, 2);
    }
    return sum;
  }

  /// Of the problem's free parameters, which come first among the unknowns.
  Eigen::VectorXd coordinates(const StudyPoint& point) const {
    Eigen::VectorXd z(problem_.parameters());
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      z[i] = entry(point, unknowns_[i]) / problem_.unknowns.scale[i];
    }
    return z;
  }

  void differentiate(const Eigen::VectorXd& e) {
    by_unknown_.resize(e.size(), count());
    for (Eigen::Index i = 0; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      StudyPoint other = at_;
      double& x = entry(other, u);
      const double by = x + u.step > u.upper ? -u.step : u.step;
      x += by;
      by_unknown_.col(i) = (simulation_.errors(other) - e) / by;
    }
    by_state_.resize(e.size(), 2);
    for (Eigen::Index i = 0; i < 2; ++i) {
      StudyPoint other = at_;
      for (Eigen::Index s = i; s < other.states.size(); s += 2) other.states[s] += kStateStep;
      by_state_.col(i) = (simulation_.errors(other) - e) / kStateStep;
    }
  }

  /// Of a segment, what its initial state takes part in.
  struct StateBlock {
    Eigen::Matrix2d inverse;
    Eigen::Matrix<double, 2, Eigen::Dynamic> cross;
    Eigen::Vector2d gradient;
  };

  /// Fills precision, gradient and covariance of the unknowns, the states eliminated.
  void eliminate_states(const Eigen::VectorXd& e) {
    precision_.setZero(count(), count());
    gradient_.setZero(count());
    blocks_.clear();
    Eigen::Index to = 0;
    for (const VehicleRun::Segment& segment : problem_.run->segments) {
      const Eigen::Index from = to;
      while (to < e.size() && problem_.row[to] < segment.first + segment.rows) ++to;
      const Eigen::VectorXd root = weight_.segment(from, to - from).cwiseSqrt();
      const Eigen::MatrixXd A = root.asDiagonal() * by_unknown_.middleRows(from, to - from);
      const Eigen::MatrixXd B = root.asDiagonal() * by_state_.middleRows(from, to - from);
      const Eigen::VectorXd c = root.cwiseProduct(e.segment(from, to - from));
      Eigen::Matrix2d S = B.transpose() * B;
      S.diagonal().array() += 1e-6;  // a state that nothing shows stays
      const StateBlock block{S.inverse(), B.transpose() * A, B.transpose() * c};
      precision_ += A.transpose() * A - block.cross.transpose() * block.inverse * block.cross;
      gradient_ += A.transpose() * c - block.cross.transpose() * block.inverse * block.gradient;
      blocks_.push_back(block);
    }
    add_priors();
    // What no sample and no prior says anything of has no precision.
    scale_ = precision_.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
    precision_ = scale_.asDiagonal() * precision_ * scale_.asDiagonal();
    precision_.diagonal().array() += 1e-9;
    covariance_ = scale_.asDiagonal() * precision_.inverse() * scale_.asDiagonal();
  }

  void add_priors() {
    const Eigen::VectorXd z = coordinates(at_);
    for (Eigen::Index i = 0; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      precision_(i, i) += 1.0 / (u.sd * u.sd);
      gradient_[i] += (entry(at_, u) - u.mean) / (u.sd * u.sd);
      if (i >= z.size()) continue;
      const PriorResidual prior = prior_residual(problem_, z, i);
      const double slope = prior.slope / problem_.unknowns.scale[i];
      precision_(i, i) += slope * slope;
      gradient_[i] += slope * prior.value;
    }
  }

  /// A Gauss-Newton step within the bounds: what would leave them goes to the bound and stays.
  Eigen::VectorXd bounded_step() const {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(count());
    std::vector<Eigen::Index> open(count());
    for (Eigen::Index i = 0; i < count(); ++i) open[i] = i;
    for (bool again = true; again && !open.empty();) {
      again = false;
      const Eigen::VectorXd held = precision_ * step.cwiseQuotient(scale_);
      const Eigen::VectorXd rhs = -gradient_.cwiseProduct(scale_) - held;
      const Eigen::VectorXd x = precision_(open, open).ldlt().solve(Eigen::VectorXd(rhs(open)));
      std::vector<Eigen::Index> within;
      for (std::size_t n = 0; n < open.size(); ++n) {
        const StudyUnknown& u = unknowns_[open[n]];
        const double by = scale_[open[n]] * x[static_cast<Eigen::Index>(n)];
        const double to = std::clamp(entry(at_, u) + by, u.lower, u.upper);
        if (to == entry(at_, u) + by) {
          within.push_back(open[n]);
        } else {
          step[open[n]] = to - entry(at_, u);
          again = true;
        }
      }
      if (!again) {
        for (std::size_t n = 0; n < open.size(); ++n) {
          step[open[n]] = scale_[open[n]] * x[static_cast<Eigen::Index>(n)];
        }
      }
      open = within;
    }
    return step;
  }

  /// Moves to a point that is no worse, if there is one along the step, else it has stalled.
  /// @return by how many standard deviations it moved, or wanted to
  double move(Eigen::VectorXd& e) {
    eliminate_states(e);
    const Eigen::VectorXd step = bounded_step();
    Eigen::VectorXd states(at_.states.size());
    for (std::size_t s = 0; s < blocks_.size(); ++s) {
      states.segment<2>(2 * static_cast<Eigen::Index>(s)) =
          -blocks_[s].inverse * (blocks_[s].gradient + blocks_[s].cross * step);
    }
    const double before = cost(at_, e);
    for (double share = 1.0; share > kLeastShare; share *= 0.4) {
      StudyPoint next = at_;
      for (Eigen::Index i = 0; i < count(); ++i) entry(next, unknowns_[i]) += share * step[i];
      next.states += share * states;
      Eigen::VectorXd there = simulation_.errors(next);
      if (!there.allFinite() || cost(next, there) > before * (1.0 + 1e-12)) continue;
      at_ = next;
      e = std::move(there);
      return share * step.cwiseQuotient(covariance_.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
    }
    stalled_ = true;
    return step.cwiseQuotient(covariance_.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
  }

  void report(StructureStudy& out) const {
    const Eigen::Index free = problem_.parameters(), causes = count() - free;
    out.value = coordinates(at_).cwiseProduct(problem_.unknowns.scale);
    out.covariance = covariance_.topLeftCorner(free, free);
    const Eigen::VectorXd sd = covariance_.diagonal().cwiseSqrt();
    out.with_causes = sd.head(free).cwiseInverse().asDiagonal() *
                      covariance_.topRightCorner(free, causes) *
                      sd.tail(causes).cwiseInverse().asDiagonal();
    for (Eigen::Index i = free; i < count(); ++i) {
      const StudyUnknown& u = unknowns_[i];
      const bool effect = u.kind == StudyUnknown::Kind::effect;
      out.causes.push_back({std::string(effect ? name_of(static_cast<SecondaryEffect>(u.index))
                                               : name_of(static_cast<VehicleParameter>(u.index))),
                            u.unit, effect ? 0.0 : u.mean, u.mean, u.sd, entry(at_, u), sd[i],
                            u.separated_by});
    }
  }

  const VehicleProblem& problem_;
  SecondarySimulation simulation_;
  std::vector<StudyUnknown> unknowns_;
  StudyPoint at_;
  Eigen::VectorXd weight_;
  Eigen::MatrixXd by_unknown_;
  Eigen::MatrixX2d by_state_;
  std::vector<StateBlock> blocks_;
  Eigen::MatrixXd precision_, covariance_;  // the former over scale_ on both sides
  Eigen::VectorXd gradient_, scale_;
  bool stalled_ = false;
};

}  // namespace

StructureStudy study_structure(const VehicleProblem& problem, const VehicleOptimum& optimum) {
  return StructureSearch(problem, optimum).run();
}

}  // namespace identikal
