#include "identify/vehicle/search.h"

#include <algorithm>

#include "identify/vehicle/starts.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

constexpr double kSameOptimum = 0.01;  // in log-likelihood
constexpr int kBriefIterations = 12;
constexpr double kPromising = 0.01;  // in log-likelihood per sample behind the best
// Decay rate over what the integration steps were made for.
constexpr double kTooStiffForSteps = 1.6;

VehicleProblem problem_for(const VehicleRun& run, const VehicleUnknowns& unknowns,
                           const VehicleParameters<double>& p) {
  return make_vehicle_problem(run, unknowns, demand_of(unknowns, p));
}

struct Candidate {
  Eigen::VectorXd z;
  double log_likelihood;
};

/// The starts with the highest likelihood, so many; those from which the simulation diverges are left out.
std::vector<Candidate> best_candidates(const VehicleProblem& problem,
                                       const std::vector<VehicleParameters<double>>& starts,
                                       int searched) {
  std::vector<Candidate> out;
  for (const VehicleParameters<double>& p : starts) {
    const Eigen::VectorXd z = coordinates_of(problem, p);
    Eigen::VectorXd e;
    if (!output_error(problem, z, e, nullptr)) continue;
    out.push_back({z, log_likelihood(problem, z, e, noise_sd(problem, e))});
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
    return a.log_likelihood > b.log_likelihood;
  });
  const std::size_t most =
      problem.unknowns.free.empty() ? 1 : static_cast<std::size_t>(std::max(1, searched));
  if (out.size() > most) out.resize(most);
  return out;
}

/// A local search of every candidate; a brief one shows which are worth a long one, as the others
/// may crawl along a valley.
std::vector<VehicleOptimum> local_optima(const std::vector<Candidate>& candidates,
                                         const SolverOptions& solver, VehicleSearch& search) {
  const auto local_search = [&](const Eigen::VectorXd& from, const SolverOptions& how) {
    VehicleOptimum optimum = maximise_likelihood(search.problem, from, how);
    search.iterations += optimum.iterations;
    search.evaluations += optimum.evaluations;
    return optimum;
  };
  SolverOptions brief = solver;
  brief.max_iterations = kBriefIterations;
  std::vector<VehicleOptimum> out;
  double highest = -kInfinity;
  for (const Candidate& candidate : candidates) {
    out.push_back(local_search(candidate.z, brief));
    highest = std::max(highest, out.back().log_likelihood);
  }
  const double promising = highest - kPromising * static_cast<double>(std::max<Eigen::Index>(
                                                      1, search.problem.residuals()));
  for (VehicleOptimum& optimum : out) {
    if (optimum.converged || !(optimum.log_likelihood > promising)) continue;
    std::vector<double> path = std::move(optimum.path);
    optimum = local_search(optimum.z, solver);
    if (!optimum.path.empty())
      path.insert(path.end(), optimum.path.begin() + 1, optimum.path.end());
    optimum.path = std::move(path);
  }
  return out;
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

  SolverOptions solver;
  if (options.iterations > 0) solver.max_iterations = options.iterations;
  solver.progress = options.progress;
  const std::vector<VehicleOptimum> optima =
      local_optima(best_candidates(out.problem, starts, options.searched), solver, out);
  out.best.message = "the simulation diverges from every start";
  for (const VehicleOptimum& optimum : optima) {
    if (!optimum.path.empty()) out.paths.push_back(optimum.path);
    if (optimum.log_likelihood > out.best.log_likelihood) out.best = optimum;
  }
  out.starts = static_cast<int>(optima.size());
  for (const VehicleOptimum& optimum : optima) {
    if (optimum.log_likelihood > out.best.log_likelihood - kSameOptimum) ++out.starts_at_optimum;
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
