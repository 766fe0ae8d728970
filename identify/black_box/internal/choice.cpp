#include "identify/black_box/internal/choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "identify/black_box/internal/held_out_fit.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr double kNoticeably = 0.02;  // of the fit

// The smallest order whose simulation of held-out rows is as good as the best, and no luck (as of outputs that wander off
// by themselves): who knows the outputs until now predicts the next no worse than who does not, unless his noise is wrong.
std::size_t best_simulation(const std::vector<BlackBoxCandidate>& all) {
  const bool some = std::any_of(all.begin(), all.end(), [](const auto& c) { return !c.lucky; });
  const auto simulation = [&](const BlackBoxCandidate& each) {
    return some && each.lucky ? -std::numeric_limits<double>::infinity() : each.simulation;
  };
  double best = -std::numeric_limits<double>::infinity();
  for (const BlackBoxCandidate& each : all) best = std::max(best, simulation(each));
  std::size_t chosen = 0;
  for (std::size_t k = all.size(); k-- > 0;) {
    if (simulation(all[k]) < best - kSameFit) continue;
    const bool same_order =
        all[k].order == all[chosen].order && simulation(all[chosen]) >= best - kSameFit;
    if (!same_order || all[k].simulation > all[chosen].simulation) chosen = k;
  }
  return chosen;
}

std::size_t least(const std::vector<BlackBoxCandidate>& all, double BlackBoxCandidate::*criterion) {
  std::size_t least = 0;
  for (std::size_t k = 1; k < all.size(); ++k) {
    // Also past one that has none: a predictor that overflows.
    if (all[k].*criterion < all[least].*criterion || !std::isfinite(all[least].*criterion))
      least = k;
  }
  return least;
}
std::size_t least_bic(const std::vector<BlackBoxCandidate>& all) {
  return least(all, &BlackBoxCandidate::bic);
}

// Rows until the slowest pole has come to 1/e.
Index horizon_of(const InnovationForm& model) {
  constexpr double kLeast = 2.0, kMost = 100.0;
  const double radius = spectral_radius(model.A);
  if (!(radius < 1.0)) return static_cast<Index>(kMost);
  return static_cast<Index>(std::clamp(std::ceil(-1.0 / std::log(radius)), kLeast, kMost));
}

// The smallest order whose predictions up to the horizon are as good as the best, or its model by the prediction error method
// where that does better.
std::size_t best_for_control(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                             const BlackBoxOptions& options) {
  search.horizon = options.horizon.value_or(horizon_of(all[least_bic(all)].model));
  const auto judge = [&](BlackBoxCandidate& each) {
    judge_for_control(each, search.parts.rest, search.horizon);
  };
  for (BlackBoxCandidate& each : all) judge(each);
  if (std::isnan(all.front().control)) {
    throw InputError({}, fmt::format("held-out rows are too few for {} rows ahead", search.horizon),
                     "longer recordings", "a shorter --steps, or a larger --hold-out");
  }
  const auto is_worse = [](const BlackBoxCandidate& a, const BlackBoxCandidate& b) {
    return a.control < b.control;
  };
  const double best = std::max_element(all.begin(), all.end(), is_worse)->control;
  const auto good = std::find_if(all.begin(), all.end(), [&](const BlackBoxCandidate& each) {
    return each.control > best - kSameFit;
  });
  const auto chosen = static_cast<std::size_t>(good - all.begin());
  if (search.structure != ModelStructure::states) return chosen;
  all.push_back(candidate(search, all[chosen].order, Refinement::prediction_error, false));
  judge(all.back());
  return all.back().control > all[chosen].control ? all.size() - 1 : chosen;
}

// The order of least BIC and its neighbours by the prediction error method.
void refine_likeliest(const ModelSearch& search, std::vector<BlackBoxCandidate>& all, int around) {
  const int order = all[least_bic(all)].order;
  const int least = all.front().order, most = all.back().order;
  for (int each = std::max(least, order - around); each <= std::min(most, order + around); ++each) {
    all.push_back(candidate(search, each, Refinement::prediction_error, around > 0));
  }
}

// From the order of least BIC upwards, by the criterion of Hannan and Quinn (1979): until a parameter is worth log(rows) of
// log-likelihood, predictions lose more without it than with one too many. Time series are short, and have but the noise
// to be told from noise: there BIC predicts better.
std::size_t best_prediction(const ModelSearch& search, std::vector<BlackBoxCandidate>& all) {
  constexpr int kFurther = 2;  // orders that are no better end it
  const int most = all.back().order;
  refine_likeliest(search, all, 1);
  if (!search.has_inputs) return least_bic(all);
  std::size_t best = least(all, &BlackBoxCandidate::hannan_quinn);
  for (int order = all.back().order + 1, tried = 0; order <= most && tried < kFurther; ++order) {
    all.push_back(candidate(search, order, Refinement::prediction_error, true));
    const std::size_t now = least(all, &BlackBoxCandidate::hannan_quinn);
    tried = now == best ? tried + 1 : 0;
    best = now;
  }
  return best;
}

// Does the last candidate, a refined one, predict held-out rows worse than some that are not refined?
bool overfits(const std::vector<BlackBoxCandidate>& all) {
  constexpr double kWorse = 0.001;  // of the fit
  double best = -std::numeric_limits<double>::infinity();
  for (const BlackBoxCandidate& each : all) {
    if (each.refinement == Refinement::none) best = std::max(best, each.prediction);
  }
  return all.back().prediction < best - kWorse;
}

// What simulates best, with all of it fitted to simulations where held-out rows say that this is noticeably better:
// it follows one recording as closely as its order allows.
std::size_t by_output_error(const ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                            std::size_t simulator) {
  all.push_back(candidate(search, all[simulator].order, Refinement::output_error, false));
  const bool better = all.back().simulation > all[simulator].simulation + kNoticeably;
  return better ? all.size() - 1 : simulator;
}

// Where nothing is said what the model is for: the likeliest one, unless another simulates better.
std::size_t choose_stable(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                          const BlackBoxOptions& options) {
  if (search.purpose == BlackBoxPurpose::control) return best_for_control(search, all, options);
  if (search.structure != ModelStructure::states) {
    return search.simulates() && search.purpose == BlackBoxPurpose::simulation
               ? best_simulation(all)
               : least_bic(all);
  }
  if (!search.has_inputs || search.purpose == BlackBoxPurpose::prediction) {
    return best_prediction(search, all);
  }
  const std::size_t simulator = best_simulation(all);
  // BIC that still falls at the highest order says that none of them is the true one.
  const bool settled = all[least_bic(all)].order < all.back().order;
  if (search.purpose == BlackBoxPurpose::automatic && settled) {
    refine_likeliest(search, all, 0);
    const bool is_close = all.back().simulation > all[simulator].simulation - kSameFit;
    const bool simulates_as_well =
        is_close || !simulates_worse(all.back(), all[simulator], search.parts.rest);
    if (simulates_as_well && !overfits(all)) return all.size() - 1;
    if (all.back().order == all[simulator].order) return by_output_error(search, all, simulator);
  }
  all.push_back(candidate(search, all[simulator].order, Refinement::prediction_error, false));
  const bool better = all.back().simulation > all[simulator].simulation && !overfits(all);
  return by_output_error(search, all, better ? all.size() - 1 : simulator);
}

// The same, and of what wanders off by itself a model that does too, where that simulates and predicts held-out rows better,
// one of both noticeably.
std::size_t choose(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                   const BlackBoxOptions& options) {
  const std::size_t chosen = choose_stable(search, all, options);
  const bool open = search.structure == ModelStructure::states && search.has_inputs &&
                    search.purpose == BlackBoxPurpose::automatic;
  if (!open) return chosen;
  const BlackBoxCandidate& likeliest = all[least_bic(all)];
  if (spectral_radius(likeliest.of_first.A) < kLargestPole * (1.0 - 1e-9)) return chosen;
  const int order = likeliest.order;
  all.push_back(candidate(search, order, Refinement::any_poles, false));
  const double simulation = all.back().simulation - all[chosen].simulation,
               prediction = all.back().prediction - all[chosen].prediction;
  const bool better =
      std::min(simulation, prediction) > 0.0 && std::max(simulation, prediction) > kNoticeably;
  return better ? all.size() - 1 : chosen;
}

}  // namespace

// A model whose predictions overflow is none.
std::size_t chosen_candidate(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                             const BlackBoxOptions& options) {
  std::size_t chosen = choose(search, all, options);
  for (;;) {
    BlackBoxCandidate& best = all[chosen];
    const bool of_states = best.polynomials.empty();
    if (of_states && !std::isfinite(best.bic)) fit_to_all_rows(search, best);
    if (best.model.A.allFinite() && best.model.K.allFinite() && best.model.sigma.allFinite()) {
      return chosen;
    }
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(chosen));
    if (all.empty()) {
      throw InputError({}, "no order has a model whose predictions stay finite",
                       "recordings that a linear model of these orders can follow",
                       "fewer states: a lower --order");
    }
    chosen = search.simulates() ? best_simulation(all) : least_bic(all);
  }
}

}  // namespace identikal
