// How long does the study of the structure take? On a drive of 8,800 rows that is made here.
//
//   structure_bench [ROWS]
//
// prints processor seconds of fit_vehicle() and their ratio to those of the fit that asks for no structure,
// medians of five, and the estimates beside the truth.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "identify/model/model_file.h"
#include "identify/vehicle/fit.h"
#include "lib/base/random.h"
#include "lib/vehicle/secondary_effects.h"

namespace identikal {
namespace {

constexpr int kRepeats = 5;
constexpr double kRowsPerSecond = 100.0;

const char* const kBenchCar = R"(
identikal: 1
model: single-track
time: {column: t, unit: s}
parameters:
  m: 1500 kg
  a: 1.15 m
  b: 1.55 m
  steering_ratio: 16
  Iz: {value: 2700 kg m^2, min: 700, max: 10000}
  Cf: {value: 80 kN/rad, min: 10, max: 400}
  Cr: {value: 80 kN/rad, min: 10, max: 400}
  steering_offset: {value: 0 deg, min: -5, max: 5}
  bias_ay: {value: 0 m/s^2, min: -1, max: 1}
inputs: {steering_wheel_angle: {unit: rad}, vx: {unit: m/s}}
outputs: {r: {unit: rad/s}, ay: {unit: m/s^2}}
)";

VehicleParameters<double> bench_car() {
  VehicleParameters<double> p = neutral_vehicle();
  p[kMass] = 1500.0;
  p[kA] = 1.15;
  p[kB] = 1.55;
  p[kYawInertia] = 2500.0;
  p[kCf] = 95e3;
  p[kCr] = 120e3;
  p[kSteeringRatio] = 16.0;
  return p;
}

/// A slalom whose frequency rises, again and again, at speeds that change; with lags, roll and bending
/// tyres, and the sensors that a test engineer has: angle in steps of .1 deg.
Dataset long_drive(Eigen::Index rows) {
  Random random(1);
  const double degree = std::numbers::pi / 180.0;
  Dataset out;
  out.name = "drive";
  out.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRowsPerSecond);
  out.dt = 1.0 / kRowsPerSecond;
  out.inputs = {{"steering_wheel_angle", "rad"}, {"vx", "m/s"}};
  out.outputs = {{"r", "rad/s"}, {"ay", "m/s^2"}};
  out.u.resize(2, rows);
  out.y.resize(2, rows);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double t = out.time[k], within = std::fmod(t, 20.0);
    out.u.col(k) << 25.0 * degree *
                        std::sin(2.0 * std::numbers::pi * (0.2 + 0.05 * within) * within),
        20.0 + 5.0 * std::sin(0.07 * t);
  }
  const DrivenSegment driven = drive(out.time, out.u.row(0), out.u.row(1), {.longest_step = 0.005});
  SecondaryEffects effects{};
  effects[kTyreRelaxation] = 0.3;
  effects[kRollGradient] = 0.006;
  effects[kTyreSoftening] = 0.7;
  simulate_with_effects(linear_car(bench_car()), effects, driven, 0.0, 0.0,
                        [&](Eigen::Index k, const Motion& at, double) {
                          out.y.col(k) << at.r + 0.12 * degree * random.normal(),
                              at.ay + 0.06 * random.normal();
                        });
  const double step = 0.1 * degree;
  for (Eigen::Index k = 0; k < rows; ++k) out.u(0, k) = step * std::round(out.u(0, k) / step);
  return out;
}

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Timed {
  double seconds;
  VehicleEstimate fit;
};

Timed timed(const Model& model, const Dataset& data, VehicleFitOptions::Structure structure) {
  VehicleFitOptions options;
  options.structure = structure;
  std::vector<double> seconds;
  Timed out;
  for (int i = 0; i < kRepeats; ++i) {
    const double begin = processor_seconds();
    out.fit = fit_vehicle(model, {data}, options);
    seconds.push_back(processor_seconds() - begin);
  }
  std::sort(seconds.begin(), seconds.end());
  out.seconds = seconds[kRepeats / 2];
  return out;
}

void bench(Eigen::Index rows) {
  const Model model = parse_model_file(kBenchCar, "bench.yaml");
  const Dataset data = long_drive(rows);
  using Structure = VehicleFitOptions::Structure;
  double plain = 0.0;
  for (const auto& [name, structure] : {std::pair{"ignored", Structure::ignored},
                                        {"as-written", Structure::as_written},
                                        {"auto", Structure::automatic}}) {
    const Timed run = timed(model, data, structure);
    if (structure == Structure::ignored) plain = run.seconds;
    std::printf("%td rows, --structure %-10s %.3f s, %.2f times the plain fit;", rows, name,
                run.seconds, run.seconds / plain);
    for (const EstimatedParameter& p : run.fit.parameters) {
      if (!p.fixed && p.name.size() == 2)
        std::printf(" %s %.4g +- %.2g", p.name.c_str(), p.value, p.se);
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace identikal

int main(int argc, char** argv) {
  const long rows = argc > 1 ? std::atol(argv[1]) : 8800;
  if (argc > 2 || rows < 200) {
    std::fputs("usage: structure_bench [ROWS], 200 or more\n", stderr);
    return 2;
  }
  identikal::bench(rows);
}
