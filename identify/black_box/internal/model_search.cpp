#include "identify/black_box/internal/model_search.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "identify/black_box/internal/characteristics.h"
#include "identify/black_box/internal/held_out_fit.h"
#include "identify/black_box/internal/polynomial_fit.h"
#include "lib/base/error.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

// Held-out rows, and the states of the first ones.
struct HeldOutRows {
  SplitRecordings parts;
  SubspaceStart start;
};

HeldOutRows held_out(SplitRecordings parts, const BlackBoxOptions& options) {
  constexpr Index kMostHeldOut = 40000;  // rows
  parts.rest = first_rows(parts.rest, kMostHeldOut);
  SubspaceStart start =
      subspace_start(parts.first, suitable_lags(parts.first, options.most_order), nullptr);
  return {std::move(parts), std::move(start)};
}

// The best simulation of held-out rows by the first ones, of any order.
double best_simulation(const HeldOutRows& of, const BlackBoxOptions& options) {
  const auto most =
      static_cast<int>(std::min<Index>(options.most_order, of.start.states.most_states()));
  double best = -std::numeric_limits<double>::infinity();
  for (int order = std::min(options.least_order, most); order <= most; ++order) {
    BlackBoxCandidate each{order, Refinement::none,
                           fitted(of.start, of.parts.first, order, Refinement::none, true)};
    judge_on_held_out(each, of.parts);
    best = std::max(best, each.simulation);
  }
  return best;
}

// Recordings about zero, where that is what they move around. The mean of few slow swings is no operating point: what is taken
// off for it is missing in all later rows. Channels that pass through zero all the time are likely to be deviations
// already; others have to do noticeably better so on rows that were held out. Without inputs the mean is all that is known.
std::optional<HeldOutRows> about_zero(const ScaledRecordings& from_mean,
                                      const HeldOutRows& by_means, const BlackBoxOptions& options) {
  constexpr double kThrough = 1.0, kFar = 10.0;  // by the channel's scatter
  constexpr double kDoubt = 0.05;                // of the fit
  const double far = farthest_mean(from_mean.point);
  if (from_mean.point.u.size() == 0 || !(far < kFar)) return std::nullopt;
  HeldOutRows out = held_out(split(from_zero(from_mean), 1.0 - options.held_out_share), options);
  const double gain = best_simulation(out, options) - best_simulation(by_means, options);
  if (!(gain > (far < kThrough ? -kDoubt : kSameFit))) return std::nullopt;
  return out;
}

ModelSearch about_operating_point(const std::vector<Dataset>& recordings,
                                  const BlackBoxOptions& options) {
  ScaledRecordings all = scaled(recordings);
  HeldOutRows chosen =
      held_out(about_first_means(split(all, 1.0 - options.held_out_share)), options);
  if (std::optional<HeldOutRows> zero = about_zero(all, chosen, options)) {
    all = from_zero(std::move(all));
    SubspaceStart of_all = subspace_start(all, zero->start.sums.lags, &zero->start.prior);
    return {std::move(all), std::move(zero->parts), std::move(zero->start), std::move(of_all)};
  }
  SubspaceStart of_all = subspace_start(all, chosen.start.sums.lags, &chosen.start.prior);
  return {std::move(all), std::move(chosen.parts), std::move(chosen.start), std::move(of_all)};
}

std::vector<Index> delays_of(const ModelSearch& search, const BlackBoxOptions& options) {
  const Index m = search.all.u.front().rows();
  const bool needs_input = options.structure == ModelStructure::output_error ||
                           options.structure == ModelStructure::box_jenkins;
  if (needs_input && m == 0) {
    throw InputError({}, "a model of how inputs drive outputs, without an input",
                     "input columns, or ARX and ARMAX, which do without");
  }
  std::vector<Index> out(static_cast<std::size_t>(m), options.delay.value_or(0));
  if (options.delay) return out;
  const std::vector<BlackBox::Delay> found = input_delays(search.of_all.sums);
  for (std::size_t j = 0; j < found.size(); ++j) {
    const bool seen = found[j].rows < search.of_all.sums.lags;
    out[j] = seen ? static_cast<Index>(found[j].rows) : 1;
  }
  return out;
}

}  // namespace

ModelSearch begun_search(const std::vector<Dataset>& recordings, const BlackBoxOptions& options) {
  ModelSearch out = about_operating_point(recordings, options);
  out.has_inputs = out.all.u.front().rows() > 0;
  out.purpose = options.purpose;
  out.structure = options.structure;
  if (options.structure != ModelStructure::states) out.delays = delays_of(out, options);
  return out;
}

void fit_to_all_rows(const ModelSearch& search, BlackBoxCandidate& candidate) {
  candidate.model = fitted(search.of_all, search.all, candidate.order, candidate.refinement,
                           search.is_stable(candidate.refinement));
  judge_on_fitted(candidate, search.all, search.of_all.sums);
}

BlackBoxCandidate candidate(const ModelSearch& search, int order, Refinement how, bool with_bic) {
  BlackBoxCandidate out{
      order, how, fitted(search.of_first, search.parts.first, order, how, search.is_stable(how))};
  judge_on_held_out(out, search.parts);
  if (with_bic) fit_to_all_rows(search, out);
  return out;
}

namespace {

// May the next order be tried? The first one always.
bool goes_on(ModelSearch& search, const BlackBoxOptions& options, int order, int most) {
  if (!options.progress) return true;
  const bool on = options.progress(fmt::format("order {} of {}", order, most));
  search.stopped = !on && order > options.least_order;
  return !search.stopped;
}

std::vector<BlackBoxCandidate> of_states(ModelSearch& search, const BlackBoxOptions& options) {
  const auto most = static_cast<int>(
      std::min({static_cast<Index>(options.most_order), search.of_first.states.most_states(),
                search.of_all.states.most_states()}));
  if (options.least_order > most) {
    throw InputError(
        {}, fmt::format("an order of {}", options.least_order),
        fmt::format("at most {}: what is more these recordings do not tell from rounding", most));
  }
  std::vector<BlackBoxCandidate> out;
  for (int order = options.least_order; order <= most; ++order) {
    if (!goes_on(search, options, order, most)) break;
    out.push_back(candidate(search, order, Refinement::none, true));
    if (search.simulates()) out.push_back(candidate(search, order, Refinement::simulation, false));
  }
  return out;
}

void take_polynomials(const PolynomialModel& structure, const SubspaceStart& start,
                      const ScaledRecordings& recordings, int order, BlackBoxCandidate& out) {
  const auto states = std::min<Index>(order, start.states.most_states());
  out.polynomials = fitted_polynomials(structure, start.states.model(states), recordings);
  const auto p = static_cast<Index>(out.polynomials.size());
  out.model = with_stable_predictor(
      observable_part(innovation_form(out.polynomials, MatrixXd::Identity(p, p))));
}

BlackBoxCandidate polynomial_candidate(const ModelSearch& search, const BlackBoxOptions& options,
                                       int order, int noise_order) {
  const PolynomialModel structure =
      polynomials_of(search.structure, order, noise_order, options.polynomials, search.delays);
  BlackBoxCandidate out;
  out.refinement = Refinement::polynomials;
  take_polynomials(structure, search.of_first, search.parts.first, order, out);
  judge_on_held_out(out, search.parts);
  take_polynomials(structure, search.of_all, search.all, order, out);
  judge_on_fitted(out, search.all, search.of_all.sums);
  out.order = static_cast<int>(out.model.states());
  return out;
}

std::vector<BlackBoxCandidate> of_polynomials(ModelSearch& search, const BlackBoxOptions& options) {
  std::vector<BlackBoxCandidate> out;
  const int most = options.polynomials ? options.least_order : options.most_order;
  double least = std::numeric_limits<double>::infinity();
  int since_least = 0;
  // Orders beyond four that are no better are not tried: they take the longest.
  for (int order = options.least_order; order <= most && since_least < 4; ++order) {
    if (!goes_on(search, options, order, most)) break;
    const bool own_noise = search.structure == ModelStructure::box_jenkins && !options.polynomials;
    ++since_least;
    for (int noise_order = 1; noise_order <= (own_noise ? 2 : 1); ++noise_order) {
      out.push_back(polynomial_candidate(search, options, order, noise_order));
      if (!(out.back().bic < least)) continue;
      least = out.back().bic;
      since_least = 0;
    }
  }
  return out;
}

}  // namespace

std::vector<BlackBoxCandidate> candidates_of_all_orders(ModelSearch& search,
                                                        const BlackBoxOptions& options) {
  return search.structure == ModelStructure::states ? of_states(search, options)
                                                    : of_polynomials(search, options);
}

}  // namespace identikal
