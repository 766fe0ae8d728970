// The single-track written as formulas against the built-in one.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/row_selection.h"
#include "identify/noise/ml.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/usable_data.h"
#include "lib/data/csv.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

// Steps of 10 ms as the built-in model takes them (lib/vehicle/motion.h), and inputs as smooth.
const char* const kCarAsFormulas = R"(identikal: 1
time: {kind: continuous, column: t, unit: s, inputs: pchip, integration_step: 10 ms}
parameters:
  m: 1446 kg
  a: 0.987 m
  b: 1.525 m
  ratio: 21
  Iz: {value: 2000 kg m^2, min: 800, max: 6000}
  Cf: {value: 8e4 N/rad, min: 1e4, max: 4e5}
  Cr: {value: 8e4 N/rad, min: 1e4, max: 4e5}
  vy0: {value: 0 m/s}
  r0: {value: 0 rad/s}
states: {vy: m/s, r: rad/s}
inputs: {steer: {column: swa, unit: deg}, vx: {column: speed, unit: km/h}}
let: {Ff: Cf*(steer/ratio - (vy + a*r)/vx), Fr: -Cr*(vy - b*r)/vx}
dynamics: {vy: (Ff + Fr)/m - vx*r, r: (a*Ff - b*Fr)/Iz}
outputs: {r: {column: yaw_rate, unit: deg/s}, vy: {column: vy, unit: m/s}}
noise: {measurement: {sd: {r: 0.01 rad/s, vy: 0.03 m/s}}}
initial: {mean: {vy: vy0, r: r0}}
use_when: "vx > 5"
)";

double seconds(const std::function<void()>& work) {
  double best = 1e9;
  for (int i = 0; i < 20; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    best = std::min(best, spent.count());
  }
  return best;
}

TEST(FormulaVehicle, EqualsTheBuiltInSingleTrack) {
  const std::string root = IDENTIKAL_SOURCE_DIR;
  const Table table = read_csv(root + "/data/severe_lane_change.csv");
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("formula_vehicle_" + std::to_string(getpid()) + ".yaml"))
                               .string();
  std::ofstream(path) << kCarAsFormulas;
  const Model formulas = read_model_file(path);
  std::filesystem::remove(path);
  const std::vector<Dataset> recording = usable_segments(
      formulas, make_dataset(table, formulas.time, formulas.inputs, formulas.outputs));

  const Model built_in = read_model_file(root + "/examples/severe_lane_change.yaml");
  const VehicleRun run =
      usable_run(built_in, {make_dataset(table, built_in.time, built_in.inputs, built_in.outputs)});
  const VehicleUnknowns unknowns = vehicle_unknowns(built_in);
  const VehicleProblem problem =
      make_vehicle_problem(run, unknowns, demand_of(unknowns, unknowns.value));
  SolverOptions options;
  options.decrement_tolerance = 1e-16;
  options.function_tolerance = 0.0;
  const VectorXd start = coordinates_of(problem, unknowns.value);
  const VehicleOptimum best = maximise_likelihood(problem, start, options);

  RecordingsLikelihood likelihood(formulas, recording);
  const LikelihoodProblem formula_problem = likelihood.problem();
  const VectorXd formula_start = coordinates(formulas.parameters);
  const Solution found = maximise(formula_problem, formula_start, options);
  ASSERT_EQ(recording.size(), 1U);

  const VehicleParameters<double> car = parameters_at(problem, best.z);
  const double expected[] = {car[kYawInertia], car[kCf], car[kCr]};
  const char* const names[] = {"Iz", "Cf", "Cr"};
  for (int i = 0; i < 3; ++i) {
    std::printf("%s: formulas %.12g, built-in %.12g, %.1e apart\n", names[i], found.x[i],
                expected[i], found.x[i] / expected[i] - 1.0);
    EXPECT_NEAR(found.x[i] / expected[i], 1.0, 1e-8) << names[i];
  }
  EXPECT_NEAR(found.summary.objective, best.log_likelihood, 1e-9);

  const double formula_time = seconds([&] { maximise(formula_problem, formula_start); });
  const double built_in_time = seconds([&] { maximise_likelihood(problem, start, {}); });
  std::printf("fit from the same start: formulas %.2f ms, built-in %.2f ms, ratio %.2f\n",
              1e3 * formula_time, 1e3 * built_in_time, formula_time / built_in_time);
}

}  // namespace
}  // namespace identikal
