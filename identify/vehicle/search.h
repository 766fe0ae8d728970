// Which car fits the recordings best, wherever the search begins?
#pragma once

#include <functional>
#include <vector>

#include "identify/vehicle/output_error.h"

namespace identikal {

struct VehicleSearchOptions {
  int starts = 5;    ///< tried besides the equation-error one (identify/vehicle/starts.h)
  int searched = 3;  ///< of all starts, those with the best likelihood
  unsigned long long seed = 1;
  int iterations = 0;   ///< at most, of each local search; 0: as SolverOptions have it
  bool robust = false;  ///< noise of Student's distribution (identify/vehicle/output_error.h)
  std::function<bool(int iteration, double objective)> progress;  ///< return false to stop
};

struct VehicleSearch {
  VehicleProblem problem;
  VehicleOptimum best;        ///< its z is empty when the simulation diverges from every start
  int starts = 0;             ///< local searches
  int starts_at_optimum = 0;  ///< of them, how many ended at the best
  int iterations = 0, evaluations = 0;
  std::vector<std::vector<double>> paths;  ///< log-likelihood by iteration, one local search each
};

/// Multi-start: ranks the starts by likelihood, searches locally from the best few and keeps the
/// best optimum.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const VehicleSearch found = search_vehicle(run, vehicle_unknowns(car), {});
///     const VehicleParameters<double> p = parameters_at(found.problem, found.best.z);
///
/// @param run    must outlive the result
/// @param known  a car to begin at besides, e.g. the best one of a model with fewer free
///   parameters; may be null
VehicleSearch search_vehicle(const VehicleRun& run, const VehicleUnknowns& unknowns,
                             const VehicleSearchOptions& options,
                             const VehicleParameters<double>* known = nullptr);

}  // namespace identikal
