#include "identify/noise/internal/equal_maxima.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSameValue = 1e-3;  // relative

bool are_alike(double a, double b) {
  return std::abs(a - b) <= kSameValue * (std::abs(a) + std::abs(b));
}

bool are_alike(const VectorXd& a, const VectorXd& b) {
  return std::equal(a.begin(), a.end(), b.begin(),
                    [](double x, double y) { return are_alike(x, y); });
}

std::optional<MatrixXd> information_at(const LikelihoodProblem& problem, const VectorXd& x) {
  double L = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(x, L, &gradient, &information)) return std::nullopt;
  if (!scaled_inverse(information, kFlat))
    return std::nullopt;  // a valley, which is said elsewhere
  return information;
}

// The farthest of the ends, where it is another place.
std::optional<VectorXd> other_place(const SeveralStarts& found, const LikelihoodProblem& by_entries,
                                    const FactorCoordinates& factors) {
  const VectorXd best = factors.to(found.best.x);
  std::optional<MatrixXd> information;
  std::optional<VectorXd> out;
  double farthest = 1.0;  // standard errors, squared
  for (const VectorXd& end : found.best_ends) {
    const VectorXd x = factors.to(end), d = x - best;
    if (are_alike(x, best)) continue;
    if (!information) information = information_at(by_entries, best);
    if (!information) return std::nullopt;
    const double distance = d.dot(*information * d);
    if (!(distance > farthest) || !information_at(by_entries, x)) continue;
    farthest = distance;
    out = x;
  }
  return out;
}

bool are_exchanged(VectorXd a, VectorXd b) {
  a = a.cwiseAbs().eval();
  b = b.cwiseAbs().eval();
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  return are_alike(a, b);
}

}  // namespace

Findings check_equal_maxima(const Estimate& estimate, const SeveralStarts& found,
                            const LikelihoodProblem& by_entries, const ParameterSet& parameters,
                            const FactorCoordinates& factors) {
  const std::optional<VectorXd> other = other_place(found, by_entries, factors);
  if (!other) return {};
  Estimate there;
  list_parameters(there, parameters, with_coordinates(parameters, *other));
  std::vector<std::string> about, values;
  for (std::size_t i = 0; i < there.parameters.size(); ++i) {
    const EstimatedParameter& p = there.parameters[i];
    if (p.fixed || are_alike(p.value, estimate.parameters[i].value)) continue;
    about.push_back(p.name);
    values.push_back(
        fmt::format("{} = {:.4g}{}{}", p.name, p.value, p.unit.empty() ? "" : " ", p.unit));
  }
  if (about.empty()) return {};
  const bool exchanged = are_exchanged(factors.to(found.best.x), *other);
  Finding out = make_finding(
      FindingCode::several_maxima, about,
      exchanged
          ? fmt::format("the parameters may exchange their values: {} is the same curve",
                        fmt::join(values, ", "))
          : fmt::format("other values are as likely as the estimates: {}", fmt::join(values, ", ")),
      exchanged ? "" : "a bound, or a prior, that only one of them is within");
  out.severity = exchanged ? Severity::note : Severity::serious;
  return {out};
}

}  // namespace identikal
