#include "identify/regression/track.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "identify/regression/order.h"
#include "identify/vehicle/track.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/regression/least_squares.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// y = u(t) + .5 u(t-1) + 1.5 y(t-1) - .7 y(t-2) + noise
struct ArxRun {
  MatrixXd u;
  VectorXd y;
};
ArxRun second_order(std::uint64_t seed, Index N, double sd) {
  Random random(seed);
  ArxRun out{MatrixXd(1, N), VectorXd::Zero(N)};
  for (Index t = 0; t < N; ++t) {
    out.u(0, t) = random.normal();
    const auto u = [&](Index s) { return s < 0 ? 0.0 : out.u(0, s); };
    const auto y = [&](Index s) { return s < 0 ? 0.0 : out.y[s]; };
    out.y[t] = u(t) + 0.5 * u(t - 1) + 1.5 * y(t - 1) - 0.7 * y(t - 2) + sd * random.normal();
  }
  return out;
}

// Input in degrees, output in km/h, SI inside as everywhere.
Dataset as_recording(const ArxRun& s) {
  Dataset data;
  data.name = "simulated.csv";
  data.dt = 0.1;
  data.time = VectorXd::LinSpaced(s.y.size(), 0.0, 0.1 * static_cast<double>(s.y.size() - 1));
  data.inputs = {{"steer", "deg"}};
  data.outputs = {{"v", "km/h"}};
  data.u = s.u * (M_PI / 180.0);
  data.y = s.y.transpose() / 3.6;
  return data;
}

Model regression_model() {
  Model model;
  model.source = "regression.yaml";
  model.name = "regression";
  model.form = RegressionModel();
  model.inputs = {{"steer", "steer", "deg", "", {}}};
  model.outputs = {{"v", "v", "km/h", "", {}}};
  return model;
}

TEST(ChooseRegression, FindsTheTrueOrderInNineOfTenRecordings) {
  int right = 0, no_forgetting = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const ArxRun s = second_order(seed, 600, 0.5);
    const RegressionChoice choice = choose_regression({}, s.u, s.y, "simulated");
    right += choice.order.inputs == 2 && choice.order.feedback == 2;
    no_forgetting += choice.forgetting == 1.0;
    EXPECT_EQ(choice.candidates, 30);
  }
  RecordProperty("right", right);
  RecordProperty("no_forgetting", no_forgetting);
  EXPECT_GE(right, 90);
  EXPECT_GE(no_forgetting, 90);
}

TEST(ChooseRegression, ForgetsWhereCoefficientsDriftAndAsFastAsPays) {
  // A gain that walks: the best constant memory balances its steps with the noise.
  Random random(2);
  const Index N = 3000;
  MatrixXd phi(1, N);
  VectorXd y(N);
  double gain = 1.0;
  for (Index t = 0; t < N; ++t) {
    gain += 0.02 * random.normal();
    phi(0, t) = random.normal();
    y[t] = gain * phi(0, t) + 0.2 * random.normal();
  }
  const double lambda = choose_forgetting(phi, y, 1e-3, least_forgetting(1));
  // Steady Kalman filter of a random walk seen at ratio q = (.02/.2)^2: 1 - lambda about sqrt(q).
  EXPECT_NEAR(lambda, 0.9, 0.04);
  const double best = predictive_squares(phi, y, 1e-3, lambda, 3);
  for (const double other : {0.8, 0.85, 0.95, 0.98, 1.0}) {
    EXPECT_LE(best, predictive_squares(phi, y, 1e-3, other, 3)) << other;
  }
}

TEST(TrackRegression, ColouredErrorsAreNotMistakenForCoefficientsThatChange) {
  // Constant gain, errors with a memory of 10 samples.
  Random random(8);
  const Index N = 1000;
  ArxRun s{MatrixXd(1, N), VectorXd(N)};
  double error = 0.0;
  for (Index t = 0; t < N; ++t) {
    error = 0.9 * error + 0.2 * random.normal();
    s.u(0, t) = 1.0 + 0.1 * random.normal();
    s.y[t] = s.u(0, t) + error;
  }
  Model model = regression_model();
  as_regression(model).inputs = 1;
  as_regression(model).feedback = 0;
  const TrackedCoefficients estimate = track_regression(model, as_recording(s));
  EXPECT_NE(testing::finding(estimate, FindingCode::coloured_errors), nullptr);
  EXPECT_NE(testing::finding(estimate, FindingCode::short_memory), nullptr);
  EXPECT_GE(testing::derived(estimate, "forgetting")->value, 0.8 - 1e-9);
  as_regression(model).feedback = 1;
  as_regression(model).inputs = 2;
  const TrackedCoefficients complete = track_regression(model, as_recording(s));
  EXPECT_TRUE(complete.findings.empty());
}

TEST(TrackRegression, StopsWhenTold) {
  const Dataset data = as_recording(second_order(3, 2000, 0.5));
  int asked = 0;
  const TrackedCoefficients estimate =
      track_regression(regression_model(), data, [&](const std::string&) { return ++asked < 3; });
  EXPECT_EQ(asked, 3);
  EXPECT_EQ(estimate.status, Status::not_converged);
  EXPECT_EQ(estimate.message, "stopped by the caller, 2 orders tried");
}

TEST(TrackRegression, FindsTheCoefficientsInTheUnitsOfTheFile) {
  const ArxRun s = second_order(3, 2000, 0.5);
  Dataset data = as_recording(s);
  Model model = regression_model();
  as_regression(model).inputs = as_regression(model).feedback = 2;
  as_regression(model).forgetting = 1.0;
  as_regression(model).delta = 1e-6;
  const TrackedCoefficients estimate = track_regression(model, data);
  EXPECT_EQ(estimate.status, Status::ok);
  ASSERT_EQ(estimate.parameters.size(), 4U);
  const std::string names[] = {"steer(t)", "steer(t-1)", "v(t-1)", "v(t-2)"};
  const double truth[] = {1.0, 0.5, 1.5, -0.7};
  const LaggedRows rows = lagged_rows(s.u, s.y, {2, 2});
  const LinearLeastSquares batch = least_squares(rows.phi.transpose(), rows.y);
  const MatrixXd se = standard_errors(batch);
  for (std::size_t i = 0; i < 4; ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    EXPECT_EQ(p.name, names[i]);
    EXPECT_NEAR(p.value, truth[i], 4.0 * p.se);
    EXPECT_NEAR(p.value, batch.theta(static_cast<Index>(i), 0), 1e-6);
    EXPECT_NEAR(p.se, se(static_cast<Index>(i), 0), 1e-6);
  }
  EXPECT_EQ(estimate.parameters[0].unit, "(km/h)/deg");
  EXPECT_EQ(estimate.parameters[2].unit, "");
  EXPECT_EQ(estimate.time_history.mean.cols(), 2000);
  EXPECT_TRUE(std::isnan(estimate.time_history.mean(0, 1)));
  EXPECT_EQ(estimate.time_history.mean(0, 1999), estimate.parameters[0].value);
  EXPECT_NEAR(testing::derived(estimate, "sd of the error")->value, 0.5, 0.03);
}

TEST(TrackRegression, MissingSamplesAreLeftOutAndSaid) {
  const ArxRun s = second_order(4, 400, 0.5);
  Dataset data = as_recording(s);
  data.y(0, 100) = data.u(0, 200) = std::numeric_limits<double>::quiet_NaN();
  Model model = regression_model();
  as_regression(model).inputs = 1;
  as_regression(model).feedback = 2;
  const TrackedCoefficients estimate = track_regression(model, data);
  // Without y(100): rows 100 to 102; without u(200): row 200.
  EXPECT_EQ(estimate.inputs[0].used, 400 - 2 - 4);
  bool said = false;
  for (const std::string& note : estimate.notes) said |= note.starts_with("4 samples left out");
  EXPECT_TRUE(said);
  EXPECT_TRUE(std::isnan(estimate.series.predicted(0, 101)));
  EXPECT_EQ(estimate.time_history.mean.col(101), estimate.time_history.mean.col(99));
}

TEST(TrackRegression, WhatIsNotExcitedIsSaid) {
  ArxRun s = second_order(5, 400, 0.5);
  Dataset data = as_recording(s);
  data.u.setZero();
  Model model = regression_model();
  as_regression(model).inputs = as_regression(model).feedback = 1;
  const TrackedCoefficients estimate = track_regression(model, data);
  EXPECT_EQ(estimate.status, Status::rejected);
  EXPECT_EQ(estimate.parameters[0].verdict, Verdict::unexcited);
  EXPECT_EQ(estimate.parameters[1].verdict, Verdict::ok);
}

TEST(TrackRegression, TooFewRowsAreRefused) {
  const Dataset data = as_recording(second_order(6, 12, 0.5));
  EXPECT_THROW(track_regression(regression_model(), data), InputError);
}

// Four lane changes in a row; with the third the front tyres lose stiffness.
Dataset four_lane_changes(double factor, std::uint64_t seed) {
  testing::TrueCar car, worn;
  worn.Cf *= factor;
  Dataset out;
  for (int i = 0; i < 4; ++i) {
    const Dataset one = testing::lane_change(i < 2 ? car : worn, 100.0, {"r", "vy"});
    if (i == 0) {
      out = one;
      continue;
    }
    const Index n = out.size(), m = one.size();
    const double shift = out.time[n - 1] + out.dt;
    out.time.conservativeResize(n + m);
    out.time.tail(m) = one.time.array() + shift;
    out.u.conservativeResize(Eigen::NoChange, n + m);
    out.u.rightCols(m) = one.u;
    out.y.conservativeResize(Eigen::NoChange, n + m);
    out.y.rightCols(m) = one.y;
  }
  return testing::with_noise(out, {0.01, 0.03}, seed);
}

TEST(TrackVehicle, FollowsAStiffnessThatDrops) {
  const testing::TrueCar car;
  Model model = testing::sladka2010_model();
  as_vehicle(model).tracking.forgetting = 0.96;
  as_vehicle(model).tracking.reset = true;
  const TrackedCoefficients estimate = track_vehicle(model, four_lane_changes(0.6, 7));
  EXPECT_EQ(estimate.status, Status::ok);
  const TimeHistory& course = estimate.time_history;
  ASSERT_EQ(course.names, (std::vector<std::string>{"Iz", "Cf", "Cr"}));
  const auto at = [&](double time, Index i) {
    Index k = 0;
    while (k + 1 < estimate.series.time.size() && estimate.series.time[k] < time) ++k;
    return course.mean(i, k);
  };
  RecordProperty("Cf_before", std::to_string(at(13.5, 1) / car.Cf));
  RecordProperty("Cf_after", std::to_string(at(27.5, 1) / car.Cf));
  RecordProperty("Cr_after", std::to_string(at(27.5, 2) / car.Cr));
  RecordProperty("Iz_after", std::to_string(at(27.5, 0) / car.Iz));
  EXPECT_NEAR(at(13.5, 1) / car.Cf, 1.0, 0.1);
  EXPECT_NEAR(at(13.5, 2) / car.Cr, 1.0, 0.1);
  EXPECT_NEAR(at(27.5, 1) / car.Cf, 0.6, 0.06);
  EXPECT_NEAR(at(27.5, 2) / car.Cr, 1.0, 0.1);
  EXPECT_NEAR(at(27.5, 0) / car.Iz, 1.0, 0.2);
  ASSERT_FALSE(course.changes.empty());
  EXPECT_NEAR(course.changes.front().found, 15.5, 1.6);
  EXPECT_NE(testing::finding(estimate, FindingCode::tracked_only), nullptr);
}

TEST(TrackVehicle, KnowsWhatItCannotTrack) {
  const Dataset data = testing::lane_change({}, 100.0, {"r"});
  EXPECT_THROW(track_vehicle(testing::sladka2010_model({"r"}), data), InputError);
  Model model = testing::sladka2010_model();
  for (Parameter& p : model.parameters) p.fixed = true;
  EXPECT_THROW(track_vehicle(model, testing::lane_change({}, 100.0)), InputError);
  // A stiffness that is known stays as it is.
  model = testing::sladka2010_model();
  model.parameters[6] = testing::known("Cr", "N/rad", 88107.7);
  const TrackedCoefficients estimate = track_vehicle(model, testing::lane_change({}, 100.0));
  EXPECT_EQ(estimate.time_history.names, (std::vector<std::string>{"Iz", "Cf"}));
  EXPECT_NEAR(testing::parameter(estimate, "Cf").value, 88107.7, 2000.0);
  EXPECT_NEAR(testing::parameter(estimate, "Iz").value, 2319.0, 100.0);
}

}  // namespace
}  // namespace identikal
