#include "identify/vehicle/internal/open_parameters.h"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace identikal {
namespace {

/// The free parameters that the recording does not determine.
std::vector<std::string> undetermined(const VehicleUnknowns& unknowns,
                                      const VehicleCovariance& covariance,
                                      const VehicleEstimate& estimate) {
  std::vector<std::string> open;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    if (p.verdict == Verdict::not_identifiable || p.verdict == Verdict::unexcited)
      open.push_back(p.name);
  }
  // A stiffness, mass or length whose interval holds zero is not determined either.
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[unknowns.position[i]];
    const bool maybe_zero = must_be_positive(unknowns.free[i]) && p.ci95[0] <= 0.0;
    const bool listed_already = std::find(open.begin(), open.end(), p.name) != open.end();
    const bool anywhere = i < covariance.open.size() && covariance.open[i];
    if ((maybe_zero || anywhere) && !listed_already) open.push_back(p.name);
  }
  return open;
}

/// What a fit is made for; all else that is free has its part in their errors.
bool is_of_interest_itself(VehicleParameter p) { return p <= kSteeringGain; }

/// Nobody refuses a stiffness for an offset that cannot be told from a bias.
Findings check_determined(const VehicleUnknowns& unknowns, const std::vector<std::string>& open) {
  if (open.empty()) return {};
  const auto is_open = [&](VehicleParameter p) {
    return std::find(open.begin(), open.end(), name_of(p)) != open.end();
  };
  const bool any_wanted =
      std::any_of(unknowns.free.begin(), unknowns.free.end(), is_of_interest_itself);
  const bool only_others =
      any_wanted &&
      std::none_of(unknowns.free.begin(), unknowns.free.end(),
                   [&](VehicleParameter p) { return is_of_interest_itself(p) && is_open(p); });
  const std::string text =
      fmt::format("this recording does not determine {} separately", fmt::join(open, ", "));
  if (!only_others) return {make_finding(FindingCode::not_identifiable, open, text)};
  return {{FindingCode::not_identifiable, Severity::warning, open,
           text + "; the errors of the others allow for it", ""}};
}

}  // namespace

Findings check_search(const VehicleSearch& found, const VehicleCovariance& covariance,
                      const VehicleEstimate& estimate) {
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  Findings out = check_determined(unknowns, undetermined(unknowns, covariance, estimate));
  if (!found.best.converged) {
    out.push_back(make_finding(FindingCode::not_converged, {},
                               "the search did not converge: " + found.best.message));
  }
  return out;
}

}  // namespace identikal
