#include "identify/optimality/distance.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

std::string change_of(const Parameter& from, const Parameter& to) {
  if (from.value.size() != 1) return from.name;
  const Unit unit = unit_or_dimensionless(from.unit);
  return fmt::format("{} = {:.4g}{}{} in place of {:.4g}", from.name, unit.from_si(to.scalar()),
                     from.unit.empty() ? "" : " ", from.unit, unit.from_si(from.scalar()));
}

// The state names of formulas, or x1, x2, ...
std::string state_name(const Model& model, Index i) {
  const auto at = static_cast<std::size_t>(i);
  return at < model.states.size() ? model.states[at].name : fmt::format("x{}", i + 1);
}

}  // namespace

namespace {

std::vector<NoiseGain> changes_by(const Model& model, const ParameterSet& better,
                                  RecordingsLikelihood& likelihood) {
  const auto value_at = [&](const ParameterSet& at) -> std::optional<double> {
    const Likelihood* found = likelihood.evaluate(at, false);
    if (found == nullptr) return std::nullopt;
    return found->value;
  };
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    if (!model.parameters[i].fixed) left.push_back(i);
  }
  std::vector<NoiseGain> out;
  ParameterSet now = model.parameters;
  std::optional<double> reached = value_at(now);
  NoiseGain open;  // that has gained nothing so far
  while (reached && !left.empty()) {
    std::size_t best = left.size();
    double most = -kInfinity;
    for (std::size_t k = 0; k < left.size(); ++k) {
      ParameterSet trial = now;
      trial[left[k]].value = better[left[k]].value;
      const std::optional<double> value = value_at(trial);
      if (!value || !(*value > most)) continue;
      most = *value;
      best = k;
    }
    if (best == left.size()) return {};
    const std::size_t parameter = left[best];
    open.what.push_back(change_of(now[parameter], better[parameter]));
    open.gain += most - *reached;
    now[parameter].value = better[parameter].value;
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
    reached = most;
    if (open.gain <= 0.0 && !left.empty()) continue;
    out.push_back(std::move(open));
    open = {};
  }
  return out;
}

}  // namespace

std::vector<NoiseGain> changes_in_order(const Model& model, const ParameterSet& better,
                                        const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(model, recordings);
  return changes_by(model, better, likelihood);
}

std::vector<NoiseGain> changes_in_order(const Model& model, const ParameterSet& better,
                                        const std::vector<RecordingDigest>& digests) {
  RecordingsLikelihood likelihood(model, digests);
  return changes_by(model, better, likelihood);
}

StateExcess state_excess(const Model& model, const ParameterSet& better,
                         const std::vector<Dataset>& recordings) {
  StateExcess out;
  VectorXd moved, variance;
  double ahead = 0.0, trace = 0.0;  // of predictions
  for (const Dataset& data : recordings) {
    const FilterResult present = run_filter(model, model.parameters, data);
    const FilterResult best = run_filter(model, better, data);
    if (present.status != FilterStatus::ok || best.status != FilterStatus::ok) return {{}, kNaN};
    if (moved.size() == 0) moved = variance = VectorXd::Zero(present.x_filt.rows());
    for (Index t = std::max(present.first_proper, best.first_proper); t < data.size(); ++t) {
      const auto row = static_cast<std::size_t>(t);
      moved += (present.x_filt.col(t) - best.x_filt.col(t)).cwiseAbs2();
      variance += best.P_filt[row].diagonal();
      ahead += (present.x_pred.col(t) - best.x_pred.col(t)).squaredNorm();
      trace += best.P_pred[row].trace();
    }
  }
  out.of_all = trace > 0.0 ? ahead / trace : kNaN;
  out.of_state = (variance.array() > 0.0).select(moved.cwiseQuotient(variance), kNaN);
  return out;
}

std::string in_order(const std::vector<NoiseGain>& changes) {
  std::string out;
  for (const NoiseGain& each : changes) {
    out += fmt::format("{}{} gain{} {:.4g}", out.empty() ? "" : ", then ",
                       fmt::join(each.what, " and "), each.what.size() > 1 ? "" : "s", each.gain);
  }
  return out;
}

std::string in_words(const StateExcess& excess, const Model& model) {
  constexpr Index kShown = 8;
  std::string out;
  for (Index i = 0; i < std::min(kShown, excess.of_state.size()); ++i) {
    if (!std::isfinite(excess.of_state[i])) continue;
    const double percent = 100.0 * excess.of_state[i];
    out += fmt::format(
        "{}{} {} %", out.empty() ? "" : ", ", state_name(model, i),
        percent < 100.0 ? fmt::format("{:.2g}", percent) : fmt::format("{:.0f}", percent));
  }
  return out;
}

}  // namespace identikal
