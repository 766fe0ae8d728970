#include "identify/estimate/estimate.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>

#include "lib/data/units.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Entries of a flat direction smaller than this are not part of it.
constexpr double kPartOf = 0.1;

std::vector<EstimatedParameter*> judged(Estimate& estimate) {
  std::vector<EstimatedParameter*> out;
  for (EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed && p.verdict != Verdict::at_bound) out.push_back(&p);
  }
  return out;
}

// Marks what the data say nothing about; returns who is left with a meaningful standard error.
std::vector<bool> find_flat(Estimate& estimate, const std::vector<EstimatedParameter*>& free,
                            const MatrixXd& information, double flat) {
  const auto k = static_cast<Index>(free.size());
  std::vector<bool> sound(free.size(), true);
  VectorXd scale = VectorXd::Zero(k);
  for (Index i = 0; i < k; ++i) {
    const double d = information(i, i);
    if (d > 0.0 && std::isfinite(d)) {
      scale[i] = 1.0 / std::sqrt(d);
    } else {
      free[i]->verdict = Verdict::unexcited;
      sound[i] = false;
    }
  }
  const MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  Identifiability& out = estimate.identifiability;
  out.of = static_cast<int>(k);
  if (k > kManyUnknowns) {
    const auto ends = extreme_eigenvalues(scaled);
    if (ends && (*ends)[0] > flat * (*ends)[1]) {
      out.rank = out.of;
      out.condition = (*ends)[1] / (*ends)[0];
      return sound;
    }
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const double largest = eigen.eigenvalues().maxCoeff();
  out.rank = 0;
  double smallest = largest;
  for (Index j = 0; j < k; ++j) {
    const double value = eigen.eigenvalues()[j];
    if (value > flat * largest) {
      ++out.rank;
      smallest = std::min(smallest, value);
      continue;
    }
    Identifiability::Direction direction;
    for (Index i = 0; i < k; ++i) {
      const double weight = eigen.eigenvectors()(i, j);
      EstimatedParameter& p = *free[i];
      if (std::abs(weight) < kPartOf || p.verdict == Verdict::unexcited) continue;
      direction.names.push_back(p.name);
      direction.weights.push_back(weight);
      p.verdict = Verdict::not_identifiable;
      sound[i] = false;
    }
    if (direction.names.empty()) continue;
    for (const std::string& name : direction.names) {
      auto p = std::find_if(free.begin(), free.end(),
                            [&name](const EstimatedParameter* q) { return q->name == name; });
      for (const std::string& other : direction.names) {
        auto& with = (*p)->with;
        if (other != name && std::find(with.begin(), with.end(), other) == with.end()) {
          with.push_back(other);
        }
      }
    }
    out.unidentifiable_directions.push_back(std::move(direction));
  }
  out.condition = out.rank == out.of && smallest > 0.0 ? largest / smallest : kNone;
  return sound;
}

}  // namespace

std::string to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::ok:
      return "ok";
    case Verdict::poorly_determined:
      return "poorly_determined";
    case Verdict::correlated:
      return "correlated";
    case Verdict::at_bound:
      return "at_bound";
    case Verdict::unexcited:
      return "unexcited";
    case Verdict::not_identifiable:
      return "not_identifiable";
    case Verdict::unfitted:
      return "unfitted";
    case Verdict::untrusted:
      return "untrusted";
  }
  return "";
}

namespace {

/// A serious finding is about all parameters, but for the one that knows which it is about. Of a
/// result that is rejected for another reason, as parameters that are not determined, those alone
/// count that would make it untrusted.
bool is_doubted(const std::string& parameter, const Findings& findings, Status status) {
  return std::any_of(findings.begin(), findings.end(), [&](const Finding& f) {
    if (f.severity != Severity::serious) return false;
    if (status != Status::untrusted && kind_of(f.code).effect != Status::untrusted) return false;
    const bool of_some = f.code == FindingCode::structure_dependent ||
                         f.code == FindingCode::several_maxima ||
                         f.code == FindingCode::weak_direction;
    return !of_some || std::find(f.about.begin(), f.about.end(), parameter) != f.about.end();
  });
}

}  // namespace

void conclude(Estimate& estimate, const std::string& message_when_ok, Basis basis) {
  Conclusion conclusion = conclude(estimate.findings, message_when_ok, basis);
  estimate.status = conclusion.status;
  estimate.message = std::move(conclusion.message);
  estimate.findings = std::move(conclusion.findings);
  if (estimate.status != Status::untrusted && estimate.status != Status::rejected) return;
  for (EstimatedParameter& p : estimate.parameters) {
    const bool doubted = is_doubted(p.name, estimate.findings, estimate.status);
    if (!p.fixed && p.verdict == Verdict::ok && doubted) p.verdict = Verdict::untrusted;
  }
}

std::vector<std::string> not_determined(const Estimate& estimate) {
  std::vector<std::string> out;
  for (const EstimatedParameter& p : estimate.parameters) {
    const bool open = p.verdict == Verdict::not_identifiable || p.verdict == Verdict::unexcited;
    if (open) out.push_back(p.name);
  }
  return out;
}

int exit_code(const Estimate& estimate, bool strict) {
  switch (estimate.status) {
    case Status::rejected:
    case Status::untrusted:
      return 1;
    case Status::not_converged:
      return 3;
    case Status::ok:
      break;
  }
  const bool warned = std::any_of(estimate.findings.begin(), estimate.findings.end(),
                                  [](const Finding& f) { return f.severity != Severity::note; });
  return strict && warned ? 4 : 0;
}

double relative_error(const EstimatedParameter& p) {
  const Unit unit = unit_or_dimensionless(p.unit);
  const double value = std::abs(unit.to_si(p.value));
  return value > 0.0 ? p.se * unit.scale / value : 0.0;
}

void judge_parameters(Estimate& estimate, const MatrixXd& information, const MatrixXd& covariance,
                      double quantile, double flat) {
  const std::vector<EstimatedParameter*> free = judged(estimate);
  const auto k = static_cast<Index>(free.size());
  if (information.rows() != k || information.cols() != k || covariance.rows() != k ||
      covariance.cols() != k) {
    throw std::invalid_argument("judge_parameters: matrices do not fit the free parameters");
  }
  if (k == 0) return;
  const std::vector<bool> sound = find_flat(estimate, free, information, flat);
  VectorXd se = VectorXd::Constant(k, kNone);
  for (Index i = 0; i < k; ++i) {
    EstimatedParameter& p = *free[i];
    if (!sound[i] || !(covariance(i, i) > 0.0)) continue;
    se[i] = std::sqrt(covariance(i, i));
    p.se = se[i];
    p.ci95 = {p.value - quantile * se[i], p.value + quantile * se[i]};
  }
  estimate.correlation = MatrixXd::Constant(k, k, kNone);
  estimate.correlation_names.clear();
  for (Index i = 0; i < k; ++i) {
    EstimatedParameter& p = *free[i];
    estimate.correlation_names.push_back(p.name);
    if (std::isnan(se[i])) continue;
    const double relative = relative_error(p);
    p.verdict = relative > 0.25 ? Verdict::poorly_determined : Verdict::ok;
    for (Index j = 0; j < k; ++j) {
      if (std::isnan(se[j])) continue;
      const double rho = covariance(i, j) / (se[i] * se[j]);
      estimate.correlation(i, j) = rho;
      // A strong correlation with small errors is harmless; with large ones it is the reason for
      // them.
      if (i != j && (std::abs(rho) > 0.99 || (std::abs(rho) > 0.9 && relative > 0.25))) {
        p.verdict = Verdict::correlated;
        p.with.push_back(free[j]->name);
      }
    }
  }
}

}  // namespace identikal
