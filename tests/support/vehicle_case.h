// A car, a manoeuvre and a recording of it, for tests: the car of Sladká (2010), table 8.1,
// simulated by an integration of its own that shares no code with the library.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/model/model_file.h"
#include "identify/vehicle/fit.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "lib/vehicle/manoeuvre.h"
#include "studies/sladka_lane_change.h"

namespace identikal::testing {

struct TrueCar {
  double m = 1446.0, a = 0.987, b = 1.525, Iz = 2319.0, Cf = 88107.7, Cr = 88107.7;
  double steering_ratio = 21.0;
  double inverse_saturation_f = 0.0,
         inverse_saturation_r = 0.0;  ///< 1/(largest force)^2 of a tanh tyre
  double steering_gain = 1.0, steering_offset = 0.0;
};

/// Rows: r [rad/s], vy [m/s], ay [m/s^2], beta [rad] at the centre of gravity, at each time.
/// Steering (at the wheel the driver holds) and speed are functions of time; midpoint rule with
/// steps of at most 0.1 ms.
inline Eigen::MatrixXd true_motion(const TrueCar& car, const Eigen::VectorXd& time,
                                   const std::function<double(double)>& steering,
                                   const std::function<double(double)>& speed) {
  const auto force = [](double C, double inverse_saturation, double slip) {
    const double s = std::sqrt(inverse_saturation);
    return inverse_saturation > 0.0 ? -std::tanh(s * C * slip) / s : -C * slip;
  };
  double vy = 0.0, r = 0.0;
  struct Rates {
    double vy, r, ay;
  };
  const auto rates = [&](double t, double v, double w) {
    const double u = speed(t);
    const double delta =
        car.steering_gain * (steering(t) + car.steering_offset) / car.steering_ratio;
    const double front = force(car.Cf, car.inverse_saturation_f, (v + car.a * w) / u - delta);
    const double rear = force(car.Cr, car.inverse_saturation_r, (v - car.b * w) / u);
    const double ay = (front + rear) / car.m;
    return Rates{ay - u * w, (car.a * front - car.b * rear) / car.Iz, ay};
  };
  Eigen::MatrixXd out(4, time.size());
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    out.col(k) << r, vy, rates(time[k], vy, r).ay, std::atan2(vy, speed(time[k]));
    if (k + 1 == time.size()) break;
    const int steps = static_cast<int>(std::ceil((time[k + 1] - time[k]) / 1e-4 - 1e-6));
    const double h = (time[k + 1] - time[k]) / steps;
    for (int i = 0; i < steps; ++i) {
      const double t = time[k] + i * h;
      const Rates begin = rates(t, vy, r);
      const Rates middle = rates(t + h / 2, vy + h / 2 * begin.vy, r + h / 2 * begin.r);
      vy += h * middle.vy;
      r += h * middle.r;
    }
  }
  return out;
}

inline Eigen::VectorXd uniform_time(double seconds, double rate) {
  const auto n = static_cast<Eigen::Index>(std::lround(seconds * rate));
  Eigen::VectorXd time(n);
  for (Eigen::Index i = 0; i < n; ++i) time[i] = static_cast<double>(i) / rate;
  return time;
}

/// A recording of the outputs named (of r, vy, ay, beta), without noise.
inline Dataset record(const TrueCar& car, const Eigen::VectorXd& time,
                      const std::vector<std::string>& outputs,
                      const std::function<double(double)>& steering_angle,
                      const std::function<double(double)>& speed) {
  const Eigen::MatrixXd motion = true_motion(car, time, steering_angle, speed);
  const std::vector<std::string> known = {"r", "vy", "ay", "beta"},
                                 units = {"rad/s", "m/s", "m/s^2", "rad"};
  Dataset data;
  data.name = "simulated.csv";
  data.time = time;
  data.dt = time.size() > 1 ? time[1] - time[0] : 0.01;
  data.inputs = {{"steering_wheel_angle", "deg"}, {"vx", "km/h"}};
  data.u.resize(2, time.size());
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    data.u.col(k) << steering_angle(time[k]), speed(time[k]);
  }
  data.y.resize(static_cast<Eigen::Index>(outputs.size()), time.size());
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    for (std::size_t i = 0; i < known.size(); ++i) {
      if (known[i] != outputs[j]) continue;
      data.outputs.push_back({known[i], units[i]});
      data.y.row(static_cast<Eigen::Index>(j)) = motion.row(static_cast<Eigen::Index>(i));
    }
  }
  return data;
}

/// The severe lane change at 60 km/h.
inline Dataset lane_change(const TrueCar& car, double rate,
                           const std::vector<std::string>& outputs = {"r", "vy"}) {
  const SevereLaneChange manoeuvre;
  return record(
      car, uniform_time(7.0, rate), outputs, [=](double t) { return steering(manoeuvre, t); },
      [](double) { return 60.0 / 3.6; });
}

/// White noise of this standard deviation on every output, in their order.
inline Dataset with_noise(Dataset data, const std::vector<double>& sd, std::uint64_t seed) {
  Random random(seed);
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    for (std::size_t j = 0; j < sd.size(); ++j) {
      data.y(static_cast<Eigen::Index>(j), t) += sd[j] * random.normal();
    }
  }
  return data;
}

inline Parameter known(const std::string& name, const std::string& unit, double value) {
  Parameter p;
  p.name = name;
  p.unit = unit;
  p.value = Eigen::MatrixXd::Constant(1, 1, value);
  p.fixed = true;
  return p;
}

inline Parameter unknown(const std::string& name, const std::string& unit, double start,
                         double min = -std::numeric_limits<double>::infinity(),
                         double max = std::numeric_limits<double>::infinity()) {
  Parameter p = known(name, unit, start);
  p.fixed = false;
  p.min = min;
  p.max = max;
  return p;
}

using identikal::sladka2010_model;

/// The errors are those of the noise alone.
inline VehicleFitOptions of_noise_alone() {
  VehicleFitOptions options;
  options.structure = VehicleFitOptions::Structure::ignored;
  return options;
}

/// For Monte Carlo: the fit alone, without the survey and the other forms of the model.
inline VehicleFitOptions without_second_opinion() {
  VehicleFitOptions options;
  options.second_opinion = false;
  return options;
}

inline const EstimatedParameter& parameter(const Estimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return p;
  }
  throw std::out_of_range("no parameter " + name);
}

inline const DerivedValue* derived(const Estimate& estimate, const std::string& name) {
  for (const DerivedValue& d : estimate.derived) {
    if (d.name == name) return &d;
  }
  return nullptr;
}

inline const Finding* finding(const Estimate& estimate, FindingCode code) {
  for (const Finding& f : estimate.findings) {
    if (f.code == code) return &f;
  }
  return nullptr;
}

/// 30 s at 20 m/s, 50 Hz, of a car that is kicked once a sample: vy by .03 m/s, r by .01 rad/s
/// (sd); r and vy measured with noise of .003 rad/s and .01 m/s. Euler steps of .5 ms.
inline Dataset disturbed_car(std::uint64_t seed) {
  const auto angle = [](double t) { return 0.5 * std::sin(1.5 * t + 0.05 * t * t); };
  const Eigen::VectorXd time = uniform_time(30.0, 50.0);
  const TrueCar car;
  Random random(seed);
  Dataset data = record(car, time, {"r", "vy"}, angle, [](double) { return 20.0; });
  double vy = 0.0, r = 0.0;
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    data.y.col(k) << r + 0.003 * random.normal(), vy + 0.01 * random.normal();
    for (int i = 0; i < 40; ++i) {
      const double t = time[k] + 0.0005 * i, u = 20.0;
      const double front = -car.Cf * ((vy + car.a * r) / u - angle(t) / 21.0);
      const double rear = -car.Cr * ((vy - car.b * r) / u);
      const double dvy = (front + rear) / car.m - u * r;
      r += 0.0005 * (car.a * front - car.b * rear) / car.Iz;
      vy += 0.0005 * dvy;
    }
    vy += 0.03 * random.normal();
    r += 0.01 * random.normal();
  }
  return data;
}

}  // namespace identikal::testing
