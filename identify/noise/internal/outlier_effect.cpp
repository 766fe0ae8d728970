#include "identify/noise/internal/outlier_effect.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/filter/recordings_likelihood.h"
#include "lib/data/units.h"
#include "solvers/covariance.h"
#include "solvers/scoring.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kMovedErrors = 2.6;
constexpr double kMovedShare = 0.05;

// Of the free entries at the estimate; NaN where it is not known.
VectorXd standard_errors(RecordingsLikelihood& likelihood, const ParameterSet& at) {
  const Likelihood* there = likelihood.evaluate(at, true);
  VectorXd out = VectorXd::Constant(free_entries(at).size(), kNone);
  if (there == nullptr) return out;
  // A standard deviation at zero has no slope, and no error.
  std::vector<Index> sloping;
  for (Index i = 0; i < out.size(); ++i) {
    if (there->information(i, i) > 0.0) sloping.push_back(i);
  }
  const auto covariance = scaled_inverse(there->information(sloping, sloping), 1e-9);
  if (covariance) out(sloping) = covariance->diagonal().cwiseSqrt();
  return out;
}

}  // namespace

OutlierEffect outlier_effect(const Estimate& estimate, const Model& model, const ParameterSet& end,
                             const std::vector<Dataset>& cleaned) {
  Model started = model;
  started.parameters = end;
  RecordingsLikelihood likelihood(started, cleaned);
  likelihood.condition_on_beginning();
  const Solution found = maximise(likelihood.problem(), coordinates(end));
  if (!found.summary.usable()) return {true, "; without them the search does not converge"};
  const ParameterSet without = with_coordinates(end, found.x);
  const VectorXd from = free_entries(end), to = free_entries(without);
  const VectorXd se = standard_errors(likelihood, without);
  OutlierEffect out;
  double most = 0.0;
  Index i = -1;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++i;
    const double move = std::abs(from[i] - to[i]);
    const double in_errors = std::isfinite(se[i]) && se[i] > 0.0 ? move / se[i] : 0.0;
    const double relative = move / std::max(std::abs(to[i]), 1e-300);
    const double size = std::min(in_errors / kMovedErrors, relative / kMovedShare);
    if (size <= most) continue;
    most = size;
    const Unit unit = unit_or_dimensionless(p.unit);
    out.matters = size > 1.0;
    out.text = fmt::format("; without them {} is {:.4g} instead of {:.4g} ({:.2g} standard errors)",
                           p.name, unit.from_si(to[i]), unit.from_si(from[i]), in_errors);
  }
  return out;
}

}  // namespace identikal
