// Load transfer and a steering that gives, in the model file: what is known of them is used, what is
// free is found, and what no recording tells is said.
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "lib/base/error.h"
#include "lib/vehicle/motion.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

using ::testing::Contains;
using ::testing::HasSubstr;

Model degressive_car(const std::string& parameters, const std::string& more) {
  return parse_model_file(R"(
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
)" + parameters + R"(
inputs: {steering_wheel_angle: {unit: rad}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, vy: {unit: m/s}, ay: {unit: m/s^2}}
)" + more,
                          "car.yaml");
}

// 30 s of a weave that reaches 6 m/s^2, with degression .4 of a centre of gravity .55 m high on a track
// of 1.5 m, and steering that gives by .1 deg/kN.
constexpr double kWeaveDegression = 0.4, kWeaveCompliance = 1.745e-6;

Dataset degressive_weave(double degression, double compliance) {
  const auto angle = [](double t) {
    return 2.0 * std::sin((1.2 + 0.1 * t) * t) * (0.3 + t / 40.0);
  };
  Dataset data =
      record({}, uniform_time(30.0, 50.0), {"r", "vy", "ay"}, angle, [](double) { return 22.0; });
  VehicleParameters<double> p = neutral_vehicle();
  p[kMass] = 1446.0;
  p[kA] = 0.987;
  p[kB] = 1.525;
  p[kYawInertia] = 2319.0;
  p[kCf] = p[kCr] = 88107.7;
  p[kSteeringRatio] = 21.0;
  p[kDegression] = degression;
  p[kFrontLoadTransfer] = p[kRearLoadTransfer] = 2.0 * 0.55 / (kStandardGravity * 1.5);
  p[kSteeringCompliance] = compliance;
  const DrivenSegment driven =
      drive(data.time, data.u.row(0), data.u.row(1), {.longest_step = 0.005});
  simulate(linear_car(p), driven, 0.0, 0.0,
           [&](Eigen::Index t, const Motion& at, double) { data.y.col(t) << at.r, at.vy, at.ay; });
  return with_noise(data, {0.002, 0.01, 0.05}, 6);
}

TEST(LoadTransfer, IsFoundWhereItIsFree) {
  const Dataset data = degressive_weave(kWeaveDegression, 0.0);
  const Model model = degressive_car(
      "", "load_transfer: {height: 0.55 m, track: 1.5 m, degression: {value: 0.1}}\n");
  const VehicleEstimate fit = fit_vehicle(model, data, of_noise_alone());
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] :
       {std::pair{"Cf", 88.1077}, {"Cr", 88.1077}, {"Iz", 2319.0}, {"degression", 0.4}}) {
    const EstimatedParameter& p = parameter(fit, name);
    std::printf("%-10s %8.4g +- %.2g, truth %g\n", name, p.value, p.se, truth);
    EXPECT_NEAR(p.value, truth, 3.5 * p.se) << name;
    EXPECT_LT(p.se, 0.1 * truth) << name;
  }
  // Without it the stiffnesses are those of a car that leans: too small.
  const VehicleEstimate without = fit_vehicle(degressive_car("", ""), data, of_noise_alone());
  EXPECT_LT(parameter(without, "Cf").value, 0.97 * 88.1077);
}

TEST(LoadTransfer, IsReadWithItsShares) {
  const Model model = degressive_car(
      "", "load_transfer: {height: 55 cm, track: 1.5 m, front_share: 0.6, degression: 0.3}\n");
  const double whole = 2.0 * 0.55 * 2.512 / (kStandardGravity * 1.5);
  const auto value = [&](const char* name) {
    return model.parameters[find_parameter(model.parameters, name)].scalar();
  };
  EXPECT_NEAR(value("load_transfer_front"), 0.6 * whole / 1.525, 1e-12);
  EXPECT_NEAR(value("load_transfer_rear"), 0.4 * whole / 0.987, 1e-12);
  EXPECT_EQ(value("degression"), 0.3);
  for (const auto& [text, message] :
       {std::pair{"{height: 0.5 m, degression: 0.3}", "track"},
        {"{height: 0.5 m, track: 0 m, degression: 0.3}", "track of load_transfer is '0 m'"},
        {"{height: 0.5 m, track: 1.5 m, degression: 1}", "between 0 and 0.95"},
        {"{height: 0.5 m, track: 1.5 m, degression: 0.3, front_share: 2}", "between 0 and 1"}}) {
    try {
      degressive_car("", "load_transfer: " + std::string(text) + "\n");
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
}

// Known, it makes of the axle's stiffness the tyres'; free, nothing tells it from them: not of linear
// tyres, whatever the drive.
TEST(SteeringCompliance, IsUsedWhereKnownAndOpenWhereFree) {
  const Dataset data = degressive_weave(0.0, kWeaveCompliance);
  const VehicleEstimate known =
      fit_vehicle(degressive_car("  steering_compliance: 0.1 deg/kN", ""), data, of_noise_alone());
  EXPECT_EQ(known.status, Status::ok) << known.message;
  EXPECT_NEAR(parameter(known, "Cf").value, 88.1077, 3.5 * parameter(known, "Cf").se);
  const VehicleEstimate without = fit_vehicle(degressive_car("", ""), data, of_noise_alone());
  EXPECT_NEAR(parameter(without, "Cf").value, 88.1077 / (1.0 + kWeaveCompliance * 88107.7),
              3.5 * parameter(without, "Cf").se);
  for (const char* name : {"K", "v_ch", "Tz at 60 km/h"}) {
    if (derived(known, name) == nullptr) continue;
    EXPECT_NEAR(derived(known, name)->value, derived(without, name)->value,
                0.01 * std::abs(derived(without, name)->value))
        << name;
  }
  const VehicleEstimate free = fit_vehicle(
      degressive_car("  steering_compliance: {value: 0.05 deg/kN, min: 0, max: 1}", ""), data);
  EXPECT_NE(free.status, Status::ok);
  EXPECT_NE(parameter(free, "Cf").verdict, Verdict::ok);
  EXPECT_NE(finding(free, FindingCode::not_identifiable), nullptr);
  EXPECT_EQ(parameter(free, "Cr").verdict, Verdict::ok);
}

TEST(SteeringCompliance, OfAPriorWidensTheStiffness) {
  const Dataset data = degressive_weave(0.0, kWeaveCompliance);
  const VehicleEstimate fit = fit_vehicle(
      degressive_car("  steering_compliance: {value: 0.1 deg/kN, min: 0, max: 1, prior: {normal: "
                     "{mean: 0.1, sd: 0.03}}}",
                     ""),
      data, of_noise_alone());
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  const EstimatedParameter& Cf = parameter(fit, "Cf");
  // d log Cf = Cf d kappa.
  EXPECT_NEAR(Cf.se / Cf.value, 0.03 * 1.745e-5 * 88107.7, 0.01);
  EXPECT_NEAR(Cf.value, 88.1077, 3.0 * Cf.se);
}

}  // namespace
}  // namespace identikal
