#include "identify/handling/internal/drive_signals.h"

#include <cmath>

#include "identify/vehicle/output_error.h"
#include "lib/vehicle/manoeuvre.h"
#include "lib/vehicle/steady_turn.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

DriveSignals without_outputs(const VehicleRun& run) {
  DriveSignals out;
  out.segments = run.segments;
  out.step = run.step;
  out.time = run.time;
  out.steering = run.steering;
  out.vx = run.vx;
  out.r = out.ay = out.beta = VectorXd::Constant(run.time.size(), kNone);
  return out;
}

VehicleUnknowns known(TyreCurve curve, const VehicleParameters<double>& p) {
  VehicleUnknowns out;
  out.value = p;
  out.curve = curve;
  return out;
}

}  // namespace

DriveSignals measured_signals(const VehicleRun& run, const VehicleParameters<double>& p) {
  DriveSignals out = without_outputs(run);
  const SingleTrack<> car = linear_car(p);
  const auto row_of = [&](VehicleQuantity quantity) { return run.find(quantity); };
  if (const Index j = row_of(VehicleQuantity::r); j >= 0) {
    out.r = run.y.row(j).transpose().array() - p[kBiasR];
  }
  if (const Index j = row_of(VehicleQuantity::ay); j >= 0) {
    out.ay = run.y.row(j).transpose().array() - p[kBiasAy];
  }
  const Index vy = row_of(VehicleQuantity::vy);
  const Index j = vy >= 0 ? vy : row_of(VehicleQuantity::beta);
  if (j < 0) return out;
  const VehicleReading reading(run.outputs[j].sensor, car);
  const bool needs_r = run.outputs[j].sensor.x != 0.0 || run.outputs[j].sensor.y != 0.0;
  for (Index t = 0; t < out.beta.size(); ++t) {
    const double r = needs_r ? out.r[t] : 0.0;
    if (!(out.vx[t] > 0.0)) continue;
    out.beta[t] = reading.lateral_velocity(run.y(j, t), out.vx[t], r) / out.vx[t];
  }
  return out;
}

DriveSignals simulated_signals(const VehicleRun& run, TyreCurve curve,
                               const VehicleParameters<double>& p) {
  DriveSignals out = without_outputs(run);
  const VehicleUnknowns car = known(curve, p);
  const VehicleProblem problem = make_vehicle_problem(run, car, demand_of(car, p));
  const Index j = run.find(VehicleQuantity::ay);
  VehicleSensor sensor{.quantity = VehicleQuantity::ay};
  if (j >= 0) sensor = run.outputs[j].sensor;
  VehicleParameters<double> without_bias = p;
  without_bias[kBiasAy] = 0.0;
  const VehicleReading ay(sensor, car_with(curve, without_bias));
  replay(problem, coordinates_of(problem, p), [&](Index t, const Motion& motion, double vx) {
    out.r[t] = motion.r;
    out.beta[t] = motion.vy / vx;
    out.ay[t] = ay.value(motion, vx);
  });
  return out;
}

VehicleRun step_run(TyreCurve curve, const VehicleParameters<double>& p, double vx, double ay) {
  constexpr double kStep = 0.005, kSeconds = 6.0;
  const auto N = static_cast<Index>(std::lround(kSeconds / kStep)) + 1;
  const SingleTrack<> car = car_with(curve, p);
  const double per_wheel = car.steering_ratio / car.steering_gain;
  StepSteer step;
  step.amplitude = steady_turn(car, ay, vx).road_wheel_angle * per_wheel;
  step.start = 1.5;
  VehicleRun out;
  out.step = kStep;
  out.time = VectorXd::LinSpaced(N, 0.0, kSeconds);
  out.steering = steering(step, out.time).array() - car.steering_offset;
  out.vx = VectorXd::Constant(N, vx);
  VehicleRun::Output yaw_rate;
  yaw_rate.name = "r";
  yaw_rate.unit = "rad/s";
  out.outputs.push_back(yaw_rate);
  out.y = Eigen::MatrixXd::Constant(1, N, kNone);
  out.segments.push_back({0, N});
  out.recording.assign(static_cast<std::size_t>(N), 0);
  out.used = N;
  out.used_of = {N};
  return out;
}

}  // namespace identikal
