#include "lib/single_track.h"

#include <algorithm>
#include <limits>
#include <sstream>
#include <stdexcept>

#include <Eigen/LU>

namespace identikal {
namespace {

constexpr std::array<std::string_view, kVehicleParameters> kNames = {"m",
                                                                     "a",
                                                                     "b",
                                                                     "Iz",
                                                                     "Cf",
                                                                     "Cr",
                                                                     "steering_ratio",
                                                                     "steering_gain",
                                                                     "steering_offset",
                                                                     "steering_delay",
                                                                     "bias_r",
                                                                     "bias_vy",
                                                                     "bias_ay",
                                                                     "mounting_angle",
                                                                     "bank",
                                                                     "relaxation_length",
                                                                     "cg_height",
                                                                     "load_sensitivity",
                                                                     "Ff_max",
                                                                     "Fr_max",
                                                                     "curve_shape",
                                                                     "curve_curvature"};

// Largest step in units of the fastest time constant. One Runge-Kutta step of this length errs by
// about 0.35^5 / 120 = 4e-5 of a mode that has already decayed to 70 % within it.
constexpr double kStepPerTimeConstant = 0.35;
// The same for the lag of the forces, which is fed smoothly.
constexpr double kStepPerRelaxation = 0.7;

}  // namespace

std::string_view name_of(VehicleParameter parameter) {
  return kNames[static_cast<std::size_t>(parameter)];
}

std::optional<VehicleParameter> vehicle_parameter(std::string_view name) {
  const auto found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<VehicleParameter>(found - kNames.begin());
}

VehicleParameters<double> neutral_vehicle() {
  VehicleParameters<double> p{};
  for (const VehicleParameter known : {kMass, kA, kB, kYawInertia, kCf, kCr}) {
    p[known] = std::numeric_limits<double>::quiet_NaN();
  }
  p[kSteeringRatio] = 1.0;
  p[kSteeringGain] = 1.0;
  p[kLoadSensitivity] = 1.0;
  p[kCurveShape] = CurveShape().shape;
  p[kCurveCurvature] = CurveShape().curvature;
  return p;
}

SingleTrackMatrices single_track_matrices(const SingleTrack<double>& car, double vx) {
  const double Cf = car.front.stiffness, Cr = car.rear.stiffness, a = car.a, b = car.b;
  SingleTrackMatrices out;
  out.A << -(Cf + Cr) / (car.m * vx), -vx - (a * Cf - b * Cr) / (car.m * vx),
      -(a * Cf - b * Cr) / (car.Iz * vx), -(a * a * Cf + b * b * Cr) / (car.Iz * vx);
  out.B << Cf / car.m, a * Cf / car.Iz;
  return out;
}

DrivenStretch drive(const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                    const Eigen::VectorXd& vx, const IntegrationDemand& demand, double delay) {
  const Eigen::Index n = time.size();
  if (n < 2 || steering.size() != n || vx.size() != n || !(vx.minCoeff() > 0.0)) {
    std::ostringstream text;
    text << "drive: " << n << " time stamps, " << steering.size() << " steering angles, "
         << vx.size() << " speeds";
    if (vx.size() > 0) text << " (smallest " << vx.minCoeff() << " m/s)";
    throw std::invalid_argument(text.str());
  }
  const Pchip vx_at(time, vx);
  DrivenStretch out;
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

void set_delay(DrivenStretch& stretch, const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
               double delay) {
  const Pchip steering_at(time, steering);
  const Eigen::Index n = time.size();
  stretch.delay = delay;
  Eigen::Index from = 0;  // interval that holds the time to read at
  const auto read = [&](DrivenStretch::Node& node, double t) {
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
  read(stretch.nodes[at++], time[0] - delay);
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const DrivenStretch::Interval& interval = stretch.intervals[static_cast<std::size_t>(k)];
    for (int half = 1; half < 2 * interval.steps; ++half) {
      read(stretch.nodes[at++], time[k] + 0.5 * half * interval.step - delay);
    }
    read(stretch.nodes[at++], time[k + 1] - delay);
  }
}

Eigen::Vector2d steady_state(const SingleTrack<double>& car, const DrivenStretch::Node& at) {
  const SingleTrackMatrices model = single_track_matrices(car, at.vx);
  const double delta = car.steering_gain * (at.steering + car.steering_offset) / car.steering_ratio;
  Eigen::Vector2d forcing = model.B * delta;
  forcing[0] -= kStandardGravity * std::sin(car.bank);
  const Eigen::Vector2d x = -model.A.inverse() * forcing;
  // Near the critical speed the steady state runs away; no car is found there.
  return x.allFinite() && std::abs(x[0]) < at.vx ? x : Eigen::Vector2d::Zero();
}

std::optional<VehicleQuantity> vehicle_quantity(std::string_view name) {
  if (name == "r") return VehicleQuantity::r;
  if (name == "vy") return VehicleQuantity::vy;
  if (name == "ay") return VehicleQuantity::ay;
  if (name == "beta") return VehicleQuantity::beta;
  return std::nullopt;
}

}  // namespace identikal
