// Is what `simulate` drives what was asked for?
#include "identify/simulation/simulate.h"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

Model car_model() {
  Model model = sladka2010_model({"r", "vy", "ay"});
  for (Parameter& p : model.parameters) {
    if (p.name == "Cf" || p.name == "Cr") p.value.setConstant(88107.7);
  }
  for (ChannelSource& source : model.outputs) source.column = source.name;
  for (ChannelSource& source : model.inputs) source.column = source.name;
  as_vehicle(model).measurement_sd.assign(3, std::nan(""));
  return model;
}

// The values below the '#' lines and the header.
Eigen::MatrixXd rows_of(const std::string& csv) {
  std::istringstream lines(csv);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(lines, line);) {
    if (line[0] == '#' || line[0] == 't') continue;
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  Eigen::MatrixXd out(rows.size(), rows.front().size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.row(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::RowVectorXd>(rows[i].data(), out.cols());
  }
  return out;
}

DrivenRecord drive_named(const std::string& name, std::map<std::string, double> settings = {}) {
  ManoeuvreRequest request;
  request.name = name;
  request.settings = std::move(settings);
  return drive_manoeuvre(request, TyreCurve::linear, sladka2010_car(), false);
}

TEST(Manoeuvres, SteadyAccelerationIsTheStandards) {
  EXPECT_NEAR(drive_named("step-steer").motion.back().ay, 4.0, 0.01);
  EXPECT_NEAR(drive_named("step-steer", {{"ay", -2.5}}).motion.back().ay, -2.5, 0.01);
  double weave = 0.0;
  for (const Motion& m : drive_named("weave").motion) weave = std::max(weave, m.ay);
  EXPECT_NEAR(weave, 2.0, 0.1);  // 0.2 Hz is nearly steady
  const DrivenRecord circle = drive_named("steady-circle");
  EXPECT_NEAR(circle.vx.tail(1)[0] / circle.motion.back().r, 100.0, 1.0);
  const DrivenRecord steered = drive_named("constant-steering");
  EXPECT_EQ(steered.steering.minCoeff(), steered.steering.maxCoeff());
  EXPECT_GT(steered.vx.tail(1)[0] / steered.motion.back().r, 105.0);  // this car understeers
  // A angle for 0.3 g at 80 km/h, half as much again.
  EXPECT_NEAR(drive_named("sine-with-dwell").steering.maxCoeff(),
              1.5 *
                  drive_named("step-steer", {{"ay", 0.3 * kStandardGravity}}).steering.maxCoeff() *
                  steering_response(linear_car(sladka2010_car()), 100.0 / 3.6).ay_gain /
                  steering_response(linear_car(sladka2010_car()), 80.0 / 3.6).ay_gain,
              1e-3);
}

TEST(Manoeuvres, GatesAreJudged) {
  const DrivenRecord passed = drive_named("obstacle-avoidance");
  ASSERT_EQ(passed.notes.size(), 4U);
  for (std::size_t i = 1; i < 4; ++i) {
    EXPECT_NE(passed.notes[i].find("passed, clearance 0."), std::string::npos) << passed.notes[i];
  }
  const DrivenRecord longer = drive_named("obstacle-avoidance", {{"rear", 5.0}});
  EXPECT_NE(longer.notes[1].find("cones hit"), std::string::npos) << longer.notes[1];
  ManoeuvreRequest early;
  early.name = "double-lane-change";
  early.duration = 3.0;
  const DrivenRecord half = drive_manoeuvre(early, TyreCurve::linear, sladka2010_car(), false);
  EXPECT_NE(half.notes[3].find("not reached"), std::string::npos) << half.notes[3];
}

TEST(Manoeuvres, MistakesAreSaid) {
  const auto what = [](const std::string& name, const std::map<std::string, double>& settings) {
    try {
      drive_named(name, settings);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(what("step-ster", {}).find("did you mean 'step-steer'?"), std::string::npos);
  EXPECT_NE(what("step-steer", {{"rize", 1.0}}).find("did you mean 'rise'?"), std::string::npos);
  EXPECT_NE(what("obstacle-avoidance", {{"width", 0.0}}).find("positive"), std::string::npos);
  for (const Manoeuvre& each : manoeuvres()) {
    EXPECT_NE(manoeuvre_help().find(each.name + " ("), std::string::npos);
    EXPECT_NO_THROW(drive_named(each.name)) << each.name;
  }
}

// The realised ratio scatters by 20 log10(e) sqrt(1 / 2N) dB: 0.14 dB here; five of them, 1 false
// alarm in a million.
TEST(SimulateVehicle, SignalToNoiseRatioIsRealised) {
  const Model model = car_model();
  ManoeuvreRequest request;
  request.rate = 280.0;  // 1960 rows
  const Eigen::MatrixXd clean = rows_of(simulate_vehicle(model, request, nullptr, 300.0, 1).csv);
  const Eigen::MatrixXd noisy = rows_of(simulate_vehicle(model, request, nullptr, 20.0, 1).csv);
  for (Eigen::Index j = 3; j < 6; ++j) {
    const double ratio = clean.col(j).squaredNorm() / (noisy - clean).col(j).squaredNorm();
    EXPECT_NEAR(10.0 * std::log10(ratio), 20.0, 5.0 * 8.686 * std::sqrt(0.5 / 1960.0)) << j;
  }
  EXPECT_EQ((noisy - clean).leftCols(3).norm(), 0.0);
}

TEST(SimulateVehicle, NoiseHasToBeGiven) {
  Model model = car_model();
  const auto message = [&model] {
    try {
      simulate_vehicle(model, {}, nullptr, std::nullopt, 1);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message().find("--snr"), std::string::npos);
  as_vehicle(model).measurement_sd = {0.01, 0.03, 0.1};
  EXPECT_EQ(message(), "");
}

}  // namespace
}  // namespace identikal
