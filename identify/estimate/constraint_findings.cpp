#include "identify/estimate/constraint_findings.h"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"

namespace identikal {
namespace {

constexpr double kContradicted = 0.01;  // probability of a multiplier as large where it holds

// Parameters that the constraint moves with.
std::vector<std::string> names_in(const ConstraintValues& values, Eigen::Index i,
                                  const ParameterSet& parameters) {
  std::vector<std::string> out;
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    const bool moves = values.slopes(i, static_cast<Eigen::Index>(p)) != 0.0;
    if (moves && !parameters[p].fixed) out.push_back(parameters[p].name);
  }
  return out;
}

Finding contradicted(const std::string& text, std::vector<std::string> about, bool equality,
                     double p) {
  return {FindingCode::constraint, Severity::warning, std::move(about),
          fmt::format("the data speak against '{}' (p = {:.2g}){}", text, p,
                      equality ? "" : ", which holds the estimate at its border"),
          "look whether it is true; without it the estimates are those that the data have"};
}

}  // namespace

Findings check_constraints(const Constraints& constraints, const Multipliers& multipliers,
                           const ParameterSet& parameters, bool tested) {
  Findings out;
  if (multipliers.l.size() == 0) return out;
  Eigen::VectorXd p(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index i = 0; i < p.size(); ++i) p[i] = parameters[i].value(0, 0);
  const ConstraintValues values = constraint_values(constraints, p);
  for (Eigen::Index i = 0; i < constraints.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const bool equality = constraints.equality[n];
    if (multipliers.l[i] == 0.0) continue;
    const double statistic = multipliers.l[i] * multipliers.l[i] * multipliers.variance[i];
    const double chance = chi_square_upper_tail(statistic, 1.0);
    const std::string& text = constraints.text[n];
    if (tested && chance < kContradicted) {
      out.push_back(contradicted(text, names_in(values, i, parameters), equality, chance));
    } else if (!equality) {
      out.push_back({FindingCode::constraint, Severity::note, names_in(values, i, parameters),
                     fmt::format("the estimate lies at the border of '{}'; standard errors are "
                                 "those along it",
                                 text),
                     ""});
    }
  }
  return out;
}

}  // namespace identikal
