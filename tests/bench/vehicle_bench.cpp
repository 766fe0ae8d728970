// How long does a vehicle fit take? Prints JSON for against_scipy.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include "identify/model/model_file.h"
#include "identify/vehicle/search.h"
#include "identify/vehicle/starts.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace identikal {
namespace {

template <typename Run>
double seconds_of(Run&& run, int repeats) {
  double best = 1e300;
  for (int i = 0; i < repeats; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    run();
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    best = std::min(best, spent.count());
  }
  return best;
}

struct Fit {
  VehicleParameters<double> start;
  VehicleProblem problem;
  VehicleOptimum best;
};

/// From the project's own start, made by equation error.
Fit fit(const VehicleRun& run, const VehicleUnknowns& unknowns) {
  Fit out;
  out.start = vehicle_starts(run, unknowns, 0, 1).front();
  out.problem = make_vehicle_problem(run, unknowns, demand_of(unknowns, out.start));
  out.best = maximise_likelihood(out.problem, coordinates_of(out.problem, out.start), {});
  return out;
}

std::string listed(const VehicleParameters<double>& p) {
  std::string out;
  for (const VehicleParameter parameter :
       {kYawInertia, kCf, kCr, kInverseSaturationFront, kInverseSaturationRear, kSteeringOffset,
        kBiasR, kBiasVy, kMountingAngle}) {
    const double value = in_user_terms(parameter, p[parameter]).value;
    // A straight axle has no largest force, which JSON cannot say.
    out += fmt::format("{}{:.10g}", out.empty() ? "" : ", ", std::min(value, 1e9));
  }
  return out;
}

void bench(const char* model_path, const char* data_path) {
  const Model model = read_model_file(model_path);
  const Dataset data = make_dataset(read_csv(data_path), model.time, model.inputs, model.outputs);
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleRun run = usable_run(model, {data});
  Fit found;
  const double fit_s = seconds_of([&] { found = fit(run, unknowns); }, 3);
  const double search_s = seconds_of([&] { search_vehicle(run, unknowns, {}); }, 1);
  const VehicleProblem& problem = found.problem;
  const VehicleOptimum& best = found.best;
  Eigen::VectorXd e;
  LeastSquares::RowMatrix J;
  const double simulation_s = seconds_of([&] { output_error(problem, best.z, e, nullptr); }, 20);
  const double gradient_s = seconds_of([&] { output_error(problem, best.z, e, &J); }, 20);
  Fit of_part;
  std::string growth;
  for (const Eigen::Index part : {8, 4, 2, 1}) {
    const VehicleRun shorter = usable_run(model, {first_samples(data, data.size() / part)});
    const double s = seconds_of([&] { of_part = fit(shorter, unknowns); }, 3);
    growth += fmt::format("{}[{}, {:.4f}, {}]", growth.empty() ? "" : ", ", shorter.used, s,
                          of_part.best.evaluations);
  }
  fmt::print(
      "{{\"fit_s\": {}, \"search_s\": {}, \"evaluations\": {}, \"simulation_s\": {}, "
      "\"gradient_s\": {}, \"start\": [{}], \"value\": [{}], \"sd\": [{}, {}], \"vy0\": {}, "
      "\"r0\": {}, \"converged\": {}, \"growth\": [{}]}}\n",
      fit_s, search_s, best.evaluations, simulation_s, gradient_s, listed(found.start),
      listed(parameters_at(problem, best.z)), best.sd[0], best.sd[1],
      best.z[problem.state_of(0)] * kStateScale[0],
      best.z[problem.state_of(0) + 1] * kStateScale[1], best.converged, growth);
}

/// The recording with rows missing so often that it falls into this many segments, or more.
Dataset in_segments(const Dataset& data, Eigen::Index segments) {
  constexpr Eigen::Index kMissing = 6;
  const Eigen::Index period = data.size() / segments;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index t = 0; t < data.size(); ++t) {
    if (t < kMissing || t % period >= kMissing) rows.push_back(t);
  }
  Dataset out = data;
  out.time = Eigen::VectorXd(data.time(rows));
  out.u = Eigen::MatrixXd(data.u(Eigen::all, rows));
  out.y = Eigen::MatrixXd(data.y(Eigen::all, rows));
  return out;
}

/// Several copies one after the other, each in as many segments as seconds: time against their number.
void bench_segments(const char* model_path, const char* data_path) {
  Model model = read_model_file(model_path);
  as_vehicle(model).max_gap = 0.0;
  const Dataset data = make_dataset(read_csv(data_path), model.time, model.inputs, model.outputs);
  const double seconds = data.time[data.size() - 1] - data.time[0];
  const Dataset cut = in_segments(data, static_cast<Eigen::Index>(seconds / 1.2));
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  for (const std::size_t copies : {1u, 2u, 4u, 8u, 16u}) {
    const VehicleRun run = usable_run(model, std::vector<Dataset>(copies, cut));
    Fit found;
    const double s = seconds_of([&] { found = fit(run, unknowns); }, copies > 4 ? 1 : 3);
    fmt::print("{} segments, {} rows: {:.4f} s, {} evaluations\n", run.segments.size(), run.used, s,
               found.best.evaluations);
  }
}

}  // namespace
}  // namespace identikal

int main(int argc, char** argv) {
  const bool segments = argc == 4 && std::strcmp(argv[3], "segments") == 0;
  if (argc != 3 && !segments) {
    std::fputs("usage: vehicle_bench MODEL RECORDING [segments]\n", stderr);
    return 2;
  }
  segments ? identikal::bench_segments(argv[1], argv[2]) : identikal::bench(argv[1], argv[2]);
}
