#include "identify/vehicle/fit.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/checks.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/starts.h"
#include "identify/vehicle/tyre_saturation.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "tests/support/shared_data.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

/// Every number that is offered as an error or an interval is one, or is absent altogether.
void expect_no_pretence(const VehicleEstimate& estimate) {
  for (const EstimatedParameter& p : estimate.parameters) {
    EXPECT_TRUE(std::isfinite(p.value)) << p.name;
    EXPECT_EQ(std::isnan(p.se), std::isnan(p.ci95[0])) << p.name;
    if (!std::isnan(p.se)) {
      EXPECT_TRUE(std::isfinite(p.se) && p.se > 0.0) << p.name;
      EXPECT_LT(p.ci95[0], p.value);
      EXPECT_GT(p.ci95[1], p.value);
    } else if (!p.fixed) {
      EXPECT_TRUE(p.verdict == Verdict::not_identifiable || p.verdict == Verdict::at_bound ||
                  p.verdict == Verdict::unexcited)
          << p.name;
    }
  }
  for (const DerivedValue& d : estimate.derived) EXPECT_TRUE(std::isfinite(d.value)) << d.name;
  EXPECT_FALSE(estimate.message.empty());
}

std::string refusal(const Model& model, const Dataset& data) {
  try {
    fit_vehicle(model, data);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(VehicleFit, StopsWhenToldAndSearchesNoFurther) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 1);
  VehicleFitOptions options;
  int calls = 0;
  options.search.progress = [&](int, double) { return ++calls < 3; };
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data, options);
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(fit.status, Status::not_converged);
  EXPECT_THAT(fit.message, HasSubstr("stopped by the caller"));
}

TEST(VehicleFit, FindsTheSladka2010Car) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 1);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data, of_noise_alone());
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7}, {"Cr", 88107.7}, {"Iz", 2319.0}}) {
    const EstimatedParameter& p = parameter(fit, name);
    EXPECT_NEAR(p.value, truth, 3.5 * p.se) << name;
    EXPECT_LT(p.se, 0.01 * truth) << name;
    EXPECT_EQ(p.verdict, Verdict::ok);
    EXPECT_DOUBLE_EQ(p.se, p.crb_se);
  }
  EXPECT_EQ(parameter(fit, "m").value, 1446.0);
  EXPECT_TRUE(parameter(fit, "m").fixed);
  EXPECT_EQ(fit.objective.starts, fit.objective.starts_at_optimum);
  EXPECT_GT(fit.objective.log_likelihood, fit.objective.log_likelihood_start);
  EXPECT_EQ(fit.identifiability.rank, 3);

  // What the car is known by, with errors carried over.
  const auto near = [&](const std::string& name, double truth) {
    const DerivedValue* d = derived(fit, name);
    ASSERT_NE(d, nullptr) << name;
    EXPECT_NEAR(d->value, truth, 3.5 * d->se) << name;
    EXPECT_LT(d->se, 0.02 * truth) << name;
  };
  near("K", 0.003515);
  near("K per g", 1.97497);
  near("v_ch", 96.24);
  near("yaw gain at 60 km/h", 4.7778);
  near("wn at 60 km/h", 8.546);
  near("zeta at 60 km/h", 0.8679);
  near("Tz at 60 km/h", 0.1075);
  ASSERT_NE(derived(fit, "sd(r)"), nullptr);
  EXPECT_NEAR(derived(fit, "sd(r)")->value, 0.01, 4.0 * derived(fit, "sd(r)")->se);
  EXPECT_NEAR(derived(fit, "sd(vy)")->value, 0.03, 4.0 * derived(fit, "sd(vy)")->se);

  ASSERT_EQ(fit.simulation.size(), 2u);
  EXPECT_GT(fit.simulation[0].fit_percent, 90.0);
  EXPECT_TRUE(fit.one_step.empty());
  EXPECT_EQ(fit.series.predicted.cols(), 700);
  EXPECT_EQ(fit.series.standardised.rows(), 2);
  EXPECT_EQ(fit.tests.size(), 2u);
  EXPECT_TRUE(fit.tests[0].pass);
  EXPECT_EQ(fit.inputs.at(0).used, 700);
  expect_no_pretence(fit);
}

// The Gaussian log-likelihood, its AIC and BIC by hand from the residuals; 3 parameters, 2 states,
// 2 variances.
TEST(VehicleFit, ReportsTheLikelihood) {
  const Dataset data = with_noise(lane_change({}, 10.0), {0.01, 0.03}, 2);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  double log_likelihood = 0.0;
  for (Eigen::Index j = 0; j < 2; ++j) {
    const Eigen::VectorXd e = fit.series.measured.row(j) - fit.series.predicted.row(j);
    const double variance = e.squaredNorm() / 70.0;
    log_likelihood -= 35.0 * (std::log(2.0 * std::numbers::pi * variance) + 1.0);
  }
  EXPECT_NEAR(fit.objective.log_likelihood, log_likelihood, 1e-6);
  EXPECT_NEAR(fit.objective.aic, 2.0 * 7.0 - 2.0 * log_likelihood, 1e-6);
  EXPECT_NEAR(fit.objective.bic, 7.0 * std::log(140.0) - 2.0 * log_likelihood, 1e-6);
}

TEST(VehicleFit, StartValueDecidesNothing) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 3);
  const VehicleEstimate reference = fit_vehicle(sladka2010_model(), data);
  for (const double start : {1.2e4, 3.9e5}) {
    Model model = sladka2010_model();
    for (Parameter& p : model.parameters) {
      if (p.name == "Cf") p.value(0, 0) = start;
      if (p.name == "Cr") p.value(0, 0) = 4.1e5 - start;
      if (p.name == "Iz") p.value(0, 0) = 5900.0;
    }
    VehicleFitOptions options;
    options.search.seed = 77;
    const VehicleEstimate fit = fit_vehicle(model, data, options);
    for (const char* name : {"Cf", "Cr", "Iz"}) {
      const double value = parameter(reference, name).value;
      EXPECT_NEAR(parameter(fit, name).value, value, 1e-5 * value) << name;
    }
    EXPECT_EQ(parameter(fit, "Cf").start, start);
  }
}

TEST(VehicleFit, EquationErrorStartsNearby) {
  const Dataset data =
      with_noise(lane_change({}, 100.0, {"r", "vy", "ay", "beta"}), {0.01, 0.03, 0.1, 0.003}, 4);
  for (const std::vector<std::string>& outputs :
       {std::vector<std::string>{"r", "vy"}, {"r", "beta"}, {"r", "ay"}, {"r", "vy", "ay"}}) {
    Model model = sladka2010_model(outputs);
    Dataset part = data;
    part.outputs.clear();
    part.y.resize(static_cast<Eigen::Index>(outputs.size()), data.size());
    for (std::size_t j = 0; j < outputs.size(); ++j) {
      for (std::size_t i = 0; i < data.outputs.size(); ++i) {
        if (data.outputs[i].name != outputs[j]) continue;
        part.outputs.push_back(data.outputs[i]);
        part.y.row(static_cast<Eigen::Index>(j)) = data.y.row(static_cast<Eigen::Index>(i));
      }
    }
    const VehicleUnknowns unknowns = vehicle_unknowns(model);
    VehicleParameters<double> p = unknowns.value;
    ASSERT_TRUE(vehicle_by_equation_error(usable_run(model, {part}), unknowns, p))
        << outputs.back();
    EXPECT_NEAR(p[kCf], 88107.7, 0.15 * 88107.7) << outputs.back();
    EXPECT_NEAR(p[kCr], 88107.7, 0.15 * 88107.7) << outputs.back();
    EXPECT_NEAR(p[kYawInertia], 2319.0, 0.3 * 2319.0) << outputs.back();
  }
  Model model = sladka2010_model({"r"});
  Dataset part = data;
  part.outputs.resize(1);
  part.y.conservativeResize(1, Eigen::NoChange);
  VehicleParameters<double> p = vehicle_unknowns(model).value;
  EXPECT_FALSE(vehicle_by_equation_error(usable_run(model, {part}), vehicle_unknowns(model), p));
  EXPECT_EQ(p[kCf], 8e4);
}

// Yaw rate alone at one speed: enough for three unknowns when everything else is exact.
TEST(VehicleFit, YawRateAlone) {
  const Dataset data = with_noise(lane_change({}, 100.0, {"r"}), {0.002}, 5);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model({"r"}), data);
  for (const char* name : {"Cf", "Cr"}) {
    EXPECT_NEAR(parameter(fit, name).value, 88107.7, 4.0 * parameter(fit, name).se);
  }
  const VehicleEstimate by_noise = fit_vehicle(sladka2010_model({"r"}), data, of_noise_alone());
  EXPECT_GT(by_noise.correlation(1, 2), 0.9);  // Cf and Cr
}

TEST(VehicleFit, SpeaksTheUsersUnits) {
  Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 6);
  const VehicleEstimate si = fit_vehicle(sladka2010_model(), data);
  Model model = sladka2010_model();
  for (Parameter& p : model.parameters) {
    if (p.name == "Cf") p.unit = "kN/rad";
  }
  data.outputs[0].unit = "deg/s";
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_NEAR(parameter(fit, "Cf").value, parameter(si, "Cf").value / 1000.0, 1e-6);
  EXPECT_NEAR(parameter(fit, "Cf").se, parameter(si, "Cf").se / 1000.0, 1e-6);
  EXPECT_NEAR(parameter(fit, "Cf").ci95[0], parameter(si, "Cf").ci95[0] / 1000.0, 1e-6);
  EXPECT_EQ(parameter(fit, "Cf").start, 80.0);
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  EXPECT_NEAR(fit.simulation[0].rmse, kDegrees * si.simulation[0].rmse, 1e-6);
  EXPECT_NEAR(fit.simulation[0].fit_percent, si.simulation[0].fit_percent, 1e-6);
  EXPECT_NEAR(fit.series.measured(0, 200), kDegrees * data.y(0, 200), 1e-12);
  EXPECT_NEAR(fit.correlation(0, 1), si.correlation(0, 1), 1e-4);
  EXPECT_NEAR(derived(fit, "sd(r)")->value, kDegrees * derived(si, "sd(r)")->value, 1e-6);
}

TEST(VehicleFit, RunsInSegments) {
  TrueCar car;
  const SevereLaneChange first;
  SevereLaneChange second;
  second.start = 12.0;
  second.amplitude = -1.4;
  Eigen::VectorXd time(1650);
  for (Eigen::Index i = 0; i < time.size(); ++i) {
    time[i] = 0.01 * static_cast<double>(i) + (i < 900 ? 0.0 : 2.0);  // two seconds are missing
  }
  Dataset data = with_noise(record(
                                car, time, {"r", "vy"},
                                [&](double t) { return steering(first, t) + steering(second, t); },
                                [](double t) { return 16.0 + 3.0 * std::sin(0.5 * t); }),
                            {0.01, 0.03}, 7);
  data.dt = 0.01;
  data.u.row(0).segment(700, 12).setConstant(kNaN);   // longer than max_gap
  data.u.row(1).segment(1300, 20).setConstant(1.0);   // stands still
  data.u(1, 1310) = kNaN;                             // a hole that is bridged
  data.u.row(0).segment(1325, 12).setConstant(kNaN);  // leaves a fragment behind the stop
  data.y.row(0).segment(100, 300).setConstant(kNaN);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  ASSERT_FALSE(fit.notes.empty());
  EXPECT_THAT(fit.notes[0], HasSubstr("in 4 segments"));
  EXPECT_THAT(fit.notes[0], HasSubstr("short segments"));
  EXPECT_THAT(fit.notes[0], HasSubstr("20 rows below 3 m/s"));
  for (const char* name : {"Cf", "Cr"}) {
    EXPECT_NEAR(parameter(fit, name).value, 88107.7, 4.0 * parameter(fit, name).se) << name;
  }
  EXPECT_NEAR(parameter(fit, "Iz").value, 2319.0, 4.0 * parameter(fit, "Iz").se);
  EXPECT_TRUE(std::isnan(fit.series.predicted(0, 1305)));
  EXPECT_TRUE(std::isnan(fit.series.measured(0, 200)));
  EXPECT_FALSE(std::isnan(fit.series.predicted(0, 200)));
}

TEST(VehicleFit, TakesUnevenTimeStamps) {
  Random random(8);
  Eigen::VectorXd time(600);
  time[0] = 3.0;
  for (Eigen::Index i = 1; i < 600; ++i) time[i] = time[i - 1] + 0.004 + 0.014 * random.uniform();
  const SevereLaneChange manoeuvre{1.87, 3.5, 2.25, 0.3};
  Dataset data =
      with_noise(record(
                     {}, time, {"r", "vy"}, [&](double t) { return steering(manoeuvre, t); },
                     [](double t) { return 18.0 - 0.5 * (t - 3.0); }),
                 {0.005, 0.02}, 8);
  data.dt = 0.011;
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  for (const char* name : {"Cf", "Cr"}) {
    EXPECT_NEAR(parameter(fit, name).value, 88107.7, 4.0 * parameter(fit, name).se) << name;
  }
}

// Accelerometer and sideslip sensor away from the centre of gravity, steering gain and offset, two
// speeds.
TEST(VehicleFit, SensorsAndSteering) {
  TrueCar car;
  car.steering_gain = 1.08;
  car.steering_offset = 0.06;
  SevereLaneChange late;
  late.start = 12.0;
  Dataset data = record(
      car, uniform_time(24.0, 50.0), {"r", "vy", "ay", "beta"},
      [&](double t) { return steering(SevereLaneChange{}, t) + steering(late, t); },
      [](double t) { return 12.0 + 0.7 * t; });
  // To where the sensors are: rigid body, r' by central differences of the true yaw rate.
  const SensorPosition ay_at{-0.6, 0.3}, beta_at{2.109, -0.027};
  const Eigen::RowVectorXd r = data.y.row(0), vy = data.y.row(1);
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    const Eigen::Index before = std::max<Eigen::Index>(t - 1, 0);
    const Eigen::Index after = std::min<Eigen::Index>(t + 1, data.size() - 1);
    const double yaw_acceleration = (r[after] - r[before]) / (data.time[after] - data.time[before]);
    data.y(2, t) += yaw_acceleration * ay_at.x - r[t] * r[t] * ay_at.y;
    data.y(3, t) = std::atan2(vy[t] + r[t] * beta_at.x, data.u(1, t) - r[t] * beta_at.y);
  }
  data.y.row(0).array() += 0.004;  // bias
  data = with_noise(data, {0.003, 0.02, 0.1, 0.002}, 9);
  Model model = sladka2010_model({"r", "vy", "ay", "beta"});
  as_vehicle(model).sensors["ay"] = ay_at;
  as_vehicle(model).sensors["beta"] = beta_at;
  model.parameters.push_back(unknown("steering_gain", "", 1.0));
  model.parameters.push_back(unknown("steering_offset", "deg", 0.0));
  model.parameters.push_back(unknown("bias_r", "rad/s", 0.0));
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Cf", 88107.7},
                                    {"Cr", 88107.7},
                                    {"Iz", 2319.0},
                                    {"steering_gain", 1.08},
                                    {"steering_offset", 0.06 * 180.0 / std::numbers::pi},
                                    {"bias_r", 0.004}}) {
    EXPECT_NEAR(parameter(fit, name).value, truth, 4.0 * parameter(fit, name).se) << name;
  }
  expect_no_pretence(fit);
}

TEST(VehicleFit, MassIsNeverFoundFromSteering) {
  const Dataset data = with_noise(lane_change({}, 100.0, {"r", "vy", "ay"}), {0.01, 0.03, 0.1}, 10);
  Model model = sladka2010_model({"r", "vy", "ay"});
  for (Parameter& p : model.parameters) {
    if (p.name == "m") p = unknown("m", "kg", 1300.0, 500.0, 4000.0);
  }
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(fit.status, Status::rejected);
  EXPECT_THAT(fit.message, HasSubstr("does not determine m, Iz, Cf, Cr separately"));
  EXPECT_EQ(fit.identifiability.rank, 3);
  ASSERT_EQ(fit.identifiability.unidentifiable_directions.size(), 1u);
  EXPECT_EQ(fit.identifiability.unidentifiable_directions[0].names.size(), 4u);
  for (const char* name : {"m", "Iz", "Cf", "Cr"}) {
    EXPECT_EQ(parameter(fit, name).verdict, Verdict::not_identifiable) << name;
    EXPECT_TRUE(std::isnan(parameter(fit, name).se)) << name;
    EXPECT_TRUE(std::isnan(parameter(fit, name).crb_se)) << name;
  }
  // Ratios to the mass, and what only depends on them, are determined all the same.
  ASSERT_NE(derived(fit, "Cf/m"), nullptr);
  EXPECT_NEAR(derived(fit, "Cf/m")->value, 88107.7 / 1446.0, 4.0 * derived(fit, "Cf/m")->se);
  EXPECT_NEAR(derived(fit, "Iz/m")->value, 2319.0 / 1446.0, 4.0 * derived(fit, "Iz/m")->se);
  EXPECT_NEAR(derived(fit, "K")->value, 0.003515, 4.0 * derived(fit, "K")->se);
  expect_no_pretence(fit);
}

TEST(VehicleFit, SaysWhenSomethingIsNotExcited) {
  const Dataset data = with_noise(lane_change({}, 50.0), {0.01, 0.03}, 11);
  Model model = sladka2010_model();
  model.parameters.push_back(unknown("bias_ay", "m/s^2", 0.0));  // no ay is measured
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(parameter(fit, "bias_ay").verdict, Verdict::unexcited);
  // What nobody can tell does not refuse what the recording tells.
  EXPECT_EQ(fit.status, Status::ok);
  ASSERT_NE(finding(fit, FindingCode::not_identifiable), nullptr);
  EXPECT_THAT(finding(fit, FindingCode::not_identifiable)->text, HasSubstr("bias_ay"));
  EXPECT_EQ(parameter(fit, "Cf").verdict, Verdict::ok);
  expect_no_pretence(fit);
}

TEST(VehicleFit, BoundsAreReportedNotDressedUp) {
  const Dataset data = with_noise(lane_change({}, 50.0), {0.01, 0.03}, 12);
  Model model = sladka2010_model();
  for (Parameter& p : model.parameters) {
    if (p.name == "Cr") p.max = 8.2e4;
  }
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(parameter(fit, "Cr").verdict, Verdict::at_bound);
  EXPECT_DOUBLE_EQ(parameter(fit, "Cr").value, 8.2e4);
  EXPECT_TRUE(std::isnan(parameter(fit, "Cr").se));
  EXPECT_FALSE(std::isnan(parameter(fit, "Cf").se));
  EXPECT_EQ(derived(fit, "K"), nullptr);  // depends on Cr
  EXPECT_NE(derived(fit, "DF"), nullptr);
  expect_no_pretence(fit);
}

TEST(VehicleFit, GivenNoiseIsUsedAndChecked) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 13);
  Model model = sladka2010_model();
  as_vehicle(model).measurement_sd = {0.01, kNaN};
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(derived(fit, "sd(r)")->value, 0.01);
  EXPECT_NEAR(derived(fit, "sd(vy)")->value, 0.03, 0.004);
  EXPECT_EQ(finding(fit, FindingCode::noise_differs), nullptr);
  as_vehicle(model).measurement_sd = {0.001, 0.03};
  ASSERT_NE(finding(fit_vehicle(model, data), FindingCode::noise_differs), nullptr);
}

// Process disturbance that the model does not know: errors that assume white residuals are far too
// small.
TEST(VehicleFit, ColouredResidualsWidenTheErrors) {
  Dataset data = with_noise(lane_change({}, 100.0), {0.002, 0.005}, 14);
  Random random(14);
  Eigen::Vector2d drift = Eigen::Vector2d::Zero();
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    drift = 0.9 * drift + random.normal(2);
    data.y.col(t) += drift.cwiseProduct(Eigen::Vector2d(0.004, 0.012));
  }
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  ASSERT_NE(finding(fit, FindingCode::coloured_residuals), nullptr);
  EXPECT_THAT(fit.covariance_kind, HasSubstr("sandwich"));
  EXPECT_GT(parameter(fit, "Cf").se, 1.5 * parameter(fit, "Cf").crb_se);
  EXPECT_FALSE(fit.tests[0].pass);
  for (const char* name : {"Cf", "Cr"}) {
    EXPECT_NEAR(parameter(fit, name).value, 88107.7, 4.0 * parameter(fit, name).se) << name;
  }
}

TEST(VehicleFit, FlippedSignsAreSeen) {
  Dataset data = with_noise(lane_change({}, 100.0, {"r", "vy", "ay"}), {0.01, 0.03, 0.1}, 15);
  const Model model = sladka2010_model({"r", "vy", "ay"});
  EXPECT_EQ(finding(fit_vehicle(model, data), FindingCode::sign_ay), nullptr);
  Dataset flipped = data;
  flipped.y.row(2) *= -1.0;
  const VehicleEstimate wrong_ay = fit_vehicle(model, flipped);
  ASSERT_NE(finding(wrong_ay, FindingCode::sign_ay), nullptr);
  EXPECT_EQ(finding(wrong_ay, FindingCode::sign_steering), nullptr);
  EXPECT_EQ(wrong_ay.status, Status::untrusted);
  flipped = data;
  flipped.u.row(0) *= -1.0;
  const VehicleEstimate wrong_steering = fit_vehicle(model, flipped);
  ASSERT_NE(finding(wrong_steering, FindingCode::sign_steering), nullptr);
  EXPECT_EQ(finding(wrong_steering, FindingCode::sign_steering)->severity, Severity::serious);
  // The cause goes first; what it causes is no separate finding.
  EXPECT_EQ(wrong_steering.findings[0].code, FindingCode::sign_steering);
  EXPECT_EQ(finding(wrong_steering, FindingCode::poor_fit), nullptr);
  ASSERT_NE(finding(wrong_steering, FindingCode::consequences), nullptr);
  EXPECT_THAT(finding(wrong_steering, FindingCode::consequences)->text,
              HasSubstr("poor_fit (r, ay)"));
  EXPECT_EQ(wrong_steering.status, Status::untrusted);
  EXPECT_EQ(wrong_steering.message, "do not use these values: sign_steering");
  expect_no_pretence(wrong_steering);
}

// Without an accelerometer no kinematics show the sign of vy or beta, but the fit does.
TEST(VehicleFit, WrongSignOfSideslipIsNamed) {
  for (const std::string& name : {std::string("vy"), std::string("beta")}) {
    const Model model = sladka2010_model({"r", name});
    const double sd = name == "vy" ? 0.03 : 0.002;
    const Dataset data = with_noise(lane_change({}, 100.0, {"r", name}), {0.01, sd}, 15);
    EXPECT_EQ(finding(fit_vehicle(model, data), FindingCode::wrong_sign), nullptr);
    Dataset flipped = data;
    flipped.y.row(1) *= -1.0;
    const VehicleEstimate fit = fit_vehicle(model, flipped);
    const Finding* said = finding(fit, FindingCode::wrong_sign);
    ASSERT_NE(said, nullptr) << name;
    EXPECT_EQ(said->severity, Severity::serious);
    EXPECT_THAT(said->about, ::testing::ElementsAre(name));
    EXPECT_THAT(said->remedy, HasSubstr("scale: -1"));
    EXPECT_EQ(fit.status, Status::untrusted);
  }
}

// A sign that is wrong in the held-out file only is said, with the file; the values stand.
TEST(VehicleFit, SignsOfHeldOutDataAreSeen) {
  const auto drive = [](std::uint64_t seed) {
    return with_noise(
        record(
            {}, uniform_time(20.0, 100.0), {"r", "vy", "ay"},
            [](double t) { return 0.5 * std::sin(1.1 * t) + 0.3 * std::sin(2.7 * t); },
            [](double t) { return 17.0 + 5.0 * std::sin(0.3 * t); }),
        {0.01, 0.03, 0.1}, seed);
  };
  const Model model = sladka2010_model({"r", "vy", "ay"});
  VehicleFitOptions options;
  options.hold_out = {drive(2)};
  const VehicleEstimate clean = fit_vehicle(model, drive(1), options);
  EXPECT_EQ(finding(clean, FindingCode::sign_ay), nullptr);
  EXPECT_EQ(clean.status, Status::ok) << clean.message;
  options.hold_out[0].name = "monday.csv";
  options.hold_out[0].y.row(2) *= -1.0;
  const VehicleEstimate fit = fit_vehicle(model, drive(1), options);
  ASSERT_NE(finding(fit, FindingCode::sign_ay), nullptr);
  EXPECT_EQ(finding(fit, FindingCode::sign_ay)->severity, Severity::warning);
  EXPECT_THAT(finding(fit, FindingCode::sign_ay)->text, HasSubstr("held-out monday.csv: "));
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
}

TEST(VehicleFit, ImplausibleValuesAreSaid) {
  TrueCar odd;
  odd.Iz = 4500.0;
  odd.Cf = odd.Cr = 300000.0;
  const Dataset data = with_noise(lane_change(odd, 100.0), {0.001, 0.003}, 16);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  ASSERT_NE(finding(fit, FindingCode::implausible_Iz), nullptr);
  ASSERT_NE(finding(fit, FindingCode::implausible_Cf), nullptr);
  EXPECT_EQ(finding(fit, FindingCode::implausible_Iz)->severity, Severity::note);
  EXPECT_THAT(finding(fit, FindingCode::implausible_Cf)->text,
              HasSubstr("times its axle load per rad; published cars have up to 31"));
  EXPECT_EQ(fit.status, Status::ok);  // printed, not enforced
  // A race car's inertia and soft tyres are those of published cars.
  odd.Iz = 1150.0;
  odd.Cf = 250000.0;
  odd.Cr = 60000.0;
  const VehicleEstimate racing =
      fit_vehicle(sladka2010_model(), with_noise(lane_change(odd, 100.0), {0.001, 0.003}, 16));
  for (const FindingCode code :
       {FindingCode::implausible_Iz, FindingCode::implausible_Cf, FindingCode::implausible_Cr}) {
    EXPECT_EQ(finding(racing, code), nullptr);
  }
}

// The initial state is read off a sensor that is turned: without noise nothing is left to correct.
TEST(VehicleFit, InitialSideslipOfATurnedSensor) {
  for (const std::string& name : {std::string("vy"), std::string("beta")}) {
    Model model = sladka2010_model({"r", name});
    as_vehicle(model).sensors[name] = {0.4, -0.2, 0.05};
    model.parameters.push_back(known("mounting_angle", "rad", 0.03));
    const Dataset drive = record(
        {}, uniform_time(5.0, 100.0), {"r", "vy"}, [](double t) { return 0.5 * std::sin(2.0 * t); },
        [](double) { return 20.0; });
    Dataset data = samples_from(drive, 100);
    const Eigen::VectorXd vy = data.y.row(1);
    for (Eigen::Index t = 0; t < data.size(); ++t) {
      const double vx_there = 20.0 + 0.2 * data.y(0, t), vy_there = vy[t] + 0.4 * data.y(0, t);
      data.y(1, t) = name == "vy" ? vy_there * std::cos(0.08) - vx_there * std::sin(0.08)
                                  : std::atan2(vy_there, vx_there) - 0.08;
    }
    const VehicleUnknowns unknowns = vehicle_unknowns(model);
    const VehicleRun run = usable_run(model, {data});
    const VehicleProblem problem =
        make_vehicle_problem(run, unknowns, demand_of(unknowns, unknowns.value));
    const Eigen::VectorXd z = coordinates_of(problem, unknowns.value);
    EXPECT_NEAR(z[problem.state_of(0)] * kStateScale[0], vy[0], 1e-9) << name;
    EXPECT_NEAR(z[problem.state_of(0) + 1] * kStateScale[1], data.y(0, 0), 1e-12) << name;
  }
}

TEST(VehicleFit, SaturatingTyresAreSeen) {
  TrueCar car;
  car.inverse_saturation_f = 1.0 / std::pow(6500.0, 2);
  car.inverse_saturation_r = 1.0 / std::pow(4500.0, 2);
  const Dataset data = with_noise(lane_change(car, 100.0), {0.01, 0.03}, 17);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data, of_noise_alone());
  const Finding* saturation = finding(fit, FindingCode::tyre_saturation);
  ASSERT_NE(saturation, nullptr);
  EXPECT_EQ(saturation->severity, Severity::serious) << saturation->text;
  EXPECT_EQ(fit.status, Status::untrusted);
  EXPECT_LT(parameter(fit, "Cr").value, 0.9 * 88107.7);

  const Model model = sladka2010_model();
  const VehicleRun run = usable_run(model, {data});
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleProblem problem = make_vehicle_problem(run, unknowns, {300.0});
  const VehicleOptimum optimum =
      maximise_likelihood(problem, coordinates_of(problem, unknowns.value), {});
  const TyreSaturation found =
      test_tyre_saturation(problem, optimum, vehicle_covariance(problem, optimum));
  ASSERT_TRUE(found.refitted);
  EXPECT_NEAR(found.saturating[kCf], 88107.7, 0.03 * 88107.7);
  EXPECT_NEAR(found.saturating[kCr], 88107.7, 0.03 * 88107.7);
  EXPECT_NEAR(1.0 / std::sqrt(found.saturating[kInverseSaturationRear]), 4500.0, 0.05 * 4500.0);
  EXPECT_TRUE(found.rear.significant);

  // Where no tyre bends, something else is wrong.
  TyreSaturation early = found;
  early.rear.slip = 0.004;
  const Findings of_early = check_tyres(problem, early, {});
  ASSERT_EQ(of_early.size(), 1u);
  EXPECT_NE(of_early[0].remedy.find("wrong unit"), std::string::npos);
  EXPECT_NE(saturation->remedy.find("milder part"), std::string::npos);
}

// The score of outliers is bounded: straight tyres are not taken for bent ones.
TEST(VehicleFit, OutliersBendNoTyre) {
  int ignored = 0, robust = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, seed);
    Random random(seed);
    for (Eigen::Index t = 0; t < data.size(); ++t) {
      // Where the car turns hard, the sensor sometimes reads too little.
      if (std::abs(data.y(0, t)) > 0.15 && random.uniform() < 0.1) data.y(0, t) *= 0.3;
    }
    const Model model = sladka2010_model();
    const VehicleRun run = usable_run(model, {data});
    const VehicleUnknowns unknowns = vehicle_unknowns(model);
    VehicleProblem problem = make_vehicle_problem(run, unknowns, {300.0});
    problem.robust = true;
    const VehicleOptimum optimum =
        maximise_likelihood(problem, coordinates_of(problem, unknowns.value), {});
    const VehicleCovariance covariance = vehicle_covariance(problem, optimum);
    robust += test_tyre_saturation(problem, optimum, covariance).score_p < 0.01 ? 1 : 0;
    // The same car with the scores of normal noise.
    problem.robust = false;
    ignored += test_tyre_saturation(problem, optimum, covariance).score_p < 0.01 ? 1 : 0;
  }
  std::printf("tyres bent by outliers: %d of 20 with scores of normal noise, %d with robust ones\n",
              ignored, robust);
  EXPECT_LE(robust, 1);   // 2 or more of 20 at 1 % happen in 1.7 % of such tests
  EXPECT_GE(ignored, 5);  // else the outliers would not matter: 5 at 1 % are one in a million
}

TEST(VehicleFit, NothingFreeIsASimulation) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 18);
  Model model = sladka2010_model();
  for (Parameter& p : model.parameters) {
    p.fixed = true;
    if (p.name == "Cf" || p.name == "Cr") p.value(0, 0) = 88107.7;
  }
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_GT(fit.simulation[0].fit_percent, 90.0);
  EXPECT_NEAR(derived(fit, "K")->value, 0.003515, 1e-6);
  EXPECT_TRUE(std::isnan(derived(fit, "K")->se));
  expect_no_pretence(fit);
}

TEST(VehicleFit, RoadWheelAngleNeedsNoRatio) {
  Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 19);
  data.u.row(0) /= 21.0;
  Model model = sladka2010_model();
  as_vehicle(model).steering_at_road_wheel = true;
  std::erase_if(model.parameters, [](const Parameter& p) { return p.name == "steering_ratio"; });
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_NEAR(parameter(fit, "Cf").value, 88107.7, 4.0 * parameter(fit, "Cf").se);
  model.parameters.push_back(unknown("steering_ratio", "", 21.0));
  EXPECT_THAT(refusal(model, data), HasSubstr("fit steering_gain instead"));
}

// ------------------------------------------------------------------------ what cannot be used, in
// words

TEST(VehicleFitRefuses, NoSteering) {
  Dataset data = lane_change({}, 100.0);
  data.u.row(0).setZero();
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("no steering"));
  data.u.row(0).setConstant(
      1.0);  // a circle from the first row to the last is allowed, but not praised
  const VehicleEstimate circle = fit_vehicle(
      sladka2010_model(), with_noise(record(
                                         {}, uniform_time(10.0, 50.0), {"r", "vy"},
                                         [](double) { return 1.0; }, [](double) { return 15.0; }),
                                     {0.01, 0.03}, 1));
  EXPECT_NE(finding(circle, FindingCode::constant_steering), nullptr);
  expect_no_pretence(circle);
}

TEST(VehicleFitRefuses, Standstill) {
  Dataset data = lane_change({}, 100.0);
  data.u.row(1).setConstant(0.2);
  const std::string text = refusal(sladka2010_model(), data);
  EXPECT_THAT(text, HasSubstr("700 below 3 m/s"));
  EXPECT_THAT(text, HasSubstr("is the unit of vx right?"));
}

TEST(VehicleFitRefuses, ReversingAllTheTime) {
  Dataset data = lane_change({}, 100.0);
  data.u.row(1).setConstant(-2.0);
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("vx is negative: does the car reverse"));
  try {
    fit_vehicle(sladka2010_model(), std::vector<Dataset>{lane_change({}, 100.0), data});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("recording 2 of 2: no usable segment"));
  }
}

TEST(VehicleFitRefuses, TooFewRows) {
  Dataset data = lane_change({}, 100.0);
  for (const Eigen::Index rows : {1, 2, 7, 50}) {
    Dataset part = data;
    part.time = data.time.head(rows);
    part.u = data.u.leftCols(rows);
    part.y = data.y.leftCols(rows);
    EXPECT_THAT(refusal(sladka2010_model(), part), HasSubstr("no usable segment")) << rows;
  }
  Dataset sparse = data;
  sparse.y.setConstant(kNaN);
  sparse.y.leftCols(2).setRandom();
  EXPECT_THAT(refusal(sladka2010_model(), sparse), HasSubstr("more samples than unknowns"));
}

TEST(VehicleFitRefuses, MissingInputs) {
  Dataset data = lane_change({}, 100.0);
  data.u.row(1).setConstant(kNaN);
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("700 without vx"));
  data = lane_change({}, 100.0);
  for (Eigen::Index t = 0; t < 700; ++t) {
    if (t % 15 != 0) data.u(0, t) = kNaN;
  }
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("without steering angle"));
  data.u.conservativeResize(1, Eigen::NoChange);
  EXPECT_THROW(fit_vehicle(sladka2010_model(), data), std::invalid_argument);
}

TEST(VehicleFitRefuses, DeadOutputs) {
  Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 1);
  Dataset dead = data;
  dead.y.setConstant(kNaN);
  EXPECT_THAT(refusal(sladka2010_model(), dead), HasSubstr("output 'r' has no sample"));
  dead = data;
  dead.y.row(0).setConstant(0.1);
  dead.y.row(1).setZero();
  EXPECT_THAT(refusal(sladka2010_model(), dead), HasSubstr("output 'r' is constant at 0.1 rad/s"));
  dead = data;
  dead.y.row(1).setZero();  // one of two: the other is used
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), dead);
  ASSERT_NE(finding(fit, FindingCode::dead_output), nullptr);
  EXPECT_EQ(fit.simulation.size(), 1u);
  EXPECT_EQ(fit.status, Status::untrusted);
  EXPECT_THAT(finding(fit, FindingCode::dead_output)->about, ::testing::ElementsAre("vy"));
  expect_no_pretence(fit);
}

TEST(VehicleFitRefuses, ImpossibleNumbers) {
  Dataset data = lane_change({}, 100.0);
  data.u(1, 300) = 1e300;
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("vx is "));
  data.u(1, 300) = -std::numeric_limits<double>::infinity();
  EXPECT_THROW(fit_vehicle(sladka2010_model(), data), std::invalid_argument);
  data = lane_change({}, 100.0);
  data.y(1, 300) = 1e300;
  EXPECT_THAT(refusal(sladka2010_model(), data), HasSubstr("in SI units at 3 s"));
  data.y(1, 300) = -std::numeric_limits<double>::infinity();
  EXPECT_THROW(fit_vehicle(sladka2010_model(), data), std::invalid_argument);
}

// A log-normal prior keeps a parameter above 0, wherever the file lets it go.
TEST(VehicleFit, PriorOfALogarithm) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 1);
  Model model = sladka2010_model();
  model.parameters.push_back(unknown("steering_gain", "", 1.0));
  model.parameters.back().prior = {Prior::Kind::log_normal, 1.0, 1.02};
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_NEAR(parameter(fit, "steering_gain").value, 1.0, 0.06);
  model.parameters.back().value(0, 0) = 0.0;
  EXPECT_THAT(refusal(model, data), HasSubstr("parameter 'steering_gain' starts at 0"));
}

// What was never fitted is not called ok.
TEST(VehicleFit, NothingFittedIsSaid) {
  Dataset data = lane_change({}, 100.0);
  data.u.row(0) *= 1e5;
  Model model = sladka2010_model();
  as_vehicle(model).curve = TyreCurve::linear;
  for (Parameter& p : model.parameters) {
    if (p.name == "steering_ratio") p.value(0, 0) = 1e-300;
  }
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(fit.status, Status::not_converged) << fit.message;
  for (const EstimatedParameter& p : fit.parameters) {
    if (!p.fixed) {
      EXPECT_EQ(p.verdict, Verdict::unfitted) << p.name;
    }
  }
}

TEST(VehicleFitRefuses, ModelsThatDoNotFit) {
  const Dataset data = with_noise(lane_change({}, 100.0), {0.01, 0.03}, 1);
  Model model = sladka2010_model();
  model.parameters.push_back(known("Cq", "N/rad", 1.0));
  EXPECT_THAT(refusal(model, data), HasSubstr("parameter 'Cq'"));
  model = sladka2010_model();
  std::erase_if(model.parameters, [](const Parameter& p) { return p.name == "Iz"; });
  EXPECT_THAT(refusal(model, data), HasSubstr("parameter 'Iz' is missing"));
  model = sladka2010_model();
  model.parameters[0].value(0, 0) = -3.0;
  EXPECT_THAT(refusal(model, data), HasSubstr("parameter 'm' is -3"));
  model = sladka2010_model();
  model.outputs[1].name = "roll";
  EXPECT_THAT(refusal(model, data), HasSubstr("output 'roll'"));
}

TEST(VehicleFit, NoiselessDataAreNoTrouble) {
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), lane_change({}, 100.0));
  EXPECT_NEAR(parameter(fit, "Cf").value, 88107.7, 1e-3 * 88107.7);
  EXPECT_NEAR(parameter(fit, "Iz").value, 2319.0, 1e-3 * 2319.0);
  expect_no_pretence(fit);
}

TEST(VehicleFit, PureNoiseIsNotTrusted) {
  Dataset data = lane_change({}, 100.0);
  data.y.setZero();
  data = with_noise(data, {0.01, 0.03}, 3);
  const VehicleEstimate fit = fit_vehicle(sladka2010_model(), data);
  EXPECT_NE(fit.status, Status::ok);
  expect_no_pretence(fit);
}

// ------------------------------------------------------------------------------------- reference
// recordings

/// Channels of a recording by column: name in the model, column, unit to SI factor.
struct Columns {
  std::string name, column, unit;
  double factor;
};

Dataset read_recording(const std::string& path, const std::string& time, const Columns& steering,
                       const Columns& speed, const std::vector<Columns>& outputs) {
  const Table table = read_csv(path);
  const auto column = [&](const std::string& name, double factor) {
    const Column* found = table.find(name);
    if (found == nullptr) throw std::out_of_range(name);
    return Eigen::VectorXd(
        factor * Eigen::Map<const Eigen::VectorXd>(
                     found->values.data(), static_cast<Eigen::Index>(found->values.size())));
  };
  Dataset data;
  data.name = path;
  data.time = column(time, 1.0);
  data.dt = data.time[1] - data.time[0];
  data.inputs = {{steering.name, steering.unit}, {speed.name, speed.unit}};
  data.u.resize(2, data.time.size());
  data.u.row(0) = column(steering.column, steering.factor);
  data.u.row(1) = column(speed.column, speed.factor);
  data.y.resize(static_cast<Eigen::Index>(outputs.size()), data.time.size());
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    data.outputs.push_back({outputs[j].name, outputs[j].unit});
    data.y.row(static_cast<Eigen::Index>(j)) = column(outputs[j].column, outputs[j].factor);
  }
  return data;
}

// A chirp at 100 km/h through somebody else's simulator, whose characteristic values are printed
// with it.
TEST(VehicleFitRecordings, Chirp) {
  const char* file = "recordings/cobb_sim_marc2.txt";
  IDENTIKAL_NEEDS_SHARED_FILE(file);
  constexpr double kDegree = std::numbers::pi / 180.0;
  const Dataset data =
      read_recording(shared_file(file), "TIME", {"steering_wheel_angle", "STEER", "deg", kDegree},
                     {"vx", "SPEED", "km/h", 1.0 / 3.6}, {{"r", "YAWVEL", "deg/s", kDegree}});
  Model model = sladka2010_model({"r"});
  constexpr double kWheelbase = 2.745;
  model.parameters = {known("m", "kg", 1600.0),
                      known("a", "m", 600.0 / 1600.0 * kWheelbase),
                      known("b", "m", 1000.0 / 1600.0 * kWheelbase),
                      known("steering_ratio", "", 20.0),
                      unknown("Iz", "kg m^2", 2000.0),
                      unknown("Cf", "N/rad", 5e4),
                      unknown("Cr", "N/rad", 5e4)};
  const VehicleEstimate fit = fit_vehicle(model, data);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  const double K = derived(fit, "K per g")->value, DF = derived(fit, "DF")->value,
               DR = derived(fit, "DR")->value, wn = derived(fit, "wn at 100 km/h")->value,
               zeta = derived(fit, "zeta at 100 km/h")->value;
  std::printf(
      "chirp: K %.4f (2.00), DF %.3f (4.99), DR %.3f (2.99) deg/g, wn %.3f (7.37), zeta %.4f "
      "(.73)\n",
      K, DF, DR, wn, zeta);
  EXPECT_NEAR(K, 2.00, 0.03);
  EXPECT_NEAR(DF, 4.99, 0.02 * 4.99);
  EXPECT_NEAR(DR, 2.99, 0.02 * 2.99);
  EXPECT_NEAR(wn, 7.37, 0.02 * 7.37);
  EXPECT_NEAR(zeta, 0.73, 0.01);
  EXPECT_GT(fit.simulation[0].fit_percent, 99.5);
}

// A race car on its track: a linear tyre does not do, and the tool has to say so.
TEST(VehicleFitRecordings, RaceCar) {
  const char* file = "recordings/revs_250lm_first_half.csv";
  IDENTIKAL_NEEDS_SHARED_FILE(file);
  const Dataset data = read_recording(
      shared_file(file), "t", {"road_wheel_angle", "delta", "rad", 1.0}, {"vx", "vx", "m/s", 1.0},
      {{"r", "yawRate", "rad/s", 1.0}, {"vy", "vy", "m/s", 1.0}});
  Model model = sladka2010_model();
  as_vehicle(model).steering_at_road_wheel = true;
  model.parameters = {known("m", "kg", 982.0),     known("a", "m", 1.33),
                      known("b", "m", 1.07),       unknown("Iz", "kg m^2", 1400.0),
                      unknown("Cf", "N/rad", 8e4), unknown("Cr", "N/rad", 8e4)};
  const VehicleEstimate fit = fit_vehicle(model, data, of_noise_alone());
  std::printf(
      "race car, linear: Cf %.0f +- %.0f (white %.0f), Cr %.0f +- %.0f (white %.0f), r fit %.1f "
      "%%\n",
      parameter(fit, "Cf").value, parameter(fit, "Cf").se, parameter(fit, "Cf").crb_se,
      parameter(fit, "Cr").value, parameter(fit, "Cr").se, parameter(fit, "Cr").crb_se,
      fit.simulation[0].fit_percent);
  EXPECT_NEAR(parameter(fit, "Cf").value, 40e3, 6e3);
  EXPECT_NEAR(parameter(fit, "Cr").value, 75e3, 12e3);
  EXPECT_NEAR(fit.simulation[0].fit_percent, 81.0, 2.0);
  const Finding* saturation = finding(fit, FindingCode::tyre_saturation);
  ASSERT_NE(saturation, nullptr);
  std::printf("%s\n", saturation->text.c_str());
  EXPECT_EQ(saturation->severity, Severity::serious);
  EXPECT_EQ(fit.status, Status::untrusted);
  EXPECT_NE(finding(fit, FindingCode::coloured_residuals), nullptr);
  EXPECT_GT(parameter(fit, "Cf").se, 6.0 * parameter(fit, "Cf").crb_se);
  bool histogram = false;
  for (const std::string& note : fit.notes)
    histogram = histogram || note.find("8 to 12") != note.npos;
  EXPECT_TRUE(histogram);
}

}  // namespace
}  // namespace identikal
