#include "identify/vehicle/search.h"

#include <algorithm>

#include "identify/vehicle/starts.h"

namespace identikal {
namespace {

constexpr std::size_t kOptimised = 3;  // of the starts, those with the best likelihood
constexpr double kSameVehicle = 0.01;  // in log-likelihood
constexpr int kBriefIterations = 12;
constexpr double kPromising = 0.01;  // in log-likelihood per sample behind the best
constexpr double kTooStiffForSteps =
    1.6;  // decay rate over what the integration steps were made for

VehicleProblem problem_for(const VehicleRun& run, const VehicleUnknowns& unknowns,
                           const VehicleParameters<double>& p) {
  return make_vehicle_problem(run, unknowns, demand_of(unknowns, p));
}

}  // namespace

VehicleSearch search_vehicle(const VehicleRun& run, const VehicleUnknowns& unknowns,
                             const VehicleSearchOptions& options,
                             const VehicleParameters<double>* known) {
  std::vector<VehicleParameters<double>> starts =
      vehicle_starts(run, unknowns, options.starts, options.seed);
  if (known != nullptr) starts.push_back(*known);
  // Any start may be far off; integration steps are made for the least stiff, and remade for the
  // answer.
  VehicleSearch out;
  const auto softest =
      std::min_element(starts.begin(), starts.end(), [](const auto& p, const auto& q) {
        return decay_rate_times_speed(linear_car(p)) < decay_rate_times_speed(linear_car(q));
      });
  out.problem = problem_for(run, unknowns, *softest);
  out.problem.robust = options.robust;

  struct Candidate {
    Eigen::VectorXd z;
    double log_likelihood;
  };
  std::vector<Candidate> candidates;
  for (const VehicleParameters<double>& p : starts) {
    const Eigen::VectorXd z = coordinates_of(out.problem, p);
    Eigen::VectorXd e;
    if (!output_error(out.problem, z, e, nullptr)) continue;
    candidates.push_back({z, log_likelihood(out.problem, z, e, noise_sd(out.problem, e))});
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.log_likelihood > b.log_likelihood;
  });
  if (unknowns.free.empty()) candidates.resize(std::min<std::size_t>(candidates.size(), 1));
  if (candidates.size() > kOptimised) candidates.resize(kOptimised);

  SolverOptions solver;
  solver.progress = options.progress;
  const auto climb = [&](const Eigen::VectorXd& from, const SolverOptions& how) {
    VehicleOptimum optimum = maximise_likelihood(out.problem, from, how);
    out.iterations += optimum.iterations;
    out.evaluations += optimum.evaluations;
    return optimum;
  };
  // A short climb tells which starts are worth a long one: the others may crawl along a valley.
  SolverOptions brief = solver;
  brief.max_iterations = kBriefIterations;
  std::vector<VehicleOptimum> summits;
  double highest = -std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates) {
    summits.push_back(climb(candidate.z, brief));
    highest = std::max(highest, summits.back().log_likelihood);
  }
  const double promising = highest - kPromising * static_cast<double>(std::max<Eigen::Index>(
                                                      1, out.problem.residuals()));
  out.best.message = "the simulation diverges from every start";
  for (VehicleOptimum& summit : summits) {
    if (summit.log_likelihood > promising && !summit.converged) {
      std::vector<double> path = std::move(summit.path);
      summit = climb(summit.z, solver);
      if (!summit.path.empty()) path.insert(path.end(), summit.path.begin() + 1, summit.path.end());
      summit.path = std::move(path);
    }
    if (!summit.path.empty()) out.paths.push_back(summit.path);
    if (summit.log_likelihood > out.best.log_likelihood) out.best = summit;
  }
  out.starts = static_cast<int>(summits.size());
  for (const VehicleOptimum& summit : summits) {
    if (summit.log_likelihood > out.best.log_likelihood - kSameVehicle) ++out.agree;
  }
  if (out.best.z.size() == 0) return out;

  const VehicleParameters<double> p = parameters_at(out.problem, out.best.z);
  if (decay_rate_times_speed(linear_car(p)) > kTooStiffForSteps * out.problem.demand.decay_rate) {
    out.problem = problem_for(run, unknowns, p);
    out.problem.robust = options.robust;
    out.best = maximise_likelihood(out.problem, out.best.z, solver);
    out.paths.push_back(out.best.path);
    out.iterations += out.best.iterations;
    out.evaluations += out.best.evaluations;
  }
  return out;
}

}  // namespace identikal
