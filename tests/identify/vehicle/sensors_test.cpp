// Sensors of a vehicle with a gain, a delay, a filter and a place of their own: derivatives, recovery
// from recordings made without the library, units, and what is refused.
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/output_error.h"
#include "lib/base/error.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

const char* const kCarOfSensors = R"(
identikal: 1
model: single-track
time: {column: t, unit: s}
parameters:
  m: 1446 kg
  a: 0.987 m
  b: 1.525 m
  steering_ratio: 21
  Iz: {value: 2000 kg m^2, min: 500, max: 9000}
  Cf: {value: 80 kN/rad, min: 10, max: 400}
  Cr: {value: 80 kN/rad, min: 10, max: 400}
inputs: {steering_wheel_angle: {unit: rad}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, vy: {unit: m/s}, ay: {unit: m/s^2}}
)";

Model car_with_sensors(const std::string& sensors) {
  return parse_model_file(kCarOfSensors + ("sensors: " + sensors + "\n"), "car.yaml");
}

/// A weave whose frequency rises, two speeds.
double weave_angle(double t) { return 0.6 * std::sin((1.2 + 0.15 * t) * t); }
double weave_speed(double t) { return 18.0 + 6.0 * std::tanh(t - 15.0); }

/// What sensors with these faults show of the Sladká car, by its own integration at 1 kHz and
/// Euler's rule for the filter.
struct SensorFaults {
  double gain = 1.0, delay = 0.0, lag = 0.0, x = 0.0;
};
Dataset shown_with(const SensorFaults& r, const SensorFaults& vy, const SensorFaults& ay,
                   double rate = 100.0) {
  const double seconds = 30.0, fine_rate = 1000.0;
  Dataset fine =
      record({}, uniform_time(seconds, fine_rate), {"r", "vy", "ay"}, weave_angle, weave_speed);
  const Eigen::Index N = fine.size();
  const Eigen::RowVectorXd yaw = fine.y.row(0);
  for (Eigen::Index t = 0; t < N; ++t) {
    const Eigen::Index before = std::max<Eigen::Index>(t - 1, 0), after = std::min(t + 1, N - 1);
    fine.y(1, t) += vy.x * yaw[t];
    fine.y(2, t) += ay.x * (yaw[after] - yaw[before]) / (fine.time[after] - fine.time[before]);
  }
  const SensorFaults* faults[] = {&r, &vy, &ay};
  Dataset out =
      record({}, uniform_time(seconds, rate), {"r", "vy", "ay"}, weave_angle, weave_speed);
  for (Eigen::Index j = 0; j < 3; ++j) {
    Eigen::RowVectorXd y = faults[j]->gain * fine.y.row(j);
    if (faults[j]->lag > 0.0) {
      for (Eigen::Index t = 1; t < N; ++t) {
        const double input = 0.5 * (fine.y(j, t) + fine.y(j, t - 1)) * faults[j]->gain;
        y[t] = input + (y[t - 1] - input) * std::exp(-1.0 / fine_rate / faults[j]->lag);
      }
    }
    for (Eigen::Index k = 0; k < out.size(); ++k) {
      const double at = (out.time[k] - faults[j]->delay) * fine_rate;
      const auto from = std::clamp<Eigen::Index>(static_cast<Eigen::Index>(at), 0, N - 2);
      const double share = std::clamp(at - static_cast<double>(from), 0.0, 1.0);
      out.y(j, k) = y[from] + share * (y[from + 1] - y[from]);
    }
  }
  return out;
}

TEST(VehicleSensors, OutputErrorHasExactDerivatives) {
  const Model model = car_with_sensors(
      "{r: {gain: {value: 1.1}, delay: {value: 13 ms}, lag: {value: 8 ms}},"
      " vy: {x: {value: 0.3 m}, y: {value: -0.1 m}, angle: {value: 1 deg}, delay: 20 ms},"
      " ay: {x: {value: 0.5 m}, y: {value: 0.2 m}, angle: {value: 2 deg}, lag: {value: 30 ms},"
      " gain: {value: 0.9}, delay: {value: -7 ms}}}");
  const Dataset data = shown_with({}, {}, {}, 20.0);
  const VehicleRun run = usable_run(model, {data});
  const VehicleUnknowns theta = vehicle_unknowns(model);
  const VehicleProblem problem = make_vehicle_problem(run, theta, demand_of(theta, theta.value));
  ASSERT_EQ(problem.parameters(), 15);
  Eigen::VectorXd z = coordinates_of(problem, theta.value), e, up, down;
  z.tail<2>() << 0.2, 0.4;
  LeastSquares::RowMatrix J;
  ASSERT_TRUE(output_error(problem, z, e, &J));
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    Eigen::VectorXd other = z;
    const double h = 1e-5 * std::max(0.1, std::abs(z[i]));
    other[i] += h;
    output_error(problem, other, up, nullptr);
    other[i] -= 2.0 * h;
    output_error(problem, other, down, nullptr);
    const Eigen::VectorXd difference = (up - down) / (2.0 * h);
    EXPECT_LE((J.col(i) - difference).norm(), 1e-6 * difference.norm()) << "coordinate " << i;
  }
}

TEST(VehicleSensors, WithoutAFaultNothingChanges) {
  const Dataset data = shown_with({}, {}, {});
  const Model plain = car_with_sensors("{ay: {x: 0.2 m}}"),
              late = car_with_sensors("{ay: {x: 0.2 m}, r: {lag: {value: 0 ms}}}");
  Eigen::VectorXd e[2];
  for (int i = 0; i < 2; ++i) {
    const Model& model = i == 0 ? plain : late;
    const VehicleRun run = usable_run(model, {data});
    const VehicleUnknowns theta = vehicle_unknowns(model);
    const VehicleProblem problem = make_vehicle_problem(run, theta, demand_of(theta, theta.value));
    output_error(problem, coordinates_of(problem, theta.value), e[i], nullptr);
  }
  EXPECT_LT((e[0] - e[1]).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(VehicleSensors, FaultsAreFoundWithTheCar) {
  const Dataset data = with_noise(
      shown_with({.gain = 1.05, .delay = 0.06}, {.delay = 0.15, .x = 0.8}, {.lag = 0.08, .x = 1.2}),
      {0.003, 0.02, 0.1}, 4);
  const Model model = car_with_sensors(
      "{r: {gain: {value: 1, min: 0.8, max: 1.2}, delay: {value: 0 ms, min: -50, max: 400}},"
      " vy: {delay: {value: 0 ms, min: 0, max: 400}, x: {value: 0 m, min: -3, max: 3}},"
      " ay: {lag: {value: 0 ms, min: 0, max: 300}, x: {value: 0 m, min: -3, max: 3}}}");
  const VehicleEstimate fit = fit_vehicle(model, {data}, of_noise_alone());
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Iz", 2319.0},
                                    {"Cf", 88.1077},
                                    {"Cr", 88.1077},
                                    {"gain_r", 1.05},
                                    {"delay_r", 60.0},
                                    {"delay_vy", 150.0},
                                    {"x_vy", 0.8},
                                    {"lag_ay", 80.0},
                                    {"x_ay", 1.2}}) {
    const EstimatedParameter& p = parameter(fit, name);
    std::printf("%-9s %9.4g +- %.2g, truth %g %s\n", name, p.value, p.se, truth, p.unit.c_str());
    EXPECT_NEAR(p.value, truth, 3.5 * p.se) << name;
    EXPECT_LT(p.se, 0.05 * truth) << name;
  }
  // What the drawings show is what was fitted.
  EXPECT_GT(fit.simulation[0].fit_percent, 96.0);  // the noise is 3 % of it
}

TEST(VehicleSensors, ValuesDoNotDependOnUnitsAndStart) {
  const Dataset data =
      with_noise(shown_with({.delay = 0.06}, {.x = 0.8}, {}), {0.003, 0.02, 0.1}, 5);
  const auto fit = [&](const std::string& sensors) {
    return fit_vehicle(car_with_sensors(sensors), {data}, of_noise_alone());
  };
  const VehicleEstimate a = fit("{r: {delay: {value: 0 ms}}, vy: {x: {value: 0 m}}}"),
                        b = fit("{r: {delay: {value: 0.1 s}}, vy: {x: {value: -300 mm}}}");
  EXPECT_EQ(a.status, b.status);
  EXPECT_NEAR(parameter(a, "delay_r").value, 1e3 * parameter(b, "delay_r").value,
              1e-3 * parameter(a, "delay_r").se);
  EXPECT_NEAR(parameter(a, "x_vy").value, 1e-3 * parameter(b, "x_vy").value,
              1e-3 * parameter(a, "x_vy").se);
  EXPECT_NEAR(parameter(a, "Iz").value, parameter(b, "Iz").value, 1e-3 * parameter(a, "Iz").se);
}

// The study of the structure knows a delayed sensor: a right model of it shifts no more than its
// errors say.
TEST(VehicleSensors, TheStudyOfTheStructureKnowsThem) {
  const Dataset data = with_noise(shown_with({.delay = 0.15}, {}, {}), {0.003, 0.02, 0.1}, 6);
  const Model model = car_with_sensors("{r: {delay: {value: 100 ms}}}");
  const VehicleEstimate fit = fit_vehicle(model, {data});
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_NEAR(parameter(fit, "Cf").value, 88.1077, 2.6 * parameter(fit, "Cf").se);
  EXPECT_NEAR(parameter(fit, "delay_r").value, 150.0, 2.6 * parameter(fit, "delay_r").se);
}

TEST(VehicleSensors, WhatDoesNotApplyIsRefused) {
  const auto message = [](const auto& what) -> std::string {
    try {
      what();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message([] { car_with_sensors("{r: {x: {value: 0 m}}}"); }),
              HasSubstr("a body turns at the same rate everywhere"));
  EXPECT_THAT(message([] { car_with_sensors("{r: {gain: -1}}"); }), HasSubstr("a value above 0"));
  EXPECT_THAT(message([] { car_with_sensors("{r: {delay: 5 s}}"); }), HasSubstr("between -1 s"));
  EXPECT_THAT(message([] { car_with_sensors("{r: {lag: {value: 1 m}}}"); }), HasSubstr("lag_r"));
  const Dataset data = shown_with({}, {}, {});
  VehicleFitOptions path;
  path.method = VehicleFitOptions::Method::trajectory;
  EXPECT_THAT(message([&] { fit_vehicle(car_with_sensors("{r: {delay: 80 ms}}"), {data}, path); }),
              HasSubstr("--method output-error"));
}

}  // namespace
}  // namespace identikal
