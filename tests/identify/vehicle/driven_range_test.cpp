// Where a car was driven is what its simulation did; a drive beyond it accuses no car.
#include "identify/vehicle/driven_range.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/validation/validate.h"
#include "identify/vehicle/fit.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kSpeed = 25.0;  // m/s

// A sine of 0.8 Hz.
Dataset without_noise(const testing::TrueCar& car, double steering_wheel) {
  return testing::record(
      car, testing::uniform_time(20.0, 50.0), {"r", "vy"},
      [=](double t) { return steering_wheel * std::sin(2.0 * std::numbers::pi * 0.8 * t); },
      [](double) { return kSpeed; });
}

// As usual sensors record it.
Dataset recorded_drive(const testing::TrueCar& car, double steering_wheel) {
  return testing::with_noise(without_noise(car, steering_wheel), {0.002, 0.02}, 3);
}

Validation validated(const VehicleEstimate& fit, Model model, const Dataset& data) {
  for (Parameter& p : model.parameters) {
    if (!p.fixed) p.value(0, 0) = testing::parameter(fit, p.name).value;
  }
  return validate(sections_of(fit), model, {data}, {});
}

TEST(DrivenRange, IsThatOfTheSimulation) {
  const testing::TrueCar car;
  const VehicleEstimate fit = fit_vehicle(sladka2010_model({"r", "vy"}), recorded_drive(car, 0.5));
  const Dataset data = without_noise(car, 0.5);
  ASSERT_EQ(fit.driven.size(), 4u);
  EXPECT_NEAR(fit.driven[0].low, kSpeed, 1e-9);
  EXPECT_NEAR(fit.driven[0].high, kSpeed, 1e-9);
  const double ay = kSpeed * data.y.row(0).maxCoeff();
  EXPECT_NEAR(fit.driven[1].high, ay, 0.02 * ay);
  const double beta = std::atan(data.y.row(1).maxCoeff() / kSpeed) * 180.0 / std::numbers::pi;
  EXPECT_NEAR(fit.driven[2].high, beta, 0.02 * beta);
  EXPECT_NEAR(fit.driven[3].high, 0.8, 0.15);
  EXPECT_EQ(in_words(fit.driven[0]), "vx 25 to 25 m/s");
}

TEST(DrivenRange, LittleMoreIsNotBeyond) {
  const std::vector<DrivenRange> fitted = {{"vx", "m/s", 10.0, 20.0}, {"ay", "m/s^2", -3.0, 2.0}};
  EXPECT_EQ(beyond(fitted, {{"vx", "m/s", 9.1, 21.9}, {"ay", "m/s^2", -2.0, 3.4}}), "");
  EXPECT_THAT(beyond(fitted, {{"vx", "m/s", 8.9, 20.0}}), HasSubstr("fitted to 10 to 20 m/s"));
  EXPECT_THAT(beyond(fitted, {{"ay", "m/s^2", -1.0, 3.6}}), HasSubstr("ay -1 to 3.6 m/s^2"));
  EXPECT_EQ(beyond({}, fitted), "");
}

// The tyres of this car saturate: gentle driving does not show it.
TEST(DrivenRange, ADriveBeyondItAccusesNoCar) {
  testing::TrueCar car;
  car.inverse_saturation_f = car.inverse_saturation_r = 1.0 / std::pow(6500.0, 2);
  const Model model = sladka2010_model({"r", "vy"});
  const VehicleEstimate fit = fit_vehicle(model, recorded_drive(car, 0.2));
  const Validation beyond_it = validated(fit, model, recorded_drive(car, 1.8));
  EXPECT_EQ(beyond_it.status, Status::untrusted) << beyond_it.message;
  EXPECT_THAT(beyond_it.message, HasSubstr("goes beyond what the result was fitted to: ay"));
  EXPECT_EQ(validated(fit, model, recorded_drive(car, 0.2)).status, Status::ok);
  testing::TrueCar other = car;
  other.Cf *= 0.7;
  const Validation of_another = validated(fit, model, recorded_drive(other, 0.2));
  EXPECT_EQ(of_another.status, Status::rejected) << of_another.message;
  EXPECT_THAT(of_another.message, Not(HasSubstr("beyond")));
}

}  // namespace
}  // namespace identikal
