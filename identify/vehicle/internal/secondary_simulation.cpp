#include "identify/vehicle/internal/secondary_simulation.h"

#include <algorithm>

namespace identikal {
namespace {

constexpr double kLongestStudyStep = 0.005;

/// Of a sensor that may sit elsewhere.
double reading(const SecondaryEffects& effects, const VehicleSensor& sensor,
               const VehicleReading& as_given, const Motion& motion, double vx) {
  const double value = as_given.value(motion, vx);
  switch (sensor.quantity) {
    case VehicleQuantity::vy:
      return value + effects[kArmOfVy] * motion.r - effects[kHeightOfVy] * motion.roll_rate;
    case VehicleQuantity::beta:
      return value + (effects[kArmOfVy] * motion.r - effects[kHeightOfVy] * motion.roll_rate) / vx;
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

bool is_of_sensor(int parameter) {
  return parameter == kBiasR || parameter == kBiasVy || parameter == kBiasAy ||
         parameter == kMountingAngle || parameter >= kFirstOfSensors;
}

bool move_alike(const StudyPoint& one, const StudyPoint& other) {
  for (int i = 0; i < kVehicleParameters; ++i) {
    if (!is_of_sensor(i) && one.p[i] != other.p[i]) return false;
  }
  return std::equal(one.effects.begin(), one.effects.begin() + kFirstEffectOfSensors,
                    other.effects.begin()) &&
         one.states == other.states;
}

}  // namespace

bool is_of_sensor(const StudyUnknown& unknown) {
  return unknown.kind == StudyUnknown::Kind::effect ? unknown.index >= kFirstEffectOfSensors
                                                    : is_of_sensor(unknown.index);
}

SecondarySimulation::SecondarySimulation(const VehicleProblem& problem, double delay)
    : problem_(problem), moved_(problem.run->segments.size()) {
  IntegrationDemand demand = problem.demand;
  demand.relaxation_length = 0.0;
  demand.longest_step = kLongestStudyStep;
  const VehicleRun& run = *problem.run;
  for (const VehicleRun::Segment& s : run.segments) {
    driven_.push_back(drive(run.time.segment(s.first, s.rows),
                            run.steering.segment(s.first, s.rows), run.vx.segment(s.first, s.rows),
                            demand, delay, problem.unknowns.value[kLagOfSteering]));
    if (run.roll.size() > 0) {
      set_roll(driven_.back(), run.time.segment(s.first, s.rows),
               run.roll.segment(s.first, s.rows));
    }
  }
}

Eigen::VectorXd SecondarySimulation::errors(const StudyPoint& point) {
  const SingleTrack<> car = car_with(problem_.unknowns.curve, point.p);
  if (!moved_at_ || !move_alike(point, *moved_at_)) {
    for (std::size_t s = 0; s < driven_.size(); ++s) move(point, car, s);
    moved_at_ = point;
  }
  const std::vector<VehicleReading> sensors = readings(*problem_.run, car);
  Eigen::VectorXd e(problem_.residuals());
  Eigen::Index n = 0;
  for (std::size_t s = 0; s < driven_.size(); ++s) show(point, car, sensors, s, n, e);
  return e;
}

void SecondarySimulation::move(const StudyPoint& point, const SingleTrack<>& car, std::size_t s) {
  const VehicleRun& run = *problem_.run;
  const auto [first, rows] = run.segments[s];
  const double delay = point.p[kSteeringDelay], lag = point.p[kLagOfSteering];
  if (driven_[s].delay != delay || driven_[s].lag != lag) {
    set_delay(driven_[s], run.time.segment(first, rows), run.steering.segment(first, rows), delay,
              lag);
  }
  const Eigen::Index at = 2 * static_cast<Eigen::Index>(s);
  const double vy = point.states[at] * kStateScale[0], r = point.states[at + 1] * kStateScale[1];
  std::vector<Sample>& moved = moved_[s];
  moved.clear();
  simulate_with_effects(car, point.effects, driven_[s], vy, r,
                        [&](Eigen::Index, const Motion& motion, double vx) {
                          moved.push_back({motion, vx});
                        });
}

void SecondarySimulation::show(const StudyPoint& point, const SingleTrack<>& car,
                               const std::vector<VehicleReading>& sensors, std::size_t s,
                               Eigen::Index& n, Eigen::VectorXd& e) const {
  const VehicleRun& run = *problem_.run;
  const auto [first, rows] = run.segments[s];
  std::vector<FilteredSensor> filtered;
  for (const VehicleRun::Output& output : run.outputs) {
    const VehicleQuantity quantity = output.sensor.quantity;
    filtered.push_back(
        {car.sensors[static_cast<std::size_t>(quantity)].lag, point.effects[filter_of(quantity)]});
  }
  SignalRows value(rows, static_cast<Eigen::Index>(sensors.size()));
  const Eigen::Index begin = n;
  for (Eigen::Index k = 0; k < rows; ++k) {
    const Eigen::Index row = first + k;
    const Sample& at = moved_[s][static_cast<std::size_t>(k)];
    const double step = k == 0 ? 0.0 : run.time[row] - run.time[row - 1];
    for (std::size_t j = 0; j < sensors.size(); ++j) {
      const double now =
          reading(point.effects, run.outputs[j].sensor, sensors[j], at.motion, at.vx);
      value(k, static_cast<Eigen::Index>(j)) = filtered[j].next(now, step);
    }
    for (; n < e.size() && problem_.row[n] == row; ++n) {
      e[n] = value(k, problem_.output[n]) - problem_.sample[n];
    }
  }
  if (problem_.late_sensors) show_late(car, s, value, begin, n, e);
}

/// Errors of what the sensors showed, which are late.
void SecondarySimulation::show_late(const SingleTrack<>& car, std::size_t s,
                                    const SignalRows& value, Eigen::Index begin, Eigen::Index end,
                                    Eigen::VectorXd& e) const {
  const VehicleRun& run = *problem_.run;
  const auto [first, rows] = run.segments[s];
  const Eigen::VectorXd time = run.time.segment(first, rows);
  for (std::size_t j = 0; j < run.outputs.size(); ++j) {
    const auto quantity = static_cast<std::size_t>(run.outputs[j].sensor.quantity);
    const auto column = static_cast<Eigen::Index>(j);
    if (car.sensors[quantity].delay == 0.0) continue;
    const SignalRows shown = late(time, value.col(column), time, car.sensors[quantity].delay);
    for (Eigen::Index n = begin; n < end; ++n) {
      if (problem_.output[n] == column) e[n] = shown(problem_.row[n] - first) - problem_.sample[n];
    }
  }
}

}  // namespace identikal
