#include "identify/population/mixed_effects.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SparseCore>

#include "identify/estimate/distribution.h"
#include "identify/estimate/none.h"
#include "identify/population/internal/marginal_likelihood.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostObserved = 60;  // directions of differences

void check(const MixedEffectsProblem& problem, const MixedEffectsStart& start) {
  const Index n = problem.data.lower.size(), q = problem.effects.rows();
  const auto p = static_cast<Index>(problem.shared.size());
  const bool sizes =
      p + problem.effects.size() == n && start.shared.size() == p && start.mean.size() == q &&
      start.spread.size() == q && q > 0 && static_cast<Index>(problem.logarithmic.size()) == q &&
      (problem.unit_of_shared.empty() || problem.unit_of_shared.size() == problem.shared.size());
  if (!sizes) throw std::invalid_argument("mixed effects: sizes disagree");
  if (problem.effects.cols() < 2)
    throw std::invalid_argument("mixed effects: fewer than two units");
  if (!(start.spread.minCoeff() > 0.0) || !start.spread.allFinite()) {
    throw std::invalid_argument("mixed effects: a spread that is not positive");
  }
}

// By shared, mean, and the standard deviations.
Eigen::SparseMatrix<double> by_deviations(const MarginalLikelihood& marginal, const VectorXd& psi,
                                          Index p, Index q) {
  const Index n = psi.size(), s = n - p - q;
  MatrixXd T = MatrixXd::Zero(p + 2 * q, n);
  T.topLeftCorner(p + q, p + q).setIdentity();
  const MatrixXd L = marginal.spread().root(psi.tail(s));
  const std::vector<MatrixXd> slopes = marginal.spread().root_slopes(psi.tail(s));
  for (Index c = 0; c < s; ++c) {
    for (Index j = 0; j < q; ++j) {
      T(p + q + j, p + q + c) =
          slopes[static_cast<std::size_t>(c)].row(j).dot(L.row(j)) / L.row(j).norm();
    }
  }
  return T.sparseView();
}

std::optional<MatrixXd> observed_at(const LikelihoodProblem& problem, const VectorXd& psi,
                                    const std::vector<Index>& inside, const MatrixXd& expected,
                                    const std::vector<Index>& unit) {
  VectorXd step(static_cast<Index>(inside.size()));
  for (Index e = 0; e < step.size(); ++e) {
    const Index at = inside[static_cast<std::size_t>(e)];
    step[e] = std::min({3e-3 / std::sqrt(std::max(expected(at, at), 1e-300)),
                        0.5 * (psi[at] - problem.lower[at]), 0.5 * (problem.upper[at] - psi[at])});
  }
  const auto gradient_at = [&](const VectorXd& x, VectorXd& g) {
    VectorXd whole = psi, all;
    whole(inside) = x;
    double ignored = 0.0;
    if (!problem.evaluate(whole, ignored, &all, nullptr)) return false;
    g = all(inside);
    return true;
  };
  return observed_information(gradient_at, psi(inside), step, unit);
}

// The information at the maximum on what is not at a bound; the others have no error.
MatrixXd covariance_of(MarginalLikelihood& marginal, const VectorXd& psi, bool& is_observed) {
  const LikelihoodProblem problem = marginal.problem();
  double M = 0.0;
  VectorXd gradient;
  MatrixXd expected;
  if (!problem.evaluate(psi, M, &gradient, &expected)) return {};
  std::vector<Index> inside;
  for (Index e = 0; e < psi.size(); ++e) {
    const double room = std::min(psi[e] - problem.lower[e], problem.upper[e] - psi[e]);
    const bool at_bound = !(room > 1e-3 / std::sqrt(std::max(expected(e, e), 1e-300)));
    if (!at_bound) inside.push_back(e);
  }
  if (inside.empty()) return {};
  const std::vector<Index>& of_shared = marginal.unit_of_shared();
  std::vector<Index> unit;
  for (const Index e : inside) {
    const auto k = static_cast<std::size_t>(e);
    unit.push_back(k < of_shared.size() ? of_shared[k] : -1);
  }
  std::optional<MatrixXd> inverse;
  if (moved_together(unit).size() <= kMostObserved) {
    const auto observed = observed_at(problem, psi, inside, expected, unit);
    if (observed) inverse = scaled_inverse(*observed, 1e-10);
  }
  is_observed = inverse.has_value();
  if (!inverse) inverse = scaled_inverse(expected(inside, inside), 1e-10);
  if (!inverse) return {};
  MatrixXd out = MatrixXd::Zero(psi.size(), psi.size());
  out(inside, inside) = *inverse;
  return out;
}

MarginalEstimate around(double value, double se, double quantile) {
  return {value, se, value - quantile * se, value + quantile * se};
}

// The largest variance that a likelihood that falls from its end with this slope and information
// does not rule out (one-sided 95 %).
double upper_limit_of_variance(double slope, double information) {
  constexpr double kDrop = 1.352772;  // half the square of 1.6449
  const double g = std::max(0.0, -slope);
  return (-g + std::sqrt(g * g + 2.0 * kDrop * information)) / information;
}

void take_spreads(MarginalLikelihood& marginal, const VectorXd& psi,
                  const MixedEffectsProblem& problem, const VectorXd& se, MixedEffects& out) {
  const double quantile = normal_quantile(0.975);
  const Index p = static_cast<Index>(problem.shared.size()), q = problem.effects.rows();
  const VectorXd c = psi.tail(marginal.spread().size());
  double M = 0.0;
  VectorXd gradient;
  MatrixXd information;
  const bool known = marginal.evaluate(psi, M, &gradient, &information);
  for (Index j = 0; j < q; ++j) {
    const bool zero = marginal.spread().at_zero(c, j);
    out.spread_at_zero.push_back(zero);
    MarginalEstimate of;
    if (zero) {
      of = {0.0, kNone, 0.0, kNone};
      const Index e = p + q + j;  // diagonal: its variance
      if (known && !problem.correlated && information(e, e) > 0.0) {
        of.high = std::sqrt(upper_limit_of_variance(gradient[e], information(e, e)));
      }
    } else {
      const double sd = std::sqrt(out.Omega(j, j)), error = se.size() > 0 ? se[p + q + j] : kNone;
      of = {sd, error, sd * std::exp(-quantile * error / sd), sd * std::exp(quantile * error / sd)};
    }
    out.spread.push_back(of);
  }
}

void take_correlations(const MarginalLikelihood& marginal, const VectorXd& psi,
                       const MatrixXd& covariance, MixedEffects& out) {
  const Index q = out.Omega.rows(), s = marginal.spread().size();
  const MatrixXd L = marginal.spread().root(psi.tail(s));
  const std::vector<MatrixXd> slopes = marginal.spread().root_slopes(psi.tail(s));
  for (Index j = 0; j < q; ++j) {
    for (Index i = j + 1; i < q; ++i) {
      const double ii = out.Omega(i, i), jj = out.Omega(j, j);
      const double r = out.Omega(i, j) / std::sqrt(ii * jj);
      VectorXd by(s);
      for (Index c = 0; c < s; ++c) {
        const MatrixXd& dL = slopes[static_cast<std::size_t>(c)];
        const MatrixXd d = dL * L.transpose() + L * dL.transpose();
        by[c] = d(i, j) / std::sqrt(ii * jj) - 0.5 * r * (d(i, i) / ii + d(j, j) / jj);
      }
      MarginalEstimate of{r, kNone, kNone, kNone};
      if (covariance.size() > 0) {
        of.se = std::sqrt(by.dot(covariance.bottomRightCorner(s, s) * by));
        const double half = normal_quantile(0.975) * of.se / (1.0 - r * r);
        of.low = std::tanh(std::atanh(r) - half);
        of.high = std::tanh(std::atanh(r) + half);
      }
      out.correlation.push_back(of);
    }
  }
}

// Each unit's most probable effects, their errors, and how far from the others they are.
void take_units(const MarginalLikelihood& marginal, const MatrixXd& covariance, MixedEffects& out) {
  const MatrixXd& Z = marginal.standardised();
  out.effects = marginal.effects();
  out.effects_se.resize(Z.rows(), Z.cols());
  out.p_value.resize(Z.cols());
  for (Index i = 0; i < Z.cols(); ++i) {
    const auto unit = static_cast<std::size_t>(i);
    MatrixXd V = marginal.conditional_covariance(i);
    const MatrixXd& S = marginal.moves(i);
    const std::vector<Index> by = marginal.concerning(i);
    if (covariance.size() > 0) V += S * covariance(by, by) * S.transpose();
    out.effects_se.col(i) = V.diagonal().cwiseMax(0.0).cwiseSqrt();
    // Of effects drawn from the population the most probable ones scatter by 1 - H^-1.
    const MatrixXd scatter = MatrixXd::Identity(Z.rows(), Z.rows()) - marginal.H()[unit].inverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scatter);
    const VectorXd along = eigen.eigenvectors().transpose() * Z.col(i);
    double square = 0.0, freedom = 0.0;
    for (Index j = 0; j < along.size(); ++j) {
      constexpr double kTold = 0.05;  // of a unit that says less of an effect nothing is known
      if (eigen.eigenvalues()[j] < kTold) continue;
      square += along[j] * along[j] / eigen.eigenvalues()[j];
      freedom += 1.0;
    }
    out.p_value[i] = freedom > 0.0 ? chi_square_upper_tail(square, freedom) : 1.0;
  }
}

}  // namespace

MixedEffects maximise_marginal(const MixedEffectsProblem& problem, const MixedEffectsStart& start,
                               const SolverOptions& options, bool with_errors) {
  check(problem, start);
  MarginalLikelihood marginal(problem, start);
  const Index p = start.shared.size(), q = start.mean.size(), U = problem.effects.cols();
  const Solution found = maximise(marginal.problem(), marginal.start(start), options);
  MixedEffects out;
  out.summary = found.summary;
  double M = 0.0;
  VectorXd gradient;
  if (!marginal.evaluate(found.x, M, &gradient, nullptr)) return out;
  const MatrixXd L = marginal.spread().root(found.x.tail(marginal.spread().size()));
  out.Omega = L * L.transpose();
  MatrixXd covariance;
  if (with_errors && found.summary.usable())
    covariance = covariance_of(marginal, found.x, out.observed);
  VectorXd se;
  if (covariance.size() > 0) {
    const Eigen::SparseMatrix<double> T = by_deviations(marginal, found.x, p, q);
    out.covariance = MatrixXd(T * covariance) * T.transpose();
    se = out.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  }
  const auto error_of = [&](Index e) { return se.size() > 0 ? se[e] : kNone; };
  for (Index k = 0; k < p; ++k) {
    out.shared.push_back(around(found.x[k], error_of(k), normal_quantile(0.975)));
  }
  const double t = student_t_quantile(0.975, static_cast<double>(U - 1));
  for (Index j = 0; j < q; ++j) out.mean.push_back(around(found.x[p + j], error_of(p + j), t));
  take_spreads(marginal, found.x, problem, se, out);
  if (!marginal.evaluate(found.x, M, &gradient, nullptr)) return out;
  if (problem.correlated) take_correlations(marginal, found.x, covariance, out);
  take_units(marginal, covariance, out);
  out.x = marginal.coordinates(found.x);
  out.summary.evaluations = marginal.evaluations();
  return out;
}

}  // namespace identikal
