#include "identify/noise/internal/shot_starts.h"

#include <algorithm>
#include <cmath>

#include "identify/filter/simulated_fit.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/internal/scattered_start.h"
#include "identify/shooting/shooting.h"
#include "lib/base/constants.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

constexpr int kCandidates = 30;      // of each start but the first
constexpr double kFarBehind = 10.0;  // log-likelihood: from there no search comes to the best

// The file's values; and of every other start, places scattered about them, every second time half
// of them not far away: where many unknowns may be decades off, no other place is as good by chance.
std::vector<std::vector<ParameterSet>> candidates_about(const ParameterSet& parameters, int starts,
                                                        std::uint64_t seed) {
  Random random(seed);
  std::vector<std::vector<ParameterSet>> out = {{parameters}};
  for (int s = 1; s < starts; ++s) {
    out.emplace_back();
    for (int k = 0; k < kCandidates; ++k) {
      const bool near = s % 2 == 1 && k % 2 == 0;
      out.back().push_back(near ? start_nearby(parameters, random)
                                : scattered_start(parameters, random));
    }
  }
  return out;
}

double log_likelihood_of(double loss, double values) {
  return -loss - 0.5 * values * (1.0 + kLogTwoPi);
}

std::size_t lowest(const std::vector<ShootingEnd>& ends) {
  const auto less = [](const auto& a, const auto& b) { return a.loss < b.loss; };
  return static_cast<std::size_t>(std::min_element(ends.begin(), ends.end(), less) - ends.begin());
}

// ShootingEnd::loss by the model's own simulation.
double simulated_loss(const Model& model, const std::vector<Dataset>& recordings,
                      const ParameterSet& at) {
  const Eigen::ArrayXd known = known_output_sd(model).array();
  const Eigen::Index outputs = recordings[0].y.rows();
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(outputs), counts = squares;
  for (const Dataset& data : recordings) {
    Eigen::ArrayXXd errors = simulation_errors(model, at, data).array();
    const bool weighted = known.size() > 0 && data.noise_scale.size() > 0;
    if (weighted) errors /= data.noise_scale.array();
    const auto measured = errors == errors;
    squares += measured.select(errors.square(), 0.0).rowwise().sum();
    counts += measured.cast<double>().rowwise().sum();
  }
  const Eigen::ArrayXd mean = (counts > 0.0).select(squares / counts.max(1.0), 1.0);
  const double out =
      known.size() > 0 ? 0.5 * (squares / known.square()).sum() : (0.5 * counts * mean.log()).sum();
  return std::isnan(out) ? kInfinity : out;
}

// The lowest that the model's own simulation, with its own control of the integration, does not
// contradict: steps that do for the slow part of a motion may be far too long for another part of it.
std::size_t lowest_confirmed(const Model& model, const std::vector<Dataset>& recordings,
                             std::vector<ShootingEnd>& ends) {
  constexpr double kContradicted = 1.0;
  while (true) {
    const std::size_t best = lowest(ends);
    const double claimed = ends[best].loss;
    if (!std::isfinite(claimed)) return best;
    const double excess = simulated_loss(model, recordings, ends[best].parameters) - claimed;
    if (!(excess > kContradicted)) return best;
    const int there = ends[best].same_as;
    for (ShootingEnd& end : ends) {
      if (end.same_as == there) end.loss += excess;
    }
    if (lowest(ends) == best) return best;
  }
}

}  // namespace

std::optional<ShotStarts> shot_starts(const RecordingsLikelihood& likelihood,
                                      const ParameterSet& parameters,
                                      const FactorCoordinates& factors, int starts,
                                      const NoiseMlOptions& options) {
  const Model& model = likelihood.model();
  if (!allows_multiple_shooting(model, likelihood.recordings())) return std::nullopt;
  if (!names_with_priors(parameters).empty()) return std::nullopt;
  ShotStarts out;
  ShootingOptions shooting;
  shooting.threads = options.threads;
  const double values = likelihood.samples();
  shooting.progress = [&](int start, int iterations, double loss) {
    out.stopped = options.progress &&
                  !options.progress(start + 1, iterations, log_likelihood_of(loss, values));
    return !out.stopped;
  };
  std::vector<ShootingEnd> ends = shoot(
      model, likelihood.recordings(), candidates_about(parameters, starts, options.seed), shooting);
  const std::size_t best = lowest_confirmed(model, likelihood.recordings(), ends);
  if (!std::isfinite(ends[best].loss)) return std::nullopt;
  const auto add_place = [&](std::size_t i) {
    out.places.push_back(factors.from(coordinates(ends[i].parameters)));
    return static_cast<int>(out.places.size()) - 1;
  };
  const int best_same = ends[best].same_as;
  std::vector<int> place(ends.size(), -1);  // by the first start that has led there
  place[static_cast<std::size_t>(best_same)] = add_place(best);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const ShootingEnd& end = ends[i];
    int& there = place[static_cast<std::size_t>(end.same_as)];
    const bool leads = end.same_as == static_cast<int>(i);
    if (there < 0 && leads && end.loss - ends[best].loss < kFarBehind) there = add_place(i);
    out.place_of_start.push_back(there);
    out.behind.push_back(end.loss - ends[best].loss);
    out.converged.push_back(end.converged);
    out.iterations += end.iterations;
    out.evaluations += end.evaluations;
    if (end.same_as != best_same || end.stages.empty()) continue;
    if (out.by_path++ == 0) out.stages = end.stages.size();
  }
  return out;
}

}  // namespace identikal
