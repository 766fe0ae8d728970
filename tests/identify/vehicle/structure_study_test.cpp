// Does the interval hold the truth where the car does what the model does not have?
#include "identify/vehicle/internal/structure_study.h"

#include <cmath>
#include <cstdio>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/internal/structure_judgement.h"
#include "lib/vehicle/sladka2010_car.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

using ::testing::HasSubstr;
using Structure = VehicleFitOptions::Structure;

const Finding* finding(const VehicleEstimate& fit, FindingCode code) {
  for (const Finding& finding : fit.findings) {
    if (finding.code == code) return &finding;
  }
  return nullptr;
}

// A swept sine at 80 km/h, 25 s at 50 Hz, r and ay.
Dataset swept(const SecondaryEffects& effects, double delay, std::uint64_t seed,
              double rear_tyres = 1.0) {
  constexpr double kSpeed = 80.0 / 3.6;
  const Eigen::VectorXd time = uniform_time(25.0, 50.0);
  const auto angle = [](double t) {
    return 0.45 * std::sin(2.0 * std::numbers::pi * (0.1 + 0.045 * t) * t);
  };
  Dataset data = record({}, time, {"r", "ay"}, angle, [](double) { return kSpeed; });
  const DrivenSegment driven = drive(time, data.u.row(0).transpose(), data.u.row(1).transpose(),
                                     {.longest_step = 0.002}, delay);
  double r = 0.0, ay = 0.0;
  SingleTrack<> car = linear_car(sladka2010_car());
  car.rear.stiffness *= rear_tyres;
  simulate_with_effects(
      car, effects, driven, 0.0, 0.0, [&](Eigen::Index k, const Motion& motion, double) {
        r = k > 0 ? lagged(data.y(0, k - 1), r, motion.r, 0.02, effects[kLagOfR]) : motion.r;
        ay = motion.ay;
        data.y.col(k) << r, ay;
        r = motion.r;
      });
  return with_noise(data, {0.003, 0.05}, seed);
}

VehicleEstimate fitted(const Dataset& data, Structure structure) {
  VehicleFitOptions options;
  options.structure = structure;
  return fit_vehicle(sladka2010_model({"r", "ay"}), data, options);
}

double z_of(const VehicleEstimate& fit, const char* name, double truth) {
  return (parameter(fit, name).value - truth) / parameter(fit, name).se;
}

// 24 cars, their lags and roll drawn from the priors that the study has. With 95 % each, fewer than
// 20 of 24 within the interval come in 0.3 % of all seeds; a mean of z beyond 0.6 comes as rarely. This
// seed is fixed.
TEST(StructureStudy, IntervalsHoldTheTruthOfCarsThatTheModelIsNot) {
  constexpr int kCars = 24;
  Random random(5);
  // Drawn as the priors have them, of a car of 1.45 t.
  int as_written = 0, automatic = 0, noise_alone = 0;
  double sum = 0.0, half_width = 0.0;
  for (int n = 0; n < kCars; ++n) {
    SecondaryEffects effects{};
    effects[kTyreRelaxation] = std::abs(0.25 + 0.25 * random.normal());
    effects[kSteeringLag] = std::abs(0.015 * random.normal());
    effects[kRollGradient] = std::abs(0.005 + 0.005 * random.normal());
    effects[kRollSteerFront] = 0.15 * 0.01 * random.normal();
    effects[kRollSteerRear] = 0.15 * 0.0065 * random.normal();
    const Dataset data = swept(effects, 0.008 * random.normal(), 100 + n);
    noise_alone += std::abs(z_of(fitted(data, Structure::ignored), "Iz", 2319.0)) < 1.96;
    as_written += std::abs(z_of(fitted(data, Structure::as_written), "Iz", 2319.0)) < 1.96;
    const VehicleEstimate fit = fitted(data, Structure::automatic);
    const double z = z_of(fit, "Iz", 2319.0);
    automatic += std::abs(z) < 1.96;
    sum += z;
    half_width += 1.96 * parameter(fit, "Iz").se / 2319.0;
  }
  std::printf("of %d cars Iz lies in its interval: %d by the noise alone, %d as written, %d auto\n",
              kCars, noise_alone, as_written, automatic);
  std::printf("auto: mean of z %.2f, of the interval's half width %.1f %%\n", sum / kCars,
              100.0 * half_width / kCars);
  EXPECT_LT(std::abs(sum / kCars), 0.6);
  EXPECT_LT(noise_alone, kCars / 2);
  EXPECT_GE(as_written, 20);
  EXPECT_GE(automatic, 20);
}

TEST(StructureStudy, ASingleTrackStaysWhereItIs) {
  const Dataset data = swept({}, 0.0, 7);
  const VehicleEstimate fit = fitted(data, Structure::as_written);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    const EstimatedParameter& p = parameter(fit, name);
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
    EXPECT_GT(p.se_structure, 0.0);
    EXPECT_LE(p.se_structure, p.se);
    EXPECT_EQ(p.value, parameter(fitted(data, Structure::ignored), name).value);
  }
}

TEST(StructureStudy, NamesWhatTheRecordingShows) {
  SecondaryEffects effects{};
  effects[kSteeringLag] = 0.08;
  const VehicleEstimate fit = fitted(swept(effects, 0.0, 3), Structure::automatic);
  const DerivedValue* lag = derived(fit, "steering lag");
  ASSERT_NE(lag, nullptr);
  EXPECT_NEAR(lag->value, 0.08, 0.02);
  EXPECT_THAT(fit.notes, ::testing::Contains(HasSubstr("steering lag 0.0")));
  EXPECT_LT(std::abs(z_of(fit, "Iz", 2319.0)), 2.6);
}

// Four standard deviations of what most cars have, and a car nevertheless.
TEST(StructureStudy, ALongLagOfTheSteeringIsFoundAndIsNoSurprise) {
  SecondaryEffects effects{};
  effects[kSteeringLag] = 0.075;
  effects[kTyreRelaxation] = 0.3;
  const VehicleEstimate fit = fitted(swept(effects, 0.0, 14), Structure::automatic);
  EXPECT_NEAR(derived(fit, "steering lag")->value, 0.075, 0.015);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
}

// The body rolls fast, little damped, about an axis at half of its usual depth, and the sensor of ay
// sits on the roof. Without its height the lag of the steering and the inertia paid for it.
TEST(StructureStudy, ASensorThatSitsHighCostsTheInertiaNothing) {
  SecondaryEffects effects{};
  effects[kRollGradient] = 0.012;
  effects[kRollQuickness] = 0.3;
  effects[kRollDecay] = -0.3;
  effects[kRollArm] = -0.2;
  effects[kHeightOfAy] = 0.5;
  effects[kTyreRelaxation] = 0.2;
  const VehicleEstimate fit = fitted(swept(effects, 0.0, 15), Structure::automatic);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_NEAR(derived(fit, "height of ay")->value, 0.5, 0.15);
  EXPECT_NEAR(derived(fit, "steering lag")->value, 0.0, 0.01);
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
  EXPECT_LT(parameter(fit, "Iz").se, 0.15 * 2319.0);
}

// A third of Cf and Cr by the noise alone, whatever rolls or lags.
TEST(StructureStudy, WhatTheNoiseLeavesOpenIsRefusedToo) {
  const Dataset data = with_noise(swept({}, 0.0, 16), {0.4, 5.0}, 17);
  const VehicleEstimate fit = fitted(data, Structure::ignored);
  ASSERT_GT(parameter(fit, "Cf").se, 0.25 * parameter(fit, "Cf").value);
  EXPECT_EQ(fit.status, Status::untrusted) << fit.message;
  ASSERT_NE(finding(fit, FindingCode::weak_direction), nullptr);
  EXPECT_EQ(finding(fit, FindingCode::weak_direction)->severity, Severity::serious);
}

// Turns at 5 to 8 m/s, wheels up to 16 degrees, by small angles.
Dataset tight_turns() {
  const auto angle = [](double t) { return 6.0 * std::sin(0.6 * t); };
  const auto speed = [](double t) { return 6.5 + 1.5 * std::sin(0.2 * t); };
  return record({}, uniform_time(60.0, 50.0), {"r", "ay"}, angle, speed);
}

// Of a front-driven car: a yaw rate that small angles miss by 3 %.
TEST(StructureStudy, TightTurnsAreNoOtherCar) {
  SecondaryEffects effects{};
  effects[kWideAngles] = 1.0;
  effects[kFrontDrive] = 1.0;
  Dataset data = tight_turns();
  const DrivenSegment driven = drive(data.time, data.u.row(0).transpose(),
                                     data.u.row(1).transpose(), {.longest_step = 0.002});
  simulate_with_effects(
      linear_car(sladka2010_car()), effects, driven, 0.0, 0.0,
      [&](Eigen::Index k, const Motion& motion, double) { data.y.col(k) << motion.r, motion.ay; });
  data = with_noise(data, {0.003, 0.3}, 18);
  EXPECT_GT(fitted(data, Structure::ignored).simulation[0].rmse, 0.004);
  const VehicleEstimate fit = fitted(data, Structure::automatic);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_THAT(fit.notes, ::testing::Contains(HasSubstr("the road wheels turn by up to 16.4 deg")));
  EXPECT_NEAR(fit.simulation[0].rmse, 0.003, 0.0002);
  EXPECT_NEAR(derived(fit, "front drive")->value, 1.0, 0.2);
  EXPECT_GT(derived(fit, "wide angles")->value, 0.8);
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
}

// The same turns in a simulator that takes any angle for a small one.
TEST(StructureStudy, ASimulatorOfSmallAnglesIsSeenToBeOne) {
  Dataset data = tight_turns();
  data = with_noise(data, {0.003, 0.3}, 18);
  const VehicleEstimate fit = fitted(data, Structure::automatic);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_LT(derived(fit, "wide angles")->value, 0.3);
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
}

// Yaw rate alone at one speed does not tell it.
TEST(StructureStudy, TheDrivenAxleIsKnownWhereTheModelSaysIt) {
  const auto angle = [](double t) { return 6.0 * std::sin(0.6 * t); };
  Dataset data = record({}, uniform_time(30.0, 25.0), {"r"}, angle, [](double) { return 6.0; });
  data = with_noise(data, {0.003}, 19);
  VehicleFitOptions options;
  options.structure = Structure::automatic;
  Model model = sladka2010_model({"r"});
  EXPECT_GT(derived(fit_vehicle(model, data, options), "front drive")->se, 0.15);
  for (const double share : {0.0, 1.0}) {
    as_vehicle(model).front_drive = share;
    const VehicleEstimate told = fit_vehicle(model, data, options);
    EXPECT_NEAR(derived(told, "front drive")->value, share, 0.15);
    EXPECT_LE(derived(told, "front drive")->se, 0.1);
  }
}

// As written the lag is a softer rear axle, 75 kN/rad where it may.
TEST(StructureStudy, ABoundOfTheModelAsWrittenIsNoneOfTheStudys) {
  SecondaryEffects effects{};
  effects[kSteeringLag] = 0.03;
  Model model = sladka2010_model({"r", "ay"});
  for (auto& p : model.parameters) {
    if (p.name == "Cr") p.min = 80e3;
  }
  VehicleFitOptions options;
  const Dataset data = swept(effects, 0.0, 13);
  EXPECT_EQ(parameter(fit_vehicle(model, data, options), "Cr").verdict, Verdict::at_bound);
  options.structure = Structure::automatic;
  const VehicleEstimate fit = fit_vehicle(model, data, options);
  EXPECT_EQ(parameter(fit, "Cr").verdict, Verdict::ok);
  EXPECT_LT(std::abs(z_of(fit, "Cr", 88107.7)), 2.6);
  EXPECT_THAT(
      fit.findings,
      ::testing::Not(::testing::Contains(::testing::Field(&Finding::code, FindingCode::at_bound))));
}

TEST(StructureStudy, NamesTyresThatChangeHalfway) {
  Dataset data = swept({}, 0.0, 8);
  const Eigen::Index later = data.y.cols() / 2;
  data.y.rightCols(later) = swept({}, 0.0, 8, 0.75).y.rightCols(later);
  for (const Structure structure : {Structure::as_written, Structure::automatic}) {
    const VehicleEstimate fit = fitted(data, structure);
    EXPECT_EQ(fit.status, Status::untrusted);
    const Finding* changes = finding(fit, FindingCode::car_changes);
    ASSERT_NE(changes, nullptr) << fit.message;
    EXPECT_EQ(changes->about.front(), "change of Cr");
    EXPECT_THAT(changes->text, HasSubstr("change of Cr -0.2"));
  }
}

TEST(StructureStudy, NamesASensorThatIsLate) {
  Dataset data = swept({}, 0.0, 9);
  const Eigen::Index late = 4;  // 80 ms
  const Eigen::VectorXd r = data.y.row(0);
  data.y.row(0).tail(r.size() - late) = r.head(r.size() - late).transpose();
  const VehicleEstimate fit = fitted(data, Structure::automatic);
  EXPECT_NE(fit.status, Status::ok);
  const Finding* differs = finding(fit, FindingCode::sensor_differs);
  ASSERT_NE(differs, nullptr) << fit.message;
  EXPECT_THAT(differs->about.front(), HasSubstr(" of r"));  // delay or lag
}

// 61 % of the weight in front, and the model file says behind.
TEST(StructureStudy, NamesAxleDistancesThatAreExchanged) {
  Model model = sladka2010_model({"r", "ay"});
  for (auto& p : model.parameters) {
    if (p.name == "a" || p.name == "b") p.value(0, 0) = 0.987 + 1.525 - p.scalar();
  }
  for (const Structure structure : {Structure::as_written, Structure::automatic}) {
    VehicleFitOptions options;
    options.structure = structure;
    const VehicleEstimate fit = fit_vehicle(model, swept({}, 0.0, 10), options);
    EXPECT_NE(fit.status, Status::ok);
    const Finding* exchanged = finding(fit, FindingCode::structure_dependent);
    ASSERT_NE(exchanged, nullptr) << fit.message;
    EXPECT_THAT(exchanged->text, HasSubstr("as if a and b were exchanged, off by -0."));
  }
}

TEST(StructureStudy, AllowsForASpeedOfAnotherScale) {
  Dataset data = swept({}, 0.0, 11);
  data.u.row(1) *= 1.1;  // of the true one 0.909
  EXPECT_GT(z_of(fitted(data, Structure::ignored), "Cr", 88107.7), 2.6);
  const VehicleEstimate fit = fitted(data, Structure::automatic);
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
  const Finding* scale = finding(fit, FindingCode::sensor_differs);
  ASSERT_NE(scale, nullptr) << fit.message;
  EXPECT_EQ(scale->severity, Severity::note);
  EXPECT_THAT(scale->text, HasSubstr("scale of the speed off by -0.09"));
}

// 0.3 m are more than equipment usually has and less than what is refused.
TEST(StructureStudy, AllowsForASensorOfVyThatSitsElsewhere) {
  const auto angle = [](double t) { return 0.4 * std::sin(1.3 * t); };
  const auto speed = [](double) { return 22.0; };
  Dataset data = with_noise(record({}, uniform_time(25.0, 50.0), {"r", "vy"}, angle, speed),
                            {0.003, 0.02}, 12);
  data.y.row(1) += 0.3 * data.y.row(0);
  VehicleFitOptions options;
  options.structure = Structure::ignored;
  const Model model = sladka2010_model({"r", "vy"});
  EXPECT_GT(z_of(fit_vehicle(model, data, options), "Cf", 88107.7), 2.6);
  options.structure = Structure::automatic;
  const VehicleEstimate fit = fit_vehicle(model, data, options);
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    EXPECT_LT(std::abs(z_of(fit, name, truth)), 2.6) << name;
  }
}

// A study of Iz = 2000 +- 100, 900 away from the model as it is written.
StructureStudy study_far_from_the_model(double surprise) {
  StructureStudy study;
  study.converged = true;
  study.value = Eigen::VectorXd::Constant(1, 2000.0);
  study.covariance = Eigen::MatrixXd::Constant(1, 1, 100.0 * 100.0);
  study.with_causes = Eigen::MatrixXd::Zero(1, 1);
  study.causes = {{"lever arm of ay", "m", 0.0, 0.0, 0.05, 0.05 * surprise, 0.01, "the place"}};
  return study;
}

struct JudgedInertia {
  VehicleUnknowns unknowns;
  VehicleCovariance covariance;
  VehicleEstimate estimate;
};

JudgedInertia judged_inertia() {
  JudgedInertia out;
  out.unknowns.free = {kYawInertia};
  out.unknowns.position = {0};
  out.covariance.inner = {0};
  EstimatedParameter Iz;
  Iz.name = "Iz";
  Iz.unit = "kg m^2";
  Iz.value = 2000.0;
  Iz.se = 100.0;
  Iz.ci95 = {1800.0, 2200.0};
  out.estimate.parameters = {Iz};
  return out;
}

TEST(StructureStudy, ACauseThatNoCarHasStandsForSomethingElse) {
  const JudgedInertia car = judged_inertia();
  EXPECT_TRUE(check_structure(study_far_from_the_model(3.0), car.unknowns, car.estimate).empty());
  const Findings found =
      check_structure(study_far_from_the_model(-4.0), car.unknowns, car.estimate);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].code, FindingCode::structure_dependent);
  EXPECT_EQ(found[0].severity, Severity::serious);
  EXPECT_THAT(found[0].text, HasSubstr("lever arm of ay -0.20 +- 0.01 m"));
}

// Two thirds of the shift from 1100 to 2000 would be 600.
TEST(StructureStudy, OfAShiftOfTheInertiaAFifthOfItCounts) {
  JudgedInertia car = judged_inertia();
  car.covariance.covariance = Eigen::MatrixXd::Zero(1, 1);
  take_structure(study_far_from_the_model(0.0), car.unknowns, Eigen::VectorXd::Constant(1, 1100.0),
                 car.covariance);
  EXPECT_DOUBLE_EQ(car.covariance.covariance(0, 0), 100.0 * 100.0 + 400.0 * 400.0);
}

TEST(StructureStudy, UnitsChangeNothing) {
  SecondaryEffects effects{};
  effects[kTyreRelaxation] = 0.4;
  const Dataset data = swept(effects, 0.0, 4);
  Model model = sladka2010_model({"r", "ay"});
  const VehicleEstimate in_newton = fit_vehicle(model, data);
  for (Parameter& p : model.parameters) {
    if (p.name == "Cf") p.unit = "kN/rad";
  }
  const VehicleEstimate in_kilonewton = fit_vehicle(model, data);
  EXPECT_NEAR(parameter(in_kilonewton, "Cf").se_structure,
              1e-3 * parameter(in_newton, "Cf").se_structure,
              1e-9 * parameter(in_newton, "Cf").se_structure);
  EXPECT_EQ(in_newton.status, in_kilonewton.status);
}

}  // namespace
}  // namespace identikal
