#include "identify/noise/internal/several_starts.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/parameter_prior.h"
#include "identify/model/row_order.h"
#include "identify/noise/internal/common_scale.h"
#include "identify/noise/internal/log_coordinates.h"
#include "identify/noise/internal/profiled_noise.h"
#include "identify/noise/internal/promising_starts.h"
#include "identify/noise/internal/root_coordinates.h"
#include "identify/noise/internal/scattered_start.h"
#include "identify/noise/internal/shot_starts.h"
#include "identify/noise/internal/zero_noise.h"
#include "identify/shooting/shooting.h"
#include "lib/base/random.h"
#include "solvers/covariance.h"
#include "solvers/observed_newton.h"
#include "solvers/parallel.h"
#include "solvers/trust_region.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSameMaximum = 1e-3;  // log-likelihoods closer than this are the same maximum
constexpr double kNegligible = 1e-4;   // gain in log-likelihood that no search goes on for
constexpr int kDoubted = 5;            // starts where there is a doubt
constexpr int kSearchRounds = 4;       // of looking around the best
constexpr int kApproach = 500;         // iterations towards a simulation's least squares
constexpr int kFromShot = 60;          // behind it, from where multiple shooting had found them
constexpr int kByCurvature = 40, kCurvatureSteps = 60;  // unknowns at most, steps
constexpr double kPlateau = 1e-12;  // expected gain that is none: slopes of a plateau are as small

// Where a variance is as good as zero, what it drives may lie anywhere, and the likelihood rises
// elsewhere on that plateau. What changes nothing when it moves by its own size does not matter.
bool every_coordinate_matters(const LikelihoodPoint& at) {
  constexpr double kNothing = 2.0 * kNegligible;
  const VectorXd size = at.x.cwiseAbs().cwiseMax(1e-300);
  const VectorXd weight = at.information.diagonal().array() * size.array().square();
  for (Index i = 0; i < at.x.size(); ++i) {
    if (at.x[i] != 0.0 && !(weight[i] > kNothing)) return false;
  }
  return true;
}

// Of a regression, SolverOptions::flat, and the gain still expected where the last digits are
// found.
constexpr double kFlatSlopes = 1e-13, kLastDigits = 1e-19;

SolverOptions search_options() {
  SolverOptions out;
  out.decrement_tolerance = 1e-13;
  out.acceptable_decrement = kNegligible;
  out.learn_from_afar = true;
  return out;
}

// Sizes of noise without which a sum of squares is left.
std::optional<NoiseScales> scales_to_profile(const Model& model) {
  std::optional<NoiseScales> out = noise_scales(model);
  if (out && out->follow_prediction) out.reset();
  return out;
}

// From beside the end, does a search come back to it?
bool nothing_near_is_higher(const LikelihoodProblem& problem, const LikelihoodPoint& end) {
  constexpr double kBeside = 0.5;  // standard errors, each coordinate by itself
  Random random(1);
  for (int k = 0; k < 2; ++k) {
    VectorXd x = end.x;
    for (Index i = 0; i < x.size(); ++i) {
      const double information = end.information(i, i);
      if (information > 0.0) x[i] += kBeside * random.normal() / std::sqrt(information);
    }
    const Solution back =
        maximise(problem, x.cwiseMax(problem.lower).cwiseMin(problem.upper), search_options());
    if (back.summary.objective > end.L + kSameMaximum) return false;
  }
  return true;
}

bool is_other_maximum(const LikelihoodProblem& problem, const Solution& solution) {
  if (!solution.summary.usable()) return false;
  const std::optional<LikelihoodPoint> end = point_at(problem, solution.x);
  return end && every_coordinate_matters(*end) && nothing_near_is_higher(problem, *end);
}

// Is nothing unknown but sizes of noise?
bool only_noise_is_free(const Model& model) {
  if (!is_linear(model)) return false;
  const std::vector<StateSpace> by = model_derivatives(as_linear(model), model.parameters);
  return std::all_of(by.begin(), by.end(), changes_only_noise);
}

// Does the end of the first search leave a doubt that it is the only maximum? Of variances alone,
// all of them well above zero, it hardly ever is not.
bool is_doubted(const Model& model, const LikelihoodProblem& problem,
                const std::optional<LikelihoodPoint>& end) {
  if (!end || !only_noise_is_free(model)) return true;
  if ((end->x.array() <= problem.lower.array()).any() ||
      (end->x.array() >= problem.upper.array()).any()) {
    return true;
  }
  if (!every_coordinate_matters(*end)) return true;
  for (Index i = 0; i < end->x.size(); ++i) {
    if (may_be_zero(problem, *end, i)) return true;
  }
  return false;
}

// One search, in the factors' coordinates.
struct Search {
  Solution solution;
  std::vector<RootsOnCircle> on_circle;
  std::vector<double> path;
  bool told_to_stop = false;
  bool arrived = false;  // beside the maximum that is known
};

class Searches {
 public:
  // @param squares  without noise of unknown size a simulation's likelihood is its squares: nothing
  //   counts beside them
  Searches(const Model& model, const FactorCoordinates& factors, const NoiseMlOptions& options,
           std::vector<VectorXd> starts, double samples, bool shot, bool squares = true)
      : options_(options),
        most_(shot ? kFromShot : kApproach),
        starts_(std::move(starts)),
        exact_slopes_(rows_have_no_order(model, model.parameters)),
        scales_(squares ? scales_to_profile(model) : std::nullopt),
        known_(squares && known_output_sd(model).size() > 0),
        logs_(logarithmic_coordinates(model, scales_ ? scales_->scales : std::vector<Index>())),
        roots_(model, factors),
        scale_(model, factors, samples),
        samples_(samples) {}

  // @param known  a maximum that need not be found twice
  Search run(const LikelihoodProblem& problem, int start,
             const std::optional<LikelihoodPoint>& known) {
    Search out;
    SolverOptions solver = search_options();
    if (exact_slopes_) {
      solver.flat = kFlatSlopes;
      solver.decrement_tolerance = kLastDigits;
    }
    solver.max_iterations = std::min(solver.max_iterations, most_);
    if (options_.iterations > 0) solver.max_iterations = options_.iterations;
    solver.progress = [&](int iteration, double L) {
      out.path.push_back(L);
      const std::lock_guard<std::mutex> lock(mutex_);
      stopped_ = stopped_ || (options_.progress && !options_.progress(start + 1, iteration, L));
      out.told_to_stop = stopped_;
      return !stopped_ && !out.arrived;
    };
    LikelihoodProblem watched = problem;
    watched.evaluate = [&](const VectorXd& x, double& L, VectorXd* gradient,
                           MatrixXd* information) {
      const bool defined = problem.evaluate(x, L, gradient, information);
      out.arrived = defined && known && is_beside(*known, x, L);
      return defined;
    };
    const VectorXd from = starts_[start].cwiseMax(problem.lower).cwiseMin(problem.upper);
    double at_start = std::numeric_limits<double>::quiet_NaN();
    const bool approaches = scales_ || known_ || !logs_.entries.empty();
    if (approaches) problem.evaluate(from, at_start, nullptr, nullptr);
    const SolverSummary approach = approached(watched, from, solver, out.solution);
    if (approach.termination == Termination::stopped) {
      out.solution.summary.initial_objective = at_start;
      return out;
    }
    if (roots_.any()) {
      within_roots(watched, from, solver, out);
    } else {
      out.solution = maximise(watched, out.solution.x, solver);
      add_effort(approach, out.solution.summary);
    }
    leave_zero(problem, watched, from, solver, out);
    SolverSummary& summary = out.solution.summary;
    if (approaches) summary.initial_objective = at_start;
    out.path.insert(out.path.begin(), summary.initial_objective);
    return out;
  }

  // Where scoring has come no further, by the curvature that the likelihood has there; with no more
  // evaluations than all searches have taken.
  void go_on_by_curvature(const LikelihoodProblem& problem, int evaluations, Search& search) {
    Solution& end = search.solution;
    const Termination how = end.summary.termination;
    const bool short_of = how == Termination::no_progress || how == Termination::iteration_limit;
    if (!short_of || options_.iterations > 0 || stopped_ || end.x.size() > kByCurvature) return;
    SolverOptions solver = search_options();
    solver.max_iterations =
        std::min(kCurvatureSteps, evaluations / (2 * static_cast<int>(end.x.size()) + 2));
    solver.progress = [&](int iteration, double L) {
      stopped_ = stopped_ || (options_.progress && !options_.progress(1, iteration, L));
      return !stopped_.load();
    };
    const LikelihoodProblem inside = roots_.problem(problem);
    const VectorXd from = roots_.from(end.x).cwiseMax(inside.lower).cwiseMin(inside.upper);
    Solution top = maximise_by_curvature(inside, from, solver);
    top.summary.initial_objective = end.summary.initial_objective;
    add_effort(end.summary, top.summary);
    const double gain = top.summary.objective - end.summary.objective;
    if (!(gain > (top.summary.usable() ? -kSameMaximum : 0.0))) return;
    search.on_circle = roots_.on_circle(top.x);
    end = {roots_.to(top.x).cwiseMax(problem.lower).cwiseMin(problem.upper), top.summary};
  }

  // Are others chosen where a search has ended?
  bool look_around() const { return roots_.any() && roots_.hold_all_dynamics(); }
  // Where roots must stay outside the unit circle, the other starts are the most promising of many.
  // @param known  where the best search so far has ended
  // @return evaluations of the likelihood
  int choose_others(const LikelihoodProblem& problem, const VectorXd& known, int round) {
    if (!look_around()) return 0;
    if (round == 0) more_ = static_cast<int>(starts_.size()) - 1, starts_.resize(1);
    const PromisingStarts found =
        promising_starts(roots_.problem(problem), roots_, scale_, roots_.from(known), more_,
                         options_.seed + static_cast<std::uint64_t>(round));
    for (const VectorXd& z : found.z) starts_.push_back(roots_.to(z));
    return found.evaluations;
  }
  std::size_t size() const { return starts_.size(); }
  // Others in place of the scattered ones.
  void begin_at(const std::vector<VectorXd>& places) {
    if (places.empty()) return;
    starts_.resize(1);
    add(places);
  }
  void add(const std::vector<VectorXd>& places) {
    starts_.insert(starts_.end(), places.begin(), places.end());
  }

  bool stopped() const { return stopped_; }

 private:
  static void add_effort(const SolverSummary& of, SolverSummary& to) {
    to.iterations += of.iterations;
    to.evaluations += of.evaluations;
  }

  // On from standard deviations of zero that are no maximum.
  void leave_zero(const LikelihoodProblem& problem, const LikelihoodProblem& watched,
                  const VectorXd& from, const SolverOptions& solver, Search& out) const {
    constexpr int kMost = 3;
    if (roots_.any()) return;
    for (int k = 0; k < kMost && !out.arrived && !out.told_to_stop; ++k) {
      const SolverSummary before = out.solution.summary;
      if (!before.usable()) return;
      const std::optional<VectorXd> higher = off_zero(problem, from, out.solution.x);
      if (!higher) return;
      out.solution = maximise(watched, *higher, solver);
      out.solution.summary.initial_objective = before.initial_objective;
      add_effort(before, out.solution.summary);
    }
  }

  // Where roots must stay outside the unit circle: by partial autocorrelations, and what is left of
  // the way by the coefficients themselves, unless it has ended on the circle.
  void within_roots(const LikelihoodProblem& problem, const VectorXd& from,
                    const SolverOptions& solver, Search& out) const {
    const LikelihoodProblem inside = roots_.problem(problem);
    std::optional<SolverSummary> effort;  // so far
    const auto search = [&](const LikelihoodProblem& of, const VectorXd& start) {
      Solution end = maximise(of, start.cwiseMax(of.lower).cwiseMin(of.upper), solver);
      if (effort) {
        end.summary.initial_objective = effort->initial_objective;
        add_effort(*effort, end.summary);
      }
      effort = end.summary;
      return end;
    };
    const auto is_over = [](const Solution& end) {
      return end.summary.termination == Termination::start_undefined ||
             end.summary.termination == Termination::stopped;
    };
    // To the circle, where that is where it leads.
    const auto draw = [&](Solution& end) {
      const VectorXd drawn = roots_.drawn_to_circle(inside, end.x);
      out.arrived = false;  // what was looked at on the circle is no place of the search
      if (roots_.on_circle(drawn).empty()) return false;
      end = search(roots_.held_to_circle(inside, drawn), drawn);
      return true;
    };
    Solution end = search(inside, roots_.from(from));
    if (!is_over(end) && !draw(end)) {
      const Solution by_coefficients = search(problem, roots_.to(end.x));
      end = {roots_.from(by_coefficients.x), by_coefficients.summary};
      if (is_over(by_coefficients) || !draw(end)) {
        out.solution = by_coefficients;
        return;
      }
    }
    out.on_circle = roots_.on_circle(end.x);
    out.solution = {roots_.to(end.x).cwiseMax(problem.lower).cwiseMin(problem.upper), end.summary};
  }

  // Within half a standard error, as the quadratic about the maximum has it.
  static bool is_beside(const LikelihoodPoint& known, const VectorXd& x, double L) {
    constexpr double kNear = 0.25;
    const VectorXd d = x - known.x;
    const bool no_higher = L < known.L + kSameMaximum;
    return no_higher && known.L - L < kNear && d.dot(known.information * d) < kNear;
  }

  // What may be decades off by its logarithm. A simulation's start may be far from where its noise
  // means anything: its squares first.
  // @param solution  written: where that ended, with the noise that was left
  SolverSummary approached(const LikelihoodProblem& problem, const VectorXd& from,
                           SolverOptions solver, Solution& solution) const {
    solution.x = from;
    if (!scales_ && !known_ && logs_.entries.empty()) return {};
    const LikelihoodProblem by_logs = logs_.problem(problem);
    const VectorXd z = logs_.from(from);
    if (scales_ || known_) {
      if (options_.iterations == 0) solver.max_iterations = kApproach;
      solver.decrement_tolerance = kPlateau;
      solution =
          known_ ? maximise_of_known_noise(by_logs, z, solver) : least_squares(by_logs, z, solver);
    } else {
      solution = maximise(by_logs, z, solver);
    }
    solution.x = logs_.to(solution.x).cwiseMax(problem.lower).cwiseMin(problem.upper);
    return solution.summary;
  }

  Solution least_squares(const LikelihoodProblem& problem, const VectorXd& from,
                         const SolverOptions& solver) const {
    const std::vector<Index> linear =
        exact_slopes_ ? linear_coordinates(problem, *scales_, from) : std::vector<Index>();
    ProfiledLikelihood profiled(problem, *scales_, from, linear);
    const LikelihoodProblem of_others = profiled.problem();
    Solution out = maximise_from_afar(of_others, profiled.start(), samples_, solver);
    if (exact_slopes_) leave_ridge(of_others, solver, out);
    out.x = profiled.all(out.x);
    return out;
  }

  // Where two terms of a sum have become one, as two exponentials with the same rate, slopes vanish
  // across the ridge, and where they part is found from places near it.
  void leave_ridge(const LikelihoodProblem& problem, const SolverOptions& solver,
                   Solution& solution) const {
    constexpr int kTries = 3;
    constexpr double kBeside = 0.3, kSingular = 1e-8;
    const std::optional<LikelihoodPoint> end = point_at(problem, solution.x);
    if (!end || scaled_inverse(end->information, kSingular)) return;
    Random random(1);
    for (int k = 0; k < kTries; ++k) {
      VectorXd x = end->x;
      for (double& each : x) each *= std::exp(kBeside * random.normal());
      Solution other = maximise_from_afar(
          problem, x.cwiseMax(problem.lower).cwiseMin(problem.upper), samples_, solver);
      if (other.summary.objective > solution.summary.objective + kSameMaximum) {
        add_effort(solution.summary, other.summary);
        solution = std::move(other);
      } else {
        add_effort(other.summary, solution.summary);
      }
    }
  }

  const NoiseMlOptions& options_;
  const int most_;  // iterations
  std::vector<VectorXd> starts_;
  const bool exact_slopes_;            // to rounding: nothing is integrated
  std::optional<NoiseScales> scales_;  // of the noise of a simulation, if it is one
  const bool known_;                   // its noise is known, of a simulation
  LogCoordinates logs_;
  RootCoordinates roots_;
  CommonScale scale_;
  double samples_;
  int more_ = 0;  // starts of a round
  std::mutex mutex_;
  std::atomic<bool> stopped_{false};
};

std::vector<VectorXd> places_to_start(const ParameterSet& parameters,
                                      const FactorCoordinates& factors, int count,
                                      std::uint64_t seed) {
  Random random(seed);
  std::vector<VectorXd> out = {factors.from(coordinates(parameters))};
  for (int s = 1; s < count; ++s) {
    out.push_back(factors.from(coordinates(scattered_start(parameters, random))));
  }
  return out;
}

// A converged end beats an unconverged one unless that one is really higher.
bool is_better(const SolverSummary& than, const SolverSummary& one) {
  if (std::isnan(one.objective)) return false;
  if (std::isnan(than.objective)) return true;
  const double lead = one.objective - than.objective;
  return lead > kSameMaximum ||
         (lead > -kSameMaximum && one.usable() && (!than.usable() || lead > 0.0));
}

// The searches from starts `from` .. count - 1, some at a time.
void run_others(Searches& searches, RecordingsLikelihood& likelihood,
                const LikelihoodProblem& problem, const FactorCoordinates& factors, int threads,
                std::size_t from, const std::optional<LikelihoodPoint>& known,
                std::vector<Search>& all) {
  const auto others = static_cast<int>(all.size() - from);
  const bool cheap = likelihood.is_cheap();
  in_parallel(others, cheap ? 1 : threads, [&](int i) {
    if (searches.stopped()) return;
    const auto start = static_cast<int>(from) + i;
    if (cheap) {
      all[start] = searches.run(problem, start, known);
      return;
    }
    const std::unique_ptr<RecordingsLikelihood> own = likelihood.another();
    const LikelihoodProblem own_by_entries = own->problem();
    all[start] = searches.run(factors.problem(own_by_entries), start, known);
  });
}

// Is a search caught where the model's constraints do not hold?
bool breaks_constraints(const RecordingsLikelihood& likelihood, const ParameterSet& parameters,
                        const FactorCoordinates& factors, const Solution& solution) {
  constexpr double kHolds = 1.0;  // nats that are taken for it
  if (likelihood.model().constraints.empty()) return false;
  const ParameterSet at = with_coordinates(parameters, factors.to(solution.x));
  return likelihood.log_density_beside_data(at) - stated_priors_at(at).value < -kHolds;
}

std::size_t best_of(const std::vector<Search>& all) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (is_better(all[best].solution.summary, all[i].solution.summary)) best = i;
  }
  return best;
}

int evaluations_of(const std::vector<Search>& all) {
  int out = 0;
  for (const Search& search : all) out += search.solution.summary.evaluations;
  return out;
}

// The ends by place become those by start; a place that is far from the best was not searched from.
void count_shots(const ShotStarts& shot, SeveralStarts& out) {
  std::vector<SearchEnd> ends;
  std::vector<double> log_likelihood;
  for (std::size_t s = 0; s < shot.place_of_start.size(); ++s) {
    const int place = shot.place_of_start[s];
    if (!std::isfinite(shot.behind[s])) {
      ++out.undefined;
    } else if (place >= 0) {
      ends.push_back(out.ends[static_cast<std::size_t>(place)]);
      log_likelihood.push_back(out.log_likelihood[static_cast<std::size_t>(place)]);
    } else {
      ends.push_back(shot.converged[s] ? SearchEnd::maximum : SearchEnd::short_of);
      log_likelihood.push_back(out.best.summary.objective - shot.behind[s]);
    }
  }
  out.ends = std::move(ends);
  out.log_likelihood = std::move(log_likelihood);
  out.iterations += shot.iterations;
  out.evaluations += shot.evaluations;
  out.by_path = shot.by_path;
  out.stages = static_cast<int>(shot.stages);
}

}  // namespace

int SeveralStarts::count(SearchEnd end) const {
  return static_cast<int>(std::count(ends.begin(), ends.end(), end));
}

namespace {

// All searches: the first, and more as long as there is a doubt or somebody asked for them.
// @param out  evaluations are added for what chooses places
std::vector<Search> search_all(Searches& searches, RecordingsLikelihood& likelihood,
                               const LikelihoodProblem& problem, const FactorCoordinates& factors,
                               const NoiseMlOptions& options, SeveralStarts& out) {
  std::vector<Search> all;
  all.push_back(searches.run(problem, 0, std::nullopt));
  const auto point_of = [&](const Search& search) {
    const Solution& end = search.solution;
    return end.summary.usable() ? point_at(problem, end.x) : std::nullopt;
  };
  const bool free_choice = options.starts == 0, around = searches.look_around();
  const bool alone = !free_choice && searches.size() == 1 && !around;
  const std::optional<LikelihoodPoint> first = alone ? std::nullopt : point_of(all[0]);
  if (free_choice && !is_doubted(likelihood.model(), problem, first)) return all;
  const bool directed = free_choice && !around && only_noise_is_free(likelihood.model());
  // Where roots must stay outside the unit circle, and of variances at zero, a better maximum is a
  // better place to look around.
  for (int round = 0; round < kSearchRounds && !searches.stopped(); ++round) {
    if (searches.size() == 1 && !around) break;
    const std::size_t before = all.size();
    const std::size_t best = best_of(all);
    const Solution from = all[best].solution;
    if (directed) {
      const std::vector<VectorXd> places = variances_raised(
          problem, best == 0 ? first : point_of(all[best]), likelihood.samples(), round == 0);
      round == 0 ? searches.begin_at(places) : searches.add(places);
    }
    out.evaluations += searches.choose_others(problem, from.x, round);
    all.resize(searches.size());
    run_others(searches, likelihood, problem, factors, options.threads, before, first, all);
    const bool better =
        all[best_of(all)].solution.summary.objective > from.summary.objective + kSameMaximum;
    if (!(around || directed) || !free_choice || !better) break;
  }
  searches.go_on_by_curvature(problem, evaluations_of(all), all[best_of(all)]);
  return all;
}

// Where one of them ended beside the best.
SearchEnd end_of(const Search& search, const SeveralStarts& out, const Searches& searches,
                 const LikelihoodProblem& problem) {
  if (std::abs(search.solution.summary.objective - out.best.summary.objective) < kSameMaximum)
    return SearchEnd::best;
  const bool maximum = !searches.stopped() && is_other_maximum(problem, search.solution);
  return maximum ? SearchEnd::maximum : SearchEnd::short_of;
}

}  // namespace

SeveralStarts search_from_starts(RecordingsLikelihood& likelihood, const ParameterSet& parameters,
                                 const FactorCoordinates& factors, const NoiseMlOptions& options) {
  const LikelihoodProblem by_entries = likelihood.problem();
  const LikelihoodProblem problem = factors.problem(by_entries);
  const int most = options.starts > 0 ? options.starts : kDoubted;
  const std::optional<ShotStarts> shot =
      shot_starts(likelihood, parameters, factors, most, options);
  Searches searches(likelihood.model(), factors, options,
                    shot ? shot->places : places_to_start(parameters, factors, most, options.seed),
                    likelihood.samples(), shot.has_value());
  SeveralStarts out;
  std::vector<Search> all = search_all(searches, likelihood, problem, factors, options, out);
  const Solution& first = all[0].solution;
  out.start_value = first.summary.initial_objective;
  out.best = first;
  out.on_circle = all[0].on_circle;
  std::vector<Search*> defined;
  for (Search& search : all) {
    SolverSummary& summary = search.solution.summary;
    if (summary.termination == Termination::not_called) continue;  // told to stop before
    out.iterations += summary.iterations;
    out.evaluations += summary.evaluations;
    const bool undefined = summary.termination == Termination::start_undefined;
    if (undefined) ++out.undefined;
    if (undefined && all.size() > 1) continue;
    if (&search != &all[0] &&
        breaks_constraints(likelihood, parameters, factors, search.solution)) {
      continue;
    }
    defined.push_back(&search);
    out.paths.push_back(std::move(search.path));
    if (search.arrived && !search.told_to_stop) {
      search.solution = first;
      search.on_circle = all[0].on_circle;
    }
    if (is_better(out.best.summary, summary)) {
      out.best = search.solution;
      out.on_circle = search.on_circle;
    }
  }
  for (const Search* search : defined) {
    out.log_likelihood.push_back(search->solution.summary.objective);
    out.ends.push_back(end_of(*search, out, searches, problem));
    if (out.ends.back() == SearchEnd::best && search->solution.summary.usable())
      out.best_ends.push_back(search->solution.x);
  }
  if (shot && defined.size() == all.size()) {
    out.undefined = 0;
    count_shots(*shot, out);
  }
  if (shot) {
    out.shot = true;
    double at_start = std::numeric_limits<double>::quiet_NaN();
    problem.evaluate(factors.from(coordinates(parameters)), at_start, nullptr, nullptr);
    out.start_value = at_start;
  }
  // Whatever an earlier start found, the search was not finished.
  if (searches.stopped() || (shot && shot->stopped)) {
    out.best.summary.termination = Termination::stopped;
    out.best.summary.message = "stopped by the caller";
  }
  return out;
}

void search_again(SeveralStarts& found, RecordingsLikelihood& likelihood,
                  const FactorCoordinates& factors, const NoiseMlOptions& options) {
  const LikelihoodProblem by_entries = likelihood.problem();
  const LikelihoodProblem problem = factors.problem(by_entries);
  Searches searches(likelihood.model(), factors, options, {found.best.x}, likelihood.samples(),
                    found.shot, !likelihood.weighs_roughness());
  const Search again = searches.run(problem, 0, std::nullopt);
  const double gain = again.solution.summary.objective - found.best.summary.objective;
  found.iterations += again.solution.summary.iterations;
  found.evaluations += again.solution.summary.evaluations;
  found.best = again.solution;
  for (double& L : found.log_likelihood) L += gain;
  if (!searches.stopped()) return;
  found.best.summary.termination = Termination::stopped;
  found.best.summary.message = "stopped by the caller";
}

std::string undefined_starts(const SeveralStarts& found) {
  if (found.undefined == 0) return "";
  return fmt::format(
      "{} of {} starts led nowhere: the likelihood is undefined there, as where a state overflows",
      found.undefined, found.undefined + static_cast<int>(found.ends.size()));
}

Findings check_starts(const SeveralStarts& found) {
  const int others = found.count(SearchEnd::maximum), stopped = found.count(SearchEnd::short_of);
  if (others == 0 && stopped == 0) return {};
  const auto below = [&](SearchEnd kind) {
    double highest = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < found.ends.size(); ++i) {
      if (found.ends[i] == kind) highest = std::max(highest, found.log_likelihood[i]);
    }
    return found.best.summary.objective - highest;
  };
  std::string text = fmt::format("{} of {} starts reached the same optimum",
                                 found.count(SearchEnd::best), found.ends.size());
  if (others > 0) {
    text += fmt::format("; {} ended at other maxima, the highest {:.3g} below", others,
                        below(SearchEnd::maximum));
  }
  if (stopped > 0) {
    text += fmt::format(
        "; {} stopped where the likelihood is flat or short of a maximum, the "
        "highest {:.3g} below",
        stopped, below(SearchEnd::short_of));
  }
  std::vector<std::string> ends;
  for (const double L : found.log_likelihood) ends.push_back(fmt::format("{:.4f}", L));
  text += fmt::format("; log-likelihoods by start: {}", fmt::join(ends, ", "));
  return {{FindingCode::several_maxima,
           others > 0 ? Severity::warning : Severity::note,
           {},
           text,
           others > 0 ? "raise --starts until more of them reach the best" : ""}};
}

}  // namespace identikal
