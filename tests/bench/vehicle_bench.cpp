// How long does a vehicle fit take? Prints JSON for against_scipy.py.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include <fmt/format.h>

#include "identify/model_file.h"
#include "identify/vehicle_problem.h"
#include "lib/csv.h"
#include "lib/dataset.h"

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

VehicleOptimum fit(const VehicleProblem& problem) {
  return maximise_likelihood(problem, coordinates_of(problem, problem.unknowns.value), {});
}

void bench(const char* model_path, const char* data_path) {
  const ModelFile model = read_model_file(model_path);
  const Dataset data = make_dataset(read_csv(data_path), model.time, model.inputs, model.outputs);
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleRun run = usable_run(model, {data});
  const VehicleProblem problem =
      make_vehicle_problem(run, unknowns, demand_of(unknowns, unknowns.value));
  VehicleOptimum best;
  const double fit_s = seconds_of([&] { best = fit(problem); }, 3);
  const VehicleParameters<double> p = parameters_at(problem, best.z);
  Eigen::VectorXd e;
  LeastSquares::RowMatrix J;
  const double simulation_s = seconds_of([&] { output_error(problem, best.z, e, nullptr); }, 20);
  const double gradient_s = seconds_of([&] { output_error(problem, best.z, e, &J); }, 20);
  std::string values, growth;
  for (const VehicleParameter parameter : {kYawInertia, kCf, kCr, kSofteningFront, kSofteningRear,
                                           kSteeringOffset, kBiasR, kBiasVy, kMountingAngle}) {
    values += fmt::format("{}{:.10g}", values.empty() ? "" : ", ",
                          in_user_terms(parameter, p[parameter]).value);
  }
  for (const Eigen::Index part : {8, 4, 2, 1}) {
    const VehicleRun shorter = usable_run(model, {first_samples(data, data.size() / part)});
    const VehicleProblem smaller = make_vehicle_problem(shorter, unknowns, problem.demand);
    const double s = seconds_of([&] { fit(smaller); }, 1);
    growth += fmt::format("{}[{}, {:.4f}]", growth.empty() ? "" : ", ", shorter.used, s);
  }
  fmt::print(
      "{{\"fit_s\": {}, \"evaluations\": {}, \"simulation_s\": {}, \"gradient_s\": {}, \"value\": "
      "[{}], "
      "\"sd\": [{}, {}], \"vy0\": {}, \"r0\": {}, \"converged\": {}, \"growth\": [{}]}}\n",
      fit_s, best.evaluations, simulation_s, gradient_s, values, best.sd[0], best.sd[1],
      best.z[problem.state_of(0)] * kStateScale[0],
      best.z[problem.state_of(0) + 1] * kStateScale[1], best.converged, growth);
}

}  // namespace
}  // namespace identikal

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: vehicle_bench MODEL RECORDING\n", stderr);
    return 2;
  }
  identikal::bench(argv[1], argv[2]);
}
