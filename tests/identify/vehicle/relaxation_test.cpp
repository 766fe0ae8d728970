// Relaxation lengths of vehicles of all sizes: recovered from recordings made without the library, and
// where the search for them ends.
#include <cmath>
#include <cstdio>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/unknowns.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "tests/support/vehicle_case.h"

namespace identikal::relaxation_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

struct RelaxingCar {
  double m, a, b, Iz, Cf, Cr, relaxation_length, speed;
};
/// 1:10 and 5 kg, a passenger car, a truck of 18 t.
constexpr RelaxingCar kModelCar{5.0, 0.16, 0.17, 0.10, 160.0, 170.0, 0.01, 3.0};
constexpr RelaxingCar kCar{1446.0, 0.987, 1.525, 2319.0, 88107.7, 88107.7, 0.4, 20.0};
constexpr RelaxingCar kTruck{18000.0, 3.6, 1.9, 1.2e5, 4.0e5, 8.0e5, 0.6, 18.0};

/// Slip makes forces that follow it over the relaxation length; steps of 0.1 ms, midpoint rule. The
/// steering at the road sweeps, more quickly for a shorter car.
Dataset drive_of(const RelaxingCar& car, double rate) {
  const double quick = std::sqrt(2.5 / (car.a + car.b));
  const auto angle = [&](double t) { return 0.03 * std::sin(quick * (1.5 + 0.5 * t) * t); };
  const double h = 1e-4;
  const auto every = static_cast<int>(std::lround(1.0 / (rate * h)));
  Dataset out;
  out.name = "simulated.csv";
  out.time = uniform_time(20.0, rate);
  out.dt = 1.0 / rate;
  out.inputs = {{"road_wheel_angle", "rad"}, {"vx", "m/s"}};
  out.outputs = {{"r", "rad/s"}, {"vy", "m/s"}};
  out.u.resize(2, out.time.size());
  out.y.resize(2, out.time.size());
  Eigen::Vector4d x = Eigen::Vector4d::Zero();  // vy, r, Ff, Fr
  const auto rates = [&](double t, const Eigen::Vector4d& now) {
    const double lag = car.speed / car.relaxation_length;
    const double front = -car.Cf * ((now[0] + car.a * now[1]) / car.speed - angle(t));
    const double rear = -car.Cr * (now[0] - car.b * now[1]) / car.speed;
    return Eigen::Vector4d((now[2] + now[3]) / car.m - car.speed * now[1],
                           (car.a * now[2] - car.b * now[3]) / car.Iz, lag * (front - now[2]),
                           lag * (rear - now[3]));
  };
  Random random(5);
  for (Eigen::Index k = 0; k < out.time.size(); ++k) {
    const double t = out.time[k];
    out.u.col(k) << angle(t), car.speed;
    out.y.col(k) << x[1] + 0.002 * random.normal(), x[0] + 0.003 * random.normal();
    for (int i = 0; i < every; ++i) {
      const double at = t + i * h;
      x += h * rates(at + 0.5 * h, x + 0.5 * h * rates(at, x));
    }
  }
  return out;
}

std::string file_of(const RelaxingCar& car, const std::string& relaxation_length) {
  return fmt::format(R"(
identikal: 1
model: single-track
time: {{column: t, unit: s}}
parameters:
  m: {} kg
  a: {} m
  b: {} m
  Iz: {{value: {} kg m^2}}
  Cf: {{value: {} N/rad}}
  Cr: {{value: {} N/rad}}
  relaxation_length: {}
inputs: {{road_wheel_angle: {{unit: rad}}, vx: {{unit: m/s}}}}
outputs: {{r: {{unit: rad/s}}, vy: {{unit: m/s}}}}
)",
                     car.m, car.a, car.b, 0.8 * car.Iz, 0.8 * car.Cf, 1.2 * car.Cr,
                     relaxation_length);
}

Model model_of(const RelaxingCar& car, const std::string& relaxation_length) {
  return parse_model_file(file_of(car, relaxation_length), "car.yaml");
}

// With Iz, Cf and Cr free too, whose ranges in the model file go with the vehicle's size.
TEST(RelaxationLength, IsRecoveredAtEverySize) {
  for (const RelaxingCar& car : {kModelCar, kCar, kTruck}) {
    const Dataset data = drive_of(car, 200.0);
    const std::string start = fmt::format("{{value: {} m}}", 3.0 * car.relaxation_length);
    const VehicleEstimate fit = fit_vehicle(model_of(car, start), data, of_noise_alone());
    const struct {
      const char* name;
      double truth;
    } wanted[] = {{"relaxation_length", car.relaxation_length},
                  {"Iz", car.Iz},
                  {"Cf", car.Cf},
                  {"Cr", car.Cr}};
    std::printf("%7.0f kg:", car.m);
    for (const auto& [name, truth] : wanted) {
      const EstimatedParameter& p = parameter(fit, name);
      std::printf(" %s %.4g +- %.2g (%.4g)", name, p.value, p.se, truth);
      EXPECT_NEAR(p.value, truth, 3.5 * p.se) << name;
    }
    std::printf("\n");
    EXPECT_LT(parameter(fit, "relaxation_length").se, 0.25 * car.relaxation_length);
    EXPECT_EQ(fit.status, Status::ok) << fit.message;
  }
}

// The bounds are those of the vehicle's size: 0.02 wheelbases, less where the file says so.
TEST(RelaxationLength, BoundsGoWithTheWheelbase) {
  const auto lower = [](const RelaxingCar& car, const std::string& given) {
    const VehicleUnknowns unknowns = vehicle_unknowns(model_of(car, given));
    return unknowns.lower[unknowns.find(kRelaxationLength)] / (car.a + car.b);
  };
  for (const RelaxingCar& car : {kModelCar, kCar, kTruck}) {
    EXPECT_NEAR(lower(car, "{value: 0.2 m}"), 0.02, 1e-12);
    EXPECT_NEAR(lower(car, "{value: 0.2 m, min: 0}"), 0.02, 1e-12);
    EXPECT_NEAR(lower(car, fmt::format("{{value: 0.2 m, min: {}}}", 0.005 * (car.a + car.b))),
                0.005, 1e-12);
    EXPECT_NEAR(lower(car, "{value: 0.2 m, min: 1e-6}"), 0.002, 1e-12);
    EXPECT_NEAR(vehicle_unknowns(model_of(car, fmt::format("{} m", 0.003 * (car.a + car.b))))
                    .value[kRelaxationLength],
                0.003 * (car.a + car.b), 1e-12);
  }
  EXPECT_THAT([] { vehicle_unknowns(model_of(kModelCar, "0.1 mm")); },
              ThrowsMessage<InputError>(HasSubstr("at least 0.002 wheelbases, 0.00066 m")));
}

}  // namespace
}  // namespace identikal::relaxation_test
