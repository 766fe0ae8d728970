// Recordings in many segments: short gaps are bridged, initial states are eliminated exactly, and time is
// linear in their number.
#include <chrono>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/internal/initial_states.h"
#include "lib/base/error.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;
using namespace ::identikal::testing;  // NOLINT: the cases of tests/support

Model car_for_gaps(const std::string& more = "") {
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
inputs: {steering_wheel_angle: {unit: rad}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, vy: {unit: m/s}}
)" + more,
                          "car.yaml");
}

Dataset long_weave(double seconds) {
  const Dataset clean = record(
      {}, uniform_time(seconds, 100.0), {"r", "vy"},
      [](double t) { return 0.5 * std::sin((1.0 + 0.5 * std::sin(0.1 * t)) * 2.0 * t); },
      [](double t) { return 20.0 + 4.0 * std::sin(0.05 * t); });
  return with_noise(clean, {0.003, 0.02}, 11);
}

/// Without the rows behind every `period`-th one, `missing` of them.
Dataset with_hiccups(const Dataset& data, Eigen::Index period, Eigen::Index missing) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (t < missing || t % period >= missing) rows.push_back(t);
  }
  Dataset out = data;
  out.time = Eigen::VectorXd(data.time(rows));
  out.u = Eigen::MatrixXd(data.u(Eigen::all, rows));
  out.y = Eigen::MatrixXd(data.y(Eigen::all, rows));
  return out;
}

TEST(VehicleSegments, ShortGapsAreSimulatedAcross) {
  const Dataset whole = long_weave(30.0), hiccups = with_hiccups(whole, 150, 5);
  const VehicleRun bridged = usable_run(car_for_gaps(), {hiccups});
  EXPECT_EQ(bridged.segments.size(), 1u);
  EXPECT_EQ(bridged.used, hiccups.size());
  EXPECT_EQ(bridged.notes.back(), "bridged by the simulation (max_gap): 19 gaps of up to 0.06 s");
  EXPECT_EQ(usable_run(car_for_gaps("max_gap: 0 s\n"), {hiccups}).segments.size(), 20u);
  EXPECT_EQ(usable_run(car_for_gaps("max_gap: 50 ms\n"), {hiccups}).segments.size(), 20u);
  EXPECT_EQ(usable_run(car_for_gaps("max_gap: 60 ms\n"), {hiccups}).segments.size(), 1u);
  EXPECT_THAT([] { car_for_gaps("max_gap: 2 s\n"); },
              ::testing::ThrowsMessage<InputError>(
                  HasSubstr("max_gap is '2 s'; expected between 0 s and 1 s")));
}

TEST(VehicleSegments, ShortHolesOfInputsAreStraight) {
  Dataset data = long_weave(30.0);
  data.u.row(0).segment(1000, 5).setConstant(kNone);
  data.u.row(1).segment(2000, 5).setConstant(kNone);
  const VehicleRun run = usable_run(car_for_gaps(), {data});
  EXPECT_EQ(run.segments.size(), 1u);
  EXPECT_EQ(run.used, data.size());
  EXPECT_EQ(run.notes.back(), "bridged by the simulation (max_gap): 2 holes in inputs");
  const double share = 3.0 / 6.0;
  EXPECT_NEAR(run.steering[1002], data.u(0, 999) + share * (data.u(0, 1005) - data.u(0, 999)),
              1e-12);
  data.u.row(0).segment(1000, 20).setConstant(kNone);
  EXPECT_EQ(usable_run(car_for_gaps(), {data}).segments.size(), 2u);
}

// A log with 60 ms missing every 0.64 s held no segment of a second, and every other one began anew.
TEST(VehicleSegments, EstimatesAreThoseOfTheRecordingWithoutGaps) {
  const Dataset whole = long_weave(60.0), hiccups = with_hiccups(whole, 64, 5);
  const VehicleEstimate clean = fit_vehicle(car_for_gaps(), {whole}, of_noise_alone()),
                        fit = fit_vehicle(car_for_gaps(), {hiccups}, of_noise_alone());
  EXPECT_EQ(fit.status, Status::ok) << fit.message;
  for (const auto& [name, truth] : {std::pair{"Iz", 2319.0}, {"Cf", 88.1077}, {"Cr", 88.1077}}) {
    const EstimatedParameter& p = parameter(fit, name);
    EXPECT_NEAR(p.value, truth, 3.0 * p.se) << name;
    // A twelfth of the rows is missing.
    EXPECT_NEAR(p.value, parameter(clean, name).value, 1.5 * p.se) << name;
    EXPECT_NEAR(p.se, parameter(clean, name).se, 0.15 * p.se) << name;
  }
}

/// The equations with all initial states beside the parameters.
struct DenseEquations {
  Eigen::MatrixXd J;
  Eigen::VectorXd e;
};

DenseEquations dense(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  LeastSquares::RowMatrix J;
  DenseEquations out;
  EXPECT_TRUE(output_error(problem, z, out.e, &J));
  const Eigen::Index k = problem.parameters();
  out.J = Eigen::MatrixXd::Zero(J.rows(), problem.coordinates());
  out.J.leftCols(k) = J.leftCols(k);
  for (Eigen::Index n = 0; n < J.rows(); ++n) {
    std::size_t s = 0;
    while (problem.run->segments[s].first + problem.run->segments[s].rows <= problem.row[n]) ++s;
    out.J.row(n).segment<2>(problem.state_of(s)) = J.row(n).tail<2>();
  }
  return out;
}

class InSegments : public ::testing::Test {
 protected:
  Model model_ = car_for_gaps("max_gap: 0 s\ntyre: {curve: tanh}\n");
  VehicleRun run_ = usable_run(model_, {with_hiccups(long_weave(12.0), 300, 5)});
  VehicleUnknowns unknowns_ = vehicle_unknowns(model_);
  VehicleProblem problem_ =
      make_vehicle_problem(run_, unknowns_, demand_of(unknowns_, unknowns_.value));
};

TEST_F(InSegments, EliminationIsThatOfTheDenseEquations) {
  ASSERT_EQ(run_.segments.size(), 4u);
  const Eigen::VectorXd z = coordinates_of(problem_, unknowns_.value);
  const DenseEquations all = dense(problem_, z);
  const Eigen::Index k = problem_.parameters(), states = problem_.coordinates() - k;
  const Eigen::MatrixXd H = all.J.transpose() * all.J;
  const Eigen::VectorXd g = all.J.transpose() * all.e;
  const Eigen::MatrixXd B = H.bottomRightCorner(states, states), C = H.bottomLeftCorner(states, k);

  Eigen::VectorXd e;
  LeastSquares::RowMatrix J;
  output_error(problem_, z, e, &J);
  SegmentedEquations equations(problem_);
  add_rows(problem_, J, e, Eigen::VectorXd::Ones(e.size()), 1.0, equations);
  const EliminatedStates found = eliminate_states(equations);
  const auto solver = B.ldlt();
  const Eigen::MatrixXd information = H.topLeftCorner(k, k) - C.transpose() * solver.solve(C);
  EXPECT_LT((found.information - information).norm(), 1e-10 * information.norm());
  const Eigen::VectorXd gradient = g.head(k) - C.transpose() * solver.solve(g.tail(states));
  EXPECT_LT((found.gradient - gradient).norm(), 1e-10 * g.norm());
  const Eigen::VectorXd step = -solver.solve(g.tail(states));
  EXPECT_LT((found.states - step).norm(), 1e-9 * step.norm());
  EXPECT_NEAR(found.gain, -0.5 * g.tail(states).dot(step), 1e-9 * found.gain);

  Eigen::MatrixXd X = J.leftCols(k);
  const Eigen::MatrixX2d basis = project_out_states(problem_, J.rightCols<2>(), X);
  EXPECT_NEAR(basis.squaredNorm(), 8.0, 1e-10) << "two states of four segments";
  EXPECT_LT((all.J.rightCols(states).transpose() * X).norm(), 1e-9 * C.norm());
  EXPECT_LT((X.transpose() * X - information).norm(), 1e-9 * information.norm());
}

// The optimum is one of all coordinates, whichever are eliminated.
TEST_F(InSegments, NoGradientIsLeftAtTheOptimum) {
  Eigen::VectorXd start = coordinates_of(problem_, unknowns_.value);
  const VehicleOptimum best = maximise_likelihood(problem_, start, {});
  ASSERT_TRUE(best.converged) << best.message;
  DenseEquations at = dense(problem_, best.z);
  for (Eigen::Index n = 0; n < at.e.size(); ++n) {
    at.e[n] /= best.sd[problem_.output[n]];
    at.J.row(n) /= best.sd[problem_.output[n]];
  }
  const Eigen::VectorXd gradient = at.J.transpose() * at.e;
  const Eigen::MatrixXd H = at.J.transpose() * at.J;
  std::vector<Eigen::Index> open;
  for (Eigen::Index i = 0; i < best.z.size(); ++i) {
    if (i >= problem_.parameters() || !is_at_bound(problem_, best.z, i)) open.push_back(i);
  }
  const Eigen::VectorXd g = gradient(open);
  const double gain = 0.5 * g.dot(Eigen::MatrixXd(H(open, open)).ldlt().solve(g));
  EXPECT_LT(gain, 1e-6) << "nats";
  // Another start of the initial states ends at the same place.
  for (Eigen::Index i = problem_.parameters(); i < start.size(); ++i) start[i] = 0.0;
  const VehicleOptimum other = maximise_likelihood(problem_, start, {});
  EXPECT_NEAR(other.log_likelihood, best.log_likelihood, 1e-6);
}

}  // namespace
}  // namespace identikal
