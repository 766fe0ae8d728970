#include "identify/noise/internal/extension_fit.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "identify/estimate/estimate.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/median.h"
#include "solvers/covariance.h"
#include "solvers/parallel.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Values of parameters that both have.
void take_values(const Model& from, Model& to) {
  for (Parameter& p : to.parameters) {
    const int i = find_parameter(from.parameters, p.name);
    if (i < 0 || from.parameters[static_cast<std::size_t>(i)].value.size() != p.value.size()) {
      continue;
    }
    p = from.parameters[static_cast<std::size_t>(i)];
  }
}

// Do the data tell all unknowns inside their bounds?
bool determines(const LikelihoodProblem& problem, const VectorXd& x) {
  double value = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(x, value, &gradient, &information)) return false;
  std::vector<Index> inside;
  for (Index i = 0; i < x.size(); ++i) {
    if (x[i] > problem.lower[i] && x[i] < problem.upper[i]) inside.push_back(i);
  }
  return inside.empty() || scaled_inverse(information(inside, inside), kFlat).has_value();
}

// Half of the score statistic s' I^-1 s: what a search from there gains where the log-likelihood is
// a parabola. Infinite where it is not known.
double predicted_gain(const LikelihoodProblem& problem, const VectorXd& x) {
  double value = 0.0;
  VectorXd score;
  MatrixXd information;
  if (!problem.evaluate(x, value, &score, &information)) return HUGE_VAL;
  const std::optional<MatrixXd> covariance = scaled_inverse(information, kFlat);
  return covariance ? 0.5 * score.dot(*covariance * score) : HUGE_VAL;
}

// How well is a scalar parameter known with the others? Infinite where it is none, fixed, or unknown.
double standard_error_of(const std::string& name, const Model& model,
                         const std::vector<Dataset>& recordings) {
  Index at = 0;
  for (const Parameter& p : model.parameters) {
    if (p.name == name) break;
    if (!p.fixed) at += p.value.size();
  }
  RecordingsLikelihood likelihood(model, recordings);
  const Likelihood* const there = likelihood.evaluate(model.parameters, true);
  if (there == nullptr || at >= there->information.rows()) return HUGE_VAL;
  const std::optional<MatrixXd> covariance = scaled_inverse(there->information, kFlat);
  return covariance ? std::sqrt((*covariance)(at, at)) : HUGE_VAL;
}

// A bias that a diffuse state can take over has no information but rounding, which looks like some
// when it is the only thing in its row; a scale or a delay of the only output likewise.
bool determines_constants(const ModelExtension& extension, const Model& model,
                          const std::vector<Dataset>& recordings) {
  constexpr double kKnown = 10.0;  // of the size where its search began
  if (!is_constant(extension.kind)) return true;
  const char* of = extension.kind == ExtensionKind::bias    ? "bias_"
                   : extension.kind == ExtensionKind::scale ? "scale_"
                                                            : "delay_";
  const std::vector<std::string>& names = extension.names;
  if (extension.alike) {
    const std::string two = of + names[0] + "_" + names[1];
    return standard_error_of(two, model, recordings) < kKnown * extension.size[0];
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double se = standard_error_of(of + names[i], model, recordings);
    if (!(se < kKnown * extension.size[i])) return false;
  }
  return true;
}

// The longest step [s] with which a model is integrated as finely everywhere as it needs somewhere:
// further parts, which are judged by what they gain, go along with it. None where that would take
// many more steps in all, and in discrete time.
std::optional<double> shared_step(const Model& model, const std::vector<Dataset>& recordings) {
  constexpr double kManyMore = 2.0,
                   kOfInterval = 2.0;  // the least time constant of a lasting error
  if (is_linear(model) || as_formulas(model).linear || !as_formulas(model).equations.continuous ||
      as_formulas(model).longest_step > 0.0) {
    return std::nullopt;
  }
  double out = kInfinity, needed = 0.0, taken = 0.0;
  std::vector<double> intervals;
  for (const Dataset& data : recordings) {
    const Integration integration = integration_of(model, model.parameters, data);
    if (integration.controlled || integration.steps.status != StepStatus::ok) return std::nullopt;
    for (std::size_t k = 0; k < integration.steps.steps.size(); ++k) {
      const int steps = integration.steps.steps[k];
      const auto row = static_cast<Index>(k);
      intervals.push_back(data.time[row + 1] - data.time[row]);
      if (steps > 1) out = std::min(out, intervals.back() / steps);
      needed += steps;
    }
  }
  if (intervals.empty()) return std::nullopt;
  out = std::min(out, kOfInterval * median(std::vector<double>(intervals)));
  for (const double interval : intervals) taken += std::ceil(interval / out);
  if (taken > kManyMore * needed) return std::nullopt;
  return out;
}

constexpr int kMostIterations = 40;

SolverOptions until_nothing_counts(int iterations) {
  SolverOptions out;
  out.max_iterations = iterations;
  out.decrement_tolerance = 1e-4;
  return out;
}

// Half of it is BIC's penalty for an unknown.
double log_of_rows(const std::vector<Dataset>& recordings) {
  double rows = 0.0;
  for (const Dataset& data : recordings) rows += static_cast<double>(data.size());
  return std::log(rows);
}

// What a part gives that goes with the model; else nothing.
template <typename Job>
auto where_it_goes(const Job& job) -> decltype(job()) {
  try {
    return job();
  } catch (const InputError&) {
    return {};  // units that do not fit, no named noise, a start of another kind
  } catch (const std::invalid_argument&) {
    return {};  // noise that is zero changes by no ratio
  }
}

// An extended model while it is searched.
struct Search {
  FittedModel fitted;                                // at where the search is
  std::unique_ptr<RecordingsLikelihood> likelihood;  // of the model in `fitted`
  VectorXd x;
  double expected_gain = kInfinity;
  bool ended = false;
};

// Nothing where the extension does not go with the model, or its score promises too little.
// @param step  of the integration, shared_step() of the base
std::unique_ptr<Search> begin_search(const FittedModel& base, const ModelExtension& extension,
                                     const std::vector<Dataset>& recordings,
                                     std::optional<double> step, double least_gain) {
  return where_it_goes([&]() -> std::unique_ptr<Search> {
    auto out = std::make_unique<Search>();
    FittedModel& fitted = out->fitted;
    fitted.root = extended(base.root, extension, recordings[0].dt);
    fitted.model = model_of(fitted.root, base.model.source);
    take_values(base.model, fitted.model);
    fitted.model = checked(std::move(fitted.model), recordings);
    if (step) as_formulas(fitted.model).longest_step = *step;
    out->likelihood = std::make_unique<RecordingsLikelihood>(fitted.model, recordings);
    out->likelihood->condition_on_beginning();
    out->likelihood->weigh_by_priors();
    // With its slope, which the search begins from.
    if (out->likelihood->evaluate(fitted.model.parameters, true) == nullptr) return nullptr;
    out->x = coordinates(fitted.model.parameters);
    if ((is_constant(extension.kind) || is_curve(extension.kind)) && least_gain > 0.0 &&
        predicted_gain(out->likelihood->problem(), out->x) < least_gain) {
      return nullptr;
    }
    return out;
  });
}

void go_on(Search& search, int iterations) {
  const std::optional<Solution> found = where_it_goes([&] {
    return std::optional(
        maximise(search.likelihood->problem(), search.x, until_nothing_counts(iterations)));
  });
  const Solution end = found.value_or(Solution{search.x, {}});  // whose objective is none
  search.x = end.x;
  search.fitted.log_likelihood = end.summary.objective;
  search.expected_gain = end.summary.expected_gain;
  search.ended = end.summary.termination != Termination::iteration_limit;
}

// Nothing where the recordings do not determine what was found.
std::optional<FittedModel> found_by(const Search& search, const FittedModel& base,
                                    const ModelExtension& extension,
                                    const std::vector<Dataset>& recordings) {
  return where_it_goes([&]() -> std::optional<FittedModel> {
    if (!std::isfinite(search.fitted.log_likelihood) ||
        !determines(search.likelihood->problem(), search.x)) {
      return std::nullopt;
    }
    FittedModel out = search.fitted;
    out.model.parameters = with_coordinates(out.model.parameters, search.x);
    if (!is_linear(out.model) && !is_linear(base.model)) {
      as_formulas(out.model).longest_step = as_formulas(base.model).longest_step;
    }
    if (!determines_constants(extension, out.model, recordings)) return std::nullopt;
    return out;
  });
}

// Tells of each task's extension before it is done; false once the listener wants no more.
class Told {
 public:
  explicit Told(const std::function<bool(const ModelExtension& extension)>& progress)
      : progress_(progress) {}
  bool goes_on(const ModelExtension& extension) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopped_ = stopped_ || (progress_ && !progress_(extension));
    return !stopped_;
  }
  bool stopped() const { return stopped_; }

 private:
  const std::function<bool(const ModelExtension& extension)>& progress_;
  std::mutex mutex_;
  bool stopped_ = false;
};

// Lets all searches go on together, and leaves out those that the best is out of reach of.
class Race {
 public:
  Race(const std::vector<ModelExtension>& extensions, double log_rows, double to_beat)
      : extensions_(extensions), log_rows_(log_rows), to_beat_(to_beat) {}

  double criterion(const Search& search) const {
    const auto unknowns = static_cast<double>(free_entries(search.fitted.model.parameters).size());
    return search.fitted.log_likelihood - 0.5 * log_rows_ * unknowns;
  }

  // @return the best of those that have not lost; -1: none
  int run(std::vector<std::unique_ptr<Search>>& searches, int threads, Told& told) {
    constexpr int kRounds[] = {2, 4, 8, kMostIterations - 14};
    std::vector<bool> lost(searches.size(), false);
    for (const int iterations : kRounds) {
      in_parallel(static_cast<int>(searches.size()), threads, [&](int task) {
        const auto i = static_cast<std::size_t>(task);
        if (!searches[i] || searches[i]->ended || lost[i]) return;
        if (told.goes_on(extensions_[i])) go_on(*searches[i], iterations);
      });
      const int first = best(searches, lost);
      if (first < 0 || told.stopped()) return -1;
      const double least =
          std::max(to_beat_, criterion(*searches[static_cast<std::size_t>(first)]));
      for (std::size_t i = 0; i < searches.size(); ++i) {
        lost[i] = lost[i] || !searches[i] || out_of_reach(*searches[i], least);
      }
    }
    return best(searches, lost);
  }

 private:
  // Far from the maximum a quadratic is wrong by factors, mostly too much.
  bool out_of_reach(const Search& search, double least) const {
    constexpr double kOften = 5.0, kNats = 3.0;
    const double hoped = search.ended ? 0.0 : kOften * search.expected_gain + kNats;
    return !(criterion(search) + hoped >= least);
  }

  int best(const std::vector<std::unique_ptr<Search>>& searches,
           const std::vector<bool>& lost) const {
    int out = -1;
    for (std::size_t i = 0; i < searches.size(); ++i) {
      if (!searches[i] || lost[i] || std::isnan(searches[i]->fitted.log_likelihood)) continue;
      if (out >= 0 &&
          !(criterion(*searches[i]) > criterion(*searches[static_cast<std::size_t>(out)]))) {
        continue;
      }
      out = static_cast<int>(i);
    }
    return out;
  }

  const std::vector<ModelExtension>& extensions_;
  double log_rows_, to_beat_;
};

}  // namespace

std::optional<double> fit_values(Model& model, const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(model, recordings);
  if (likelihood.status_at_start() != FilterStatus::ok) return std::nullopt;
  likelihood.condition_on_beginning();
  likelihood.weigh_by_priors();
  const Solution end = maximise(likelihood.problem(), coordinates(model.parameters),
                                until_nothing_counts(kMostIterations));
  if (!std::isfinite(end.summary.objective) || !determines(likelihood.problem(), end.x)) {
    return std::nullopt;
  }
  model.parameters = with_coordinates(model.parameters, end.x);
  return end.summary.objective;
}

std::vector<Dataset> rows_to_fit(const std::vector<Dataset>& recordings) {
  std::vector<Dataset> out;
  Index left = 5000;
  for (const Dataset& data : recordings) {
    if (left < 2) break;
    out.push_back(first_samples(data, std::min(left, data.size())));
    left -= out.back().size();
  }
  return out;
}

std::vector<std::optional<FittedModel>> fit_extensions(
    const FittedModel& base, const std::vector<ModelExtension>& extensions,
    const std::vector<Dataset>& recordings, int threads,
    const std::function<bool(const ModelExtension& extension)>& progress) {
  std::vector<std::optional<FittedModel>> out(extensions.size());
  Told told(progress);
  const std::optional<double> step = shared_step(base.model, recordings);
  in_parallel(static_cast<int>(extensions.size()), threads, [&](int task) {
    const auto i = static_cast<std::size_t>(task);
    if (!told.goes_on(extensions[i])) return;
    const double least = is_curve(extensions[i].kind) ? 0.25 * log_of_rows(recordings) : 0.0;
    const auto search = begin_search(base, extensions[i], recordings, step, least);
    if (!search) return;
    go_on(*search, kMostIterations);
    out[i] = found_by(*search, base, extensions[i], recordings);
  });
  return out;
}

std::optional<LikeliestExtension> likeliest_extension(
    const FittedModel& base, const std::vector<ModelExtension>& extensions,
    const std::vector<Dataset>& recordings, int threads,
    const std::function<bool(const ModelExtension& extension)>& progress) {
  const double log_rows = log_of_rows(recordings);
  Told told(progress);
  const std::optional<double> step = shared_step(base.model, recordings);
  std::vector<std::unique_ptr<Search>> searches(extensions.size());
  in_parallel(static_cast<int>(extensions.size()), threads, [&](int task) {
    const auto i = static_cast<std::size_t>(task);
    if (!told.goes_on(extensions[i])) return;
    searches[i] = begin_search(base, extensions[i], recordings, step, 0.25 * log_rows);
  });
  const double unknowns = static_cast<double>(free_entries(base.model.parameters).size());
  const double to_beat = base.log_likelihood - 0.5 * log_rows * unknowns;
  Race race(extensions, log_rows, to_beat);
  while (true) {
    const int first = race.run(searches, threads, told);
    if (first < 0) return std::nullopt;
    const auto i = static_cast<std::size_t>(first);
    if (!(race.criterion(*searches[i]) > to_beat)) return std::nullopt;
    if (auto found = found_by(*searches[i], base, extensions[i], recordings)) {
      return LikeliestExtension{i, std::move(*found)};
    }
    searches[i].reset();  // what it was better than may be determined
  }
}

std::optional<LikeliestExtension> likeliest_curve(
    const FittedModel& base, const std::vector<ModelExtension>& curves,
    const std::vector<Dataset>& recordings, double least_gain,
    const std::function<bool(const ModelExtension& extension)>& progress) {
  std::optional<LikeliestExtension> out;
  Told told(progress);
  const std::optional<double> step = shared_step(base.model, recordings);
  double to_beat = base.log_likelihood + least_gain;
  for (std::size_t i = 0; i < curves.size() && told.goes_on(curves[i]); ++i) {
    const auto search = begin_search(base, curves[i], recordings, step, least_gain);
    if (!search) continue;
    go_on(*search, kMostIterations);
    if (!(search->fitted.log_likelihood > to_beat)) continue;
    auto found = found_by(*search, base, curves[i], recordings);
    if (!found) continue;
    to_beat = found->log_likelihood;
    out = LikeliestExtension{i, std::move(*found)};
  }
  return out;
}

}  // namespace identikal
