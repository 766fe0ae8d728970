#include "identify/noise/internal/likelihood_errors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SparseCore>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/model/own_parameters.h"
#include "identify/model/row_order.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/coloured_errors.h"
#include "identify/noise/internal/free_directions.h"
#include "identify/noise/internal/profiled_noise.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFlatRegression = 1e-12;

// Minus the second derivatives by the directions' numbers.
std::optional<MatrixXd> observed(RecordingsLikelihood& likelihood, const LikelihoodProblem& problem,
                                 const ParameterSet& end, const FreeDirections& free,
                                 const VectorXd& best, const MatrixXd& bound) {
  const VectorXd z = free.entries(VectorXd::Zero(free.size()));
  VectorXd step(free.size());
  for (Index j = 0; j < free.size(); ++j) {
    // Small against the error, but never across a bound.
    step[j] = 1e-3 * std::sqrt(bound(j, j));
    const Index i = free.number(j);
    if (i < 0 || z[i] != best[i]) continue;
    step[j] = std::min({step[j], 0.5 * (z[i] - problem.lower[i]), 0.5 * (problem.upper[i] - z[i])});
  }
  const auto gradient_at = [&](const VectorXd& t, VectorXd& g) {
    const Likelihood* there = likelihood.evaluate(with_entries(end, free.entries(t)), true);
    if (there == nullptr) return false;
    g = free.jacobian(t).transpose() * there->gradient;
    return true;
  };
  const std::vector<Index> owners = owners_of_entries(likelihood.model(), likelihood.recordings());
  std::vector<Index> owner;
  for (Index j = 0; j < free.size(); ++j) {
    const Index entry = free.number(j);
    owner.push_back(entry < 0 ? -1 : owners[static_cast<std::size_t>(entry)]);
  }
  return observed_information(gradient_at, VectorXd::Zero(free.size()), step, owner);
}

// JudgedMaximum::excess where every direction is a number of its own.
MatrixXd excess_of(const MatrixXd& observed, const MatrixXd& expected, const FreeDirections& free) {
  MatrixXd out = MatrixXd::Zero(expected.rows(), expected.cols());
  for (Index a = 0; a < free.size(); ++a) {
    for (Index b = 0; b < free.size(); ++b) {
      const Index i = free.number(a), j = free.number(b);
      const double scale = std::sqrt(expected(i, i) * expected(j, j));
      if (scale > 0.0) out(i, j) = (observed(a, b) - expected(i, j)) / scale;
    }
  }
  return out;
}

using Sparse = Eigen::SparseMatrix<double>;

// by M by', of entries most of which are directions of their own.
MatrixXd by_entries(const MatrixXd& by, const MatrixXd& M) {
  const Sparse sparse = by.sparseView();
  return MatrixXd(sparse * M) * sparse.transpose();
}

// Standard deviations by the sandwich C P C, carried over to the entries.
// @param by  the entries' derivatives by the directions
VectorXd sandwich_errors(const MatrixXd& by, const MatrixXd& C, const MatrixXd& P) {
  const MatrixXd half = Sparse(by.sparseView()) * C;
  const MatrixXd weighted = half * Sparse(P.sparseView());
  return weighted.cwiseProduct(half).rowwise().sum().cwiseSqrt();
}

// The inverse along the directions that are determined: what lies outside the others keeps its error.
MatrixXd inverse_of_determined(const MatrixXd& information, double flat) {
  const VectorXd diagonal = information.diagonal();
  const VectorXd by = (diagonal.array() > 0.0).select(diagonal.cwiseSqrt().cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(by.asDiagonal() * information *
                                                     by.asDiagonal());
  VectorXd inverse = axes.eigenvalues();
  const double floor = flat * std::max(1e-300, inverse.maxCoeff());
  for (double& value : inverse) value = value > floor ? 1.0 / value : 0.0;
  const MatrixXd half = by.asDiagonal() * axes.eigenvectors();
  return half * inverse.asDiagonal() * half.transpose();
}

// The size of each where every entry is a direction of its own; else nothing.
VectorXd own_directions(const MatrixXd& by) {
  const bool own = by.rows() == by.cols() && MatrixXd(by.diagonal().asDiagonal()) == by &&
                   !(by.diagonal().array() == 0.0).any();
  return own ? VectorXd(by.diagonal()) : VectorXd();
}

// Information by the entries, from that by the directions: those in which nothing may move are
// known as well as the others. @param by  the entries' derivatives by the directions
MatrixXd information_of_entries(const MatrixXd& by, const MatrixXd& information,
                                const MatrixXd& covariance) {
  const VectorXd own = own_directions(by);
  if (own.size() > 0) {
    const VectorXd inverse = own.cwiseInverse();
    return inverse.asDiagonal() * information * inverse.asDiagonal();
  }
  VectorXd se = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  for (Index i = 0; i < se.size(); ++i) {
    if (!(se[i] > 0.0)) se[i] = by.row(i).cwiseAbs().maxCoeff();
  }
  const MatrixXd scaled = se.cwiseInverse().asDiagonal() * by;
  const MatrixXd back = scaled.completeOrthogonalDecomposition().pseudoInverse();
  const MatrixXd held = MatrixXd::Identity(by.rows(), by.rows()) - scaled * back;
  const MatrixXd out = back.transpose() * information * back + held;
  return se.cwiseInverse().asDiagonal() * out * se.cwiseInverse().asDiagonal();
}

}  // namespace

namespace {

// Which free entries are sizes of the noise, and is nothing else known of it? Nothing: no.
std::optional<std::set<Index>> sizes_of_noise(const Model& model,
                                              const std::vector<Dataset>& recordings) {
  std::set<Index> out;
  for (const Dataset& recording : recordings) {
    const bool own = !recording.own.empty();
    const std::optional<NoiseScales> scales =
        noise_scales(own ? model_in(model, recording) : model);
    if (!scales) return std::nullopt;
    const std::vector<Index> joint = own ? joint_entries(model, recording) : std::vector<Index>();
    for (const Index i : scales->scales) out.insert(own ? joint[static_cast<std::size_t>(i)] : i);
    if (model.recordings.empty()) break;  // the others are the same
  }
  return out;
}

}  // namespace

double residual_freedom(const Model& model, const std::vector<Dataset>& recordings, Index samples) {
  const auto sizes = sizes_of_noise(model, recordings);
  if (!sizes || sizes->empty()) return kNone;
  const auto others = free_entries(model.parameters).size() - static_cast<Index>(sizes->size()) -
                      model.constraints.equalities();
  const auto out = static_cast<double>(samples - others);
  return out >= 1.0 ? out : kNone;
}

JudgedMaximum judge_maximum(Estimate& estimate, RecordingsLikelihood& likelihood,
                            const LikelihoodProblem& problem, const ParameterSet& end,
                            const VectorXd& best, const std::vector<RootsOnCircle>& polynomials,
                            const SimulationScore* score, double freedom) {
  const Likelihood* result = likelihood.evaluate(end, true);
  if (result == nullptr) return {};
  const MatrixXd all = result->information;
  const VectorXd z = free_entries(end);
  std::vector<bool> at_bound;
  for (Index i = 0; i < z.size(); ++i) {
    at_bound.push_back(best[i] <= problem.lower[i] || best[i] >= problem.upper[i]);
  }
  const std::vector<CovarianceEntries> covariances = all_covariances(likelihood.model());
  const FreeDirections free(z, at_bound, covariances, polynomials, result->gradient, all);
  const MatrixXd by = free.jacobian(VectorXd::Zero(free.size()));
  for (Index i = 0; i < z.size(); ++i) at_bound[i] = by.row(i).isZero(0.0);
  const InteriorParameters inside = interior_parameters(estimate, at_bound);
  const auto k = static_cast<Index>(inside.entries.size());
  JudgedMaximum out{free.singular(), {}};
  if (k == 0) return out;

  const MatrixXd information = by_entries(by.transpose(), all);
  const MatrixXd in_units =
      inside.unit.cwiseInverse().asDiagonal() * MatrixXd(by(inside.entries, Eigen::all));
  const auto of_entries = [&](const MatrixXd& covariance) {
    return by_entries(in_units, covariance);
  };
  MatrixXd covariance;
  // Slopes of a regression are exact to rounding, and so is what they do not determine.
  const double flat = rows_have_no_order(likelihood.model(), end) ? kFlatRegression : kFlat;
  const std::optional<MatrixXd> bound = scaled_inverse(information, flat);
  // Those of a simulation are least squares too; and where its equations have kinks, as of dead zones
  // and limits, second differences say next to nothing.
  const bool by_slopes = std::isfinite(freedom) || score != nullptr;
  if (bound && by_slopes) {
    covariance = *bound;
    estimate.covariance_kind = "expected information";
  } else if (bound) {
    const auto second = observed(likelihood, problem, end, free, best, *bound);
    const auto inverse = second ? scaled_inverse(*second) : std::nullopt;
    covariance = inverse ? *inverse : *bound;
    if (inverse && covariances.empty() && polynomials.empty())
      out.excess = excess_of(*second, all, free);
    estimate.covariance_kind = inverse ? "observed information"
                                       : "expected information (the observed one is not "
                                         "positive definite)";
  } else {
    estimate.covariance_kind = "partial: some directions carry no information";
    covariance = inverse_of_determined(information, flat);
  }
  double quantile = normal_quantile(0.975);
  if (std::isfinite(freedom)) {
    covariance *= static_cast<double>(likelihood.samples()) / freedom;
    estimate.covariance_freedom = freedom;
    quantile = student_t_quantile(0.975, freedom);
    estimate.covariance_kind += fmt::format(", noise from {:.0f} degrees of freedom", freedom);
  }
  const bool coloured_errors = score != nullptr && score->by_sample.size() > 0;
  if (coloured_errors && bound) {
    const ColouredCovariance coloured = coloured_covariance(covariance, *score, by);
    covariance = coloured.covariance;
    estimate.covariance_freedom = coloured.freedom;
    quantile = student_t_quantile(0.975, coloured.freedom);
    estimate.covariance_kind +=
        fmt::format(", errors correlated over {} samples allowed for", coloured.bandwidth);
  }
  judge_parameters(estimate, information_of_entries(in_units, information, of_entries(covariance)),
                   of_entries(covariance), quantile, flat);
  if (!bound || coloured_errors) return out;
  const MatrixXd products = likelihood.score_products(end);
  if (products.size() > 0) {
    const VectorXd se = sandwich_errors(in_units, covariance, by_entries(by.transpose(), products));
    for (Index j = 0; j < k; ++j) {
      EstimatedParameter& p = *inside.reported[j];
      if (!std::isnan(p.se)) p.se_sandwich = se[j];
    }
  }
  const MatrixXd crb = of_entries(*bound);
  for (Index j = 0; j < k; ++j) inside.reported[j]->crb_se = std::sqrt(crb(j, j));
  return out;
}

}  // namespace identikal
