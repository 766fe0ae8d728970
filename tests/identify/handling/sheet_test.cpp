// The sheet of a car that is known: simulated by an integration of its own, with and without noise.
#include "identify/handling/sheet.h"

#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/estimate/distribution.h"
#include "lib/base/random.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

using Value = HandlingSheet::Value;
using Figure = HandlingSheet::Figure;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kDegree = std::numbers::pi / 180.0;
const std::vector<std::string> kOutputs = {"r", "vy", "ay"};
// Of the sensors a test engineer has: .12 deg/s, .025 m/s, .06 m/s^2.
const std::vector<double> kNoise = {0.0021, 0.025, 0.06};

using OfTime = std::function<double(double)>;

Dataset driven(const OfTime& steering, const OfTime& speed, double seconds,
               const testing::TrueCar& car = {}) {
  return testing::record(car, testing::uniform_time(seconds, 100.0), kOutputs, steering, speed);
}

// A circle of 100 m to the left, then one to the right, that is driven faster and faster (ISO 4138).
Dataset circles(const testing::TrueCar& car = {}) {
  const SteadyCircle circle;
  const OfTime vx = [=](double t) { return speed(circle, std::fmod(t, 30.0)); };
  const SingleTrack<> known = linear_car(sladka2010_car());
  const OfTime angle = [=](double t) {
    const double side = std::clamp((30.0 - t) / 1.0, -1.0, 1.0);
    return side * 21.0 * road_wheel_angle(known, circle.radius, vx(t));
  };
  return driven(angle, vx, 60.0, car);
}

Dataset sweep() {
  SweepSteer manoeuvre;
  manoeuvre.amplitude = 0.35;
  manoeuvre.to = 3.5;
  manoeuvre.start = 4.0;  // what begins with the record could be a state that it begins with
  return driven([=](double t) { return steering(manoeuvre, t); }, [](double) { return 25.0; },
                46.0);
}

// Steps to the left and right, each from straight on.
Dataset steps(int count) {
  StepSteer left;
  left.amplitude = 0.5;
  const OfTime angle = [=](double t) {
    const auto number = static_cast<int>(t / 10.0);
    const double since = std::fmod(t, 10.0), side = number % 2 == 0 ? 1.0 : -1.0;
    StepSteer back = left;
    back.start = 6.0;
    back.rise = 1.5;  // no step
    return side * (steering(left, since) - steering(back, since));
  };
  return driven(
      angle, [](double) { return 25.0; }, 10.0 * count);
}

Model model_of_outputs() { return sladka2010_model(kOutputs); }

KnownVehicle true_car() {
  KnownVehicle car;
  car.p = sladka2010_car();
  return car;
}

HandlingSheet sheet_of(const std::vector<Dataset>& logs, const KnownVehicle& car = true_car()) {
  return handling_sheet(car, model_of_outputs(), logs);
}

const Figure& figure(const HandlingSheet& sheet, const std::string& name) {
  for (const HandlingSheet::Section& section : sheet.sections) {
    for (const Figure& each : section.figures) {
      if (each.name == name) return each;
    }
  }
  throw std::out_of_range("no figure " + name);
}

void expect_alike(const Figure& figure, double relative) {
  EXPECT_NEAR(figure.log.value, figure.model.value, relative * std::abs(figure.model.value))
      << figure.name << ": " << figure.log.why << figure.model.why;
}

TEST(HandlingSheet, SteadyFiguresOfALogWithoutNoiseAreTheModels) {
  const HandlingSheet sheet = sheet_of({circles()});
  // The ramp is slow, not steady: the yaw rate is late by some hundredths of a second.
  for (const char* name : {"understeer gradient K", "front axle compliance", "rear axle compliance",
                           "characteristic speed"}) {
    expect_alike(figure(sheet, name), 0.01);
  }
  const double K = understeer_gradient(linear_car(sladka2010_car())) * 9.80665 / kDegree;
  EXPECT_NEAR(figure(sheet, "understeer gradient K").model.value, K, 1e-12);
  ASSERT_GE(sheet.curve.size(), 7u);
  for (const auto& point : sheet.curve) {
    if (std::abs(point.ay) < 0.5) continue;
    EXPECT_NEAR(point.angle_log.value, point.angle_model.value,
                0.01 * std::abs(point.angle_model.value));
    EXPECT_NEAR(point.yaw_gain_log.value, point.yaw_gain_model.value,
                0.01 * point.yaw_gain_model.value);
    EXPECT_NEAR(point.sideslip_log.value, point.sideslip_model.value, 0.02);
  }
}

TEST(HandlingSheet, ResponseOfALogWithoutNoiseIsTheModels) {
  const HandlingSheet sheet = sheet_of({sweep()});
  EXPECT_NEAR(sheet.speed, 25.0, 1e-9);
  for (const HandlingSheet::Response& response : sheet.responses) {
    for (const auto& point : response.points) {
      EXPECT_GT(point.coherence, 0.99) << response.output << " " << point.frequency;
      EXPECT_NEAR(point.gain_log.value, point.gain_model.value, 0.01 * point.gain_model.value)
          << response.output << " " << point.frequency;
      EXPECT_NEAR(point.phase_log.value, point.phase_model.value, 1.0)
          << response.output << " " << point.frequency;
    }
  }
  expect_alike(figure(sheet, "bandwidth of r"), 0.02);
  expect_alike(figure(sheet, "peak ratio of r"), 0.01);
}

TEST(HandlingSheet, FiguresOfStepsWithoutNoiseAreTheModels) {
  const HandlingSheet sheet = sheet_of({steps(4)});
  for (const char* name :
       {"step: ay reached", "step: response time of r", "step: response time of ay",
        "step: peak response time of r", "step: overshoot of r", "step: TB"}) {
    expect_alike(figure(sheet, name), 0.005);
  }
  EXPECT_THAT(sheet.sections[1].remarks[0], HasSubstr("4 steps at 90 km/h"));
  // The standard step is the same car's: the linear one's times do not depend on its size.
  HandlingOptions at_this_speed;
  at_this_speed.speed = 25.0;
  const HandlingSheet without = handling_sheet(true_car(), model_of_outputs(), {}, at_this_speed);
  EXPECT_NEAR(figure(sheet, "step: response time of r").log.value,
              figure(without, "step: response time of r").model.value, 0.003);
  EXPECT_THAT(figure(without, "step: TB").log.why, HasSubstr("No recording"));
}

TEST(HandlingSheet, PeaksOfALaneChangeWithoutNoiseAreTheModels) {
  const HandlingSheet sheet = sheet_of({testing::lane_change({}, 100.0, kOutputs)});
  for (const char* name : {"peak of ay", "peak of r", "peak of beta"}) {
    expect_alike(figure(sheet, name), 0.003);
  }
  const SevereLaneChange manoeuvre;
  EXPECT_NEAR(figure(sheet, "peak of the steering angle").log.value, manoeuvre.amplitude / kDegree,
              0.1);
  EXPECT_NEAR(figure(sheet, "entry speed").log.value, 60.0, 1e-9);
  EXPECT_THAT(figure(sheet, "entry speed").model.why, HasSubstr("input of the model"));
}

// 9 and 8 kN: at 4 m/s^2 the front axle gives 3.5 kN, and K is larger than about straight driving.
TEST(HandlingSheet, BendingTyresHaveALimitAndFrictions) {
  testing::TrueCar bending;
  bending.inverse_saturation_f = 1.0 / (9000.0 * 9000.0);
  bending.inverse_saturation_r = 1.0 / (8000.0 * 8000.0);
  KnownVehicle car = true_car();
  car.curve = TyreCurve::tanh;
  car.p[kInverseSaturationFront] = bending.inverse_saturation_f;
  car.p[kInverseSaturationRear] = bending.inverse_saturation_r;
  car.estimated = true;
  car.uncertain = {kInverseSaturationFront};
  // 3 % of the force are 6 % of the inverse saturation.
  car.covariance =
      Eigen::MatrixXd::Constant(1, 1, std::pow(0.06 * bending.inverse_saturation_f, 2));
  const HandlingSheet sheet = sheet_of({circles(bending)}, car);
  const double load = car.p[kMass] * 9.80665 * car.p[kB] / (car.p[kA] + car.p[kB]);
  const Value& friction = figure(sheet, "friction of the front axle").model;
  EXPECT_NEAR(friction.value, 9000.0 / load, 1e-9);
  EXPECT_NEAR(friction.se, 0.03 * 9000.0 / load, 1e-3 * friction.se);
  EXPECT_THAT(figure(sheet, "friction of the rear axle").model.why, HasSubstr("does not depend"));
  EXPECT_NEAR(figure(sheet, "largest steady ay").model.value, 9.80665 * 9000.0 / load, 1e-9);
  const Value& over = figure(sheet, "K of the model over these turns").model;
  const Figure& K = figure(sheet, "understeer gradient K");
  EXPECT_NEAR(K.log.value, over.value, 0.015 * over.value);
  EXPECT_GT(over.value, 1.02 * K.model.value);
}

TEST(HandlingSheet, AnotherCarIsSeen) {
  KnownVehicle softer = true_car();
  softer.p[kCf] *= 0.8;
  const HandlingSheet sheet = sheet_of({circles()}, softer);
  const Figure& K = figure(sheet, "understeer gradient K");
  EXPECT_GT(K.model.value, 1.5 * K.log.value);
}

TEST(HandlingSheet, WhatTheLogCannotGiveIsBlankWithAReason) {
  const HandlingSheet straight = sheet_of({sweep()});
  EXPECT_TRUE(std::isnan(figure(straight, "understeer gradient K").log.value));
  EXPECT_THAT(figure(straight, "understeer gradient K").log.why, HasSubstr("quasi-steady"));
  EXPECT_THAT(figure(straight, "step: TB").log.why, HasSubstr("no step of steering"));
  EXPECT_TRUE(straight.sections[2].figures.empty());
  EXPECT_THAT(straight.sections[2].remarks[0], HasSubstr("no lane change"));
  EXPECT_THAT(figure(straight, "largest steady ay").model.why, HasSubstr("no limit"));
  EXPECT_THAT(figure(straight, "damping").model.why, HasSubstr("have no errors"));
  // Every number has an error, or says why it has none.
  for (const HandlingSheet::Section& section : straight.sections) {
    for (const Figure& each : section.figures) {
      for (const Value* value : {&each.log, &each.model}) {
        EXPECT_EQ(std::isfinite(value->value) && std::isfinite(value->se), value->why.empty())
            << each.name << ": " << value->why;
      }
    }
  }
}

// A slow circle says nothing at 1 Hz, whatever leaks there from the ramp.
TEST(HandlingSheet, WhatIsNotExcitedIsNotStated) {
  const SteadyCircle circle;
  const OfTime vx = [=](double t) { return speed(circle, t); };
  const SingleTrack<> known = linear_car(sladka2010_car());
  const OfTime angle = [=](double t) { return 21.0 * road_wheel_angle(known, 100.0, vx(t)); };
  const Dataset log = testing::with_noise(driven(angle, vx, 40.0), kNoise, 1);
  for (const HandlingSheet::Response& response : sheet_of({log}).responses) {
    for (const auto& point : response.points) {
      if (point.frequency < 0.75) continue;
      EXPECT_TRUE(std::isnan(point.gain_log.value)) << response.output << " " << point.frequency;
      EXPECT_FALSE(point.gain_log.why.empty());
    }
  }
}

KnownVehicle uncertain_car() {
  KnownVehicle car = true_car();
  car.estimated = true;
  car.uncertain = {kYawInertia, kCf, kCr, kSteeringDelay};
  car.p[kSteeringDelay] = 0.03;
  const Eigen::Vector4d se(25.0, 900.0, 1000.0, 0.002);
  Eigen::Matrix4d correlation = Eigen::Matrix4d::Identity();
  correlation(1, 2) = correlation(2, 1) = 0.7;
  correlation(0, 3) = correlation(3, 0) = -0.5;
  car.covariance = se.asDiagonal() * correlation * se.asDiagonal();
  return car;
}

using Figures = std::map<std::string, Value>;
Figures model_side(const HandlingSheet& sheet) {
  Figures out;
  for (const HandlingSheet::Section& section : sheet.sections) {
    for (const Figure& each : section.figures) out[each.name] = each.model;
  }
  for (const HandlingSheet::Response& response : sheet.responses) {
    for (const auto& point : response.points) {
      const std::string at = response.output + std::to_string(point.frequency);
      out["gain " + at] = point.gain_model;
      out["phase " + at] = point.phase_model;
    }
  }
  return out;
}

// 1500 draws of the parameters: the standard deviation of the draws has a standard error of 1.8 %;
// within errors of 1 % the figures bend little.
TEST(HandlingSheet, ErrorsAreThoseOfDrawsOfTheParameters) {
  const KnownVehicle car = uncertain_car();
  const Model model = model_of_outputs();
  const Figures expected = model_side(handling_sheet(car, model, {}));
  const Eigen::Matrix4d root = Eigen::LLT<Eigen::Matrix4d>(car.covariance).matrixL();
  Random random(3);
  std::map<std::string, std::vector<double>> drawn;
  for (int draw = 0; draw < 1500; ++draw) {
    KnownVehicle one = true_car();
    Eigen::Vector4d z;
    for (double& each : z) each = random.normal();
    const Eigen::Vector4d moved = root * z;
    for (Eigen::Index i = 0; i < 4; ++i)
      one.p[car.uncertain[i]] = car.p[car.uncertain[i]] + moved[i];
    for (const auto& [name, value] : model_side(handling_sheet(one, model, {}))) {
      drawn[name].push_back(value.value);
    }
  }
  int compared = 0;
  for (const auto& [name, value] : expected) {
    if (!std::isfinite(value.se)) continue;
    const std::vector<double>& each = drawn[name];
    double mean = 0.0, squares = 0.0;
    for (const double x : each) mean += x / static_cast<double>(each.size());
    for (const double x : each) squares += (x - mean) * (x - mean);
    const double sd = std::sqrt(squares / static_cast<double>(each.size() - 1));
    EXPECT_NEAR(value.se, sd, 0.12 * sd) << name;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

/// Noise of the outputs, and of the angle's sensor: 1.1 deg.
Dataset with_noise_of_all(const Dataset& data, std::uint64_t seed) {
  Dataset out = testing::with_noise(data, kNoise, seed);
  Random random(seed + 100000);
  for (Eigen::Index t = 0; t < out.size(); ++t) out.u(0, t) += 0.02 * random.normal();
  return out;
}

/// How often the 95 % interval of the log holds the truth, by figure.
struct Coverage {
  std::map<std::string, int> inside, all;
  void add(const std::string& name, const Value& value, double truth) {
    if (!std::isfinite(value.se)) return;
    ++all[name];
    if (value.ci95[0] <= truth && truth <= value.ci95[1]) ++inside[name];
  }
  void expect_between(double low, double high, int least) const {
    for (const auto& [name, count] : all) {
      EXPECT_GE(count, least) << name;
      const double share = static_cast<double>(inside.count(name) ? inside.at(name) : 0) / count;
      EXPECT_GE(share, low) << name;
      EXPECT_LE(share, high) << name;
    }
  }
};

// 200 logs: of intervals that hold the truth in 95 % of cases fewer than 90 % do so with a
// probability of .002, more than 99 % with one of .002.
TEST(HandlingSheet, IntervalsOfALogCover) {
  constexpr int kLogs = 200;
  const Dataset turning = circles(), swept = sweep(), stepped = steps(2);
  const HandlingSheet of_turning = sheet_of({turning}), of_sweep = sheet_of({swept}),
                      of_steps = sheet_of({stepped});
  Coverage found;
  for (std::uint64_t seed = 1; seed <= kLogs; ++seed) {
    const HandlingSheet steady = sheet_of({with_noise_of_all(turning, seed)});
    for (const char* name : {"understeer gradient K", "rear axle compliance"}) {
      // What the ramp itself does to the figure is no noise.
      found.add(name, figure(steady, name).log, figure(of_turning, name).log.value);
    }
    const HandlingSheet response = sheet_of({testing::with_noise(swept, kNoise, 1000 + seed)});
    for (const std::size_t output : {0u, 1u, 2u}) {
      for (const std::size_t i : {3u, 8u}) {
        const auto& point = response.responses[output].points[i];
        const auto& truth = of_sweep.responses[output].points[i];
        const std::string at = response.responses[output].output + std::to_string(i);
        found.add("gain " + at, point.gain_log, truth.gain_log.value);
        found.add("phase " + at, point.phase_log, truth.phase_log.value);
      }
    }
    const HandlingSheet step = sheet_of({testing::with_noise(stepped, kNoise, 2000 + seed)});
    for (const char* name : {"step: response time of r", "step: response time of ay"}) {
      found.add(name, figure(step, name).log, figure(of_steps, name).log.value);
    }
  }
  found.expect_between(0.90, 0.99, kLogs);
}

}  // namespace
}  // namespace identikal
