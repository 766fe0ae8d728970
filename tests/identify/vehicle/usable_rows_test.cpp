// Which rows of a drive does a fit use: conditions, short dips of the speed, spins, and the steps of
// the steering's sensor.
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/steering_steps.h"
#include "identify/vehicle/usable_data.h"
#include "lib/base/error.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

Model car_with_rows(const std::string& more, const std::string& steering = "") {
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
inputs: {steering_wheel_angle: {unit: rad)" +
                              steering +
                              R"(}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, vy: {unit: m/s}}
)" + more,
                          "car.yaml");
}

Dataset weaving(double speed = 20.0) {
  return record(
      {}, uniform_time(30.0, 100.0), {"r", "vy"},
      [](double t) { return 0.5 * std::sin((1.0 + 0.1 * t) * t); }, [=](double) { return speed; });
}

// Noise of the speed about the least one cut a drive into dozens of segments.
TEST(UsableRows, NoiseOfTheSpeedCutsNothing) {
  Dataset data = weaving(5.05);
  Random random(3);
  for (Eigen::Index t = 0; t < data.size(); ++t) data.u(1, t) += 0.05 * random.normal();
  const VehicleRun run = usable_run(car_with_rows("use_when: \"vx > 5\"\n"), {data});
  EXPECT_EQ(run.segments.size(), 1u);
  EXPECT_GT(run.used, 2950);
  // A stop does.
  data.u.row(1).segment(1000, 100).setConstant(1.0);
  EXPECT_EQ(usable_run(car_with_rows("use_when: \"vx > 5\"\n"), {data}).segments.size(), 2u);
}

TEST(UsableRows, ConditionsOnOutputsAndFlags) {
  Dataset data = weaving();
  data.u.conservativeResize(3, data.size());
  data.u.row(2).setZero();
  data.u.row(2).segment(1200, 5).setOnes();  // 50 ms
  data.u.row(2).segment(2000, 100).setOnes();
  const auto run = [&](const std::string& use_when) {
    return usable_run(car_with_rows("flags: {esc: {column: e}}\nuse_when: " + use_when + "\n"),
                      {data});
  };
  EXPECT_EQ(run("\"esc == 0\"").used, data.size() - 105);
  EXPECT_EQ(run("\"esc == 0\"").segments.size(), 3u);
  EXPECT_EQ(run("{condition: \"esc == 0\", bridge: 60 ms}").used, data.size() - 100);
  // 0.5 s before and behind as well.
  const VehicleRun wide = run("{condition: \"esc == 0\", bridge: 60 ms, margin: 0.495 s}");
  EXPECT_EQ(wide.used, data.size() - 100 - 2 * 49);
  EXPECT_THAT(wide.notes.back(), HasSubstr("198 where use_when does not hold"));
  const VehicleRun mild = run("{condition: \"abs(r) < 0.1\", bridge: 0.1 s}");
  EXPECT_LT(mild.used, data.size());
  EXPECT_THAT([&] { run("\"esp == 0\""); }, ::testing::ThrowsMessage<InputError>(HasSubstr("esp")));
}

TEST(UsableRows, ASpinIsNamedAndLeftOut) {
  Dataset data = weaving();
  for (Eigen::Index t = 2000; t < data.size(); ++t) {
    const double since = data.time[t] - 20.0, beta = std::min(1.5, 0.7 * since);
    data.u(0, t) = -1.5;
    data.u(1, t) = 20.0 * std::cos(beta);
    data.y.col(t) << 0.7, -20.0 * std::sin(beta);
  }
  const Dataset noisy = with_noise(data, {0.003, 0.02}, 7);
  const VehicleEstimate fit = fit_vehicle(car_with_rows(""), {noisy}, of_noise_alone());
  const Finding* spin = finding(fit, FindingCode::spin);
  ASSERT_NE(spin, nullptr);
  EXPECT_THAT(spin->text, HasSubstr("the car spins at 20"));
  EXPECT_EQ(finding(fit, FindingCode::sign_steering), nullptr);
  EXPECT_EQ(finding(fit, FindingCode::clock_offset), nullptr);
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_NEAR(parameter(fit, "Cr").value, 88.1077, 3.5 * parameter(fit, "Cr").se);
}

// A flag that use_when does not ask leaves rows out by itself, and a finding says which.
TEST(UsableRows, AFlagLeavesOutTheRowsWhereItIsSet) {
  Dataset data = weaving();
  data.u.conservativeResize(4, data.size());
  data.u.bottomRows(2).setZero();
  data.u.row(2).segment(1200, 5).setOnes();
  data.u.row(3).segment(2000, 100).setConstant(3.0);
  const auto run = [&](const std::string& more) {
    return usable_run(car_with_rows("flags: {esc: {column: e}, brake: {column: p}}\n" + more),
                      {data});
  };
  const VehicleRun masked = run("");
  EXPECT_EQ(masked.used, data.size() - 105);
  EXPECT_EQ(masked.segments.size(), 3u);
  ASSERT_EQ(masked.findings.size(), 2u);
  EXPECT_EQ(masked.findings[0].code, FindingCode::rows_left_out);
  EXPECT_EQ(masked.findings[0].severity, Severity::note);
  EXPECT_EQ(masked.findings[0].text,
            "esc is set in 5 rows (12 to 12.04 s); these rows are left out");
  EXPECT_EQ(masked.findings[1].text,
            "brake is set in 100 rows (20 to 20.99 s); these rows are left out");
  EXPECT_THAT(masked.notes.back(), HasSubstr("; 105 where a flag is set"));
  // What the condition asks is the condition's.
  EXPECT_EQ(run("use_when: \"brake < 5\"\n").used, data.size() - 5);
  const VehicleRun asked = run("use_when: \"esc < 5 and brake == 0\"\n");
  EXPECT_EQ(asked.used, data.size() - 100);
  EXPECT_EQ(asked.findings[0].text,
            "use_when does not hold in 100 rows (20 to 20.99 s); these rows are left out");
  // An empty cell says what the one before said.
  data.u.row(3).segment(2010, 80).setConstant(kNaN);
  EXPECT_EQ(run("").used, data.size() - 105);
}

/// Held in a slide of 15 deg from 12 s on for 1.5 s, after which the drive goes on.
Dataset with_a_slide() {
  Dataset data = weaving();
  for (Eigen::Index t = 1200; t < 1350; ++t) {
    data.u(0, t) = -0.6;
    data.y.col(t) << 0.35, -20.0 * std::tan(0.26);
  }
  return with_noise(data, {0.003, 0.02}, 7);
}

// A drift is no wrong sign. Tyres of a straight line do not slide, so its rows are left out; tyres that
// bend may use them.
TEST(UsableRows, ASlideIsNamed) {
  const Dataset data = with_a_slide();
  const VehicleEstimate fit = fit_vehicle(car_with_rows(""), {data}, of_noise_alone());
  const Finding* slide = finding(fit, FindingCode::countersteer);
  ASSERT_NE(slide, nullptr);
  EXPECT_EQ(
      slide->text,
      "the driver holds a slide by steering against the turn at 12 s (until 13.49 s, sideslip "
      "up to 15 deg); these rows are left out");
  for (const FindingCode code :
       {FindingCode::sign_steering, FindingCode::sign_vy, FindingCode::clock_offset}) {
    EXPECT_EQ(finding(fit, code), nullptr);
  }
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  EXPECT_NEAR(parameter(fit, "Cr").value, 88.1077, 3.5 * parameter(fit, "Cr").se);
  const VehicleRun bending = usable_run(car_with_rows("tyre: {curve: tanh}\n"), {data});
  EXPECT_EQ(bending.used, data.size());
  EXPECT_EQ(bending.findings.front().code, FindingCode::countersteer);
}

TEST(SteeringSteps, AreBridged) {
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(1001, 0.0, 10.0);
  const Eigen::VectorXd exact = time.unaryExpr([](double t) { return 0.02 * std::sin(t); });
  const double step = 0.002;
  const Eigen::VectorXd read =
      exact.unaryExpr([=](double x) { return step * std::round(x / step); });
  EXPECT_NEAR(step_of(read), step, 1e-12);
  EXPECT_EQ(step_of(exact), 0.0);
  const double before = (read - exact).norm(),
               after = (bridged_steps(time, read, step) - exact).norm();
  std::printf("error of the bridged angle: %.2f of that of the steps\n", after / before);
  EXPECT_LT(after, 0.4 * before);
  EXPECT_LE((bridged_steps(time, read, step) - read).cwiseAbs().maxCoeff(), 0.5 * step + 1e-15);
}

TEST(SteeringNoise, IsReadInTheUnitOfItsColumn) {
  EXPECT_EQ(as_vehicle(car_with_rows("", ", noise: 0.002")).steering_noise, 0.002);
  EXPECT_NEAR(as_vehicle(car_with_rows("", ", noise: 1 deg")).steering_noise, 0.0174533, 1e-7);
  EXPECT_THROW(car_with_rows("", ", noise: 0"), InputError);
}

// Gentle driving with a coarse sensor at the road wheels: the values are off, the finding says so and
// by how much, and the bridged angle mends it.
TEST(SteeringSteps, AttenuationIsStatedAndMended) {
  Dataset data = record(
      {}, uniform_time(120.0, 100.0), {"r", "vy"},
      [](double t) {
        return 0.3 * std::sin(0.35 * t) + 0.03 * std::sin(3.1 * t) + 0.02 * std::sin(7.3 * t + 1.0);
      },
      [](double) { return 22.0; });
  const double step = 0.04;
  const Eigen::RowVectorXd exact = data.u.row(0);
  data = with_noise(data, {0.001, 0.01}, 8);
  const VehicleEstimate right = fit_vehicle(car_with_rows(""), {data}, of_noise_alone());
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    data.u(0, t) = step * std::round(data.u(0, t) / step);
  }
  const VehicleEstimate plain = fit_vehicle(car_with_rows(""), {data}, of_noise_alone());
  const VehicleEstimate mended =
      fit_vehicle(car_with_rows("", ", steps: 0.04"), {data}, of_noise_alone());
  const Finding* steps = finding(plain, FindingCode::steering_steps);
  for (const char* name : {"Cf", "Cr", "Iz"}) {
    const double truth = std::string(name) == "Iz" ? 2319.0 : 88.1077;
    const auto off = [&](const VehicleEstimate& fit) {
      return 100.0 * (parameter(fit, name).value / truth - 1.0);
    };
    std::printf("%s exact %+.1f %%, as read %+.1f %%, bridged %+.1f %%\n", name, off(right),
                off(plain), off(mended));
    EXPECT_LT(std::abs(off(mended)), 0.5 * std::abs(off(plain)) + 2.0) << name;
  }
  ASSERT_NE(steps, nullptr);
  std::printf("%s\n", steps->text.c_str());
  EXPECT_THAT(steps->text, HasSubstr("steps of 0.04 rad"));
  EXPECT_EQ(finding(mended, FindingCode::steering_steps), nullptr);
}

}  // namespace
}  // namespace identikal
