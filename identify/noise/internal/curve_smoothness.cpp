#include "identify/noise/internal/curve_smoothness.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/estimate/none.h"
#include "lib/data/units.h"
#include "lib/model/spline_curve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostRounds = 40;
constexpr double kSettled = 0.005;  // of the free numbers
constexpr double kStraight = 1e-3;  // free numbers beyond a straight line that are none

// Of what the recordings do not determine the variance is large, and finite.
MatrixXd covariance_of(const MatrixXd& information) {
  constexpr double kDetermined = 1e-12;
  const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * information *
                                                      scale.asDiagonal());
  const VectorXd values = eigen.eigenvalues().cwiseMax(kDetermined);
  const MatrixXd root =
      scale.asDiagonal() * eigen.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal();
  return root * root.transpose();
}

// Positions of the curve's values among the free entries; -1: fixed.
std::vector<Index> entries_of(const SplineCurve& curve, const ParameterSet& parameters) {
  const std::vector<EntryDerivative> entries = entry_derivatives(parameters);
  std::vector<Index> out;
  for (const int value : curve.values) {
    const auto at = std::find_if(entries.begin(), entries.end(), [&](const EntryDerivative& e) {
      return static_cast<int>(e.parameter) == value;
    });
    out.push_back(at == entries.end() ? -1 : static_cast<Index>(at - entries.begin()));
  }
  return out;
}

MatrixXd part(const MatrixXd& covariance, const std::vector<Index>& entries) {
  const auto n = static_cast<Index>(entries.size());
  MatrixXd out = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      const Index a = entries[static_cast<std::size_t>(i)],
                  b = entries[static_cast<std::size_t>(j)];
      if (a >= 0 && b >= 0) out(i, j) = covariance(a, b);
    }
  }
  return out;
}

// What the recordings say of one curve's roughness at an optimum.
struct Roughness {
  double of_values = 0.0, of_errors = 0.0;  // f' R f, tr(R cov f)
  double rank = 0.0;
};

Roughness roughness_at(const SplineCurve& curve, const ParameterSet& at,
                       const MatrixXd& covariance) {
  const MatrixXd R = spline_roughness(curve.knots);
  VectorXd f(R.rows());
  for (Index k = 0; k < f.size(); ++k)
    f[k] = at[static_cast<std::size_t>(curve.values[static_cast<std::size_t>(k)])].value(0, 0);
  return {f.dot(R * f), R.cwiseProduct(part(covariance, entries_of(curve, at))).sum(),
          static_cast<double>(R.rows() - 2)};
}

}  // namespace

VectorXd learn_smoothness(SeveralStarts& found, RecordingsLikelihood& likelihood,
                          const FactorCoordinates& factors, const NoiseMlOptions& options) {
  const Model& model = likelihood.model();
  const auto n = static_cast<Index>(model.curves.size());
  VectorXd freedom = VectorXd::Constant(n, kNone), weights = VectorXd::Zero(n);
  const bool any = std::any_of(model.curves.begin(), model.curves.end(),
                               [](const SplineCurve& c) { return c.smooth; });
  for (int round = 0; any; ++round) {
    const ParameterSet at = with_coordinates(model.parameters, factors.to(found.best.x));
    const Likelihood* here = likelihood.evaluate(at, true);
    if (here == nullptr || found.best.summary.termination == Termination::stopped) break;
    const MatrixXd covariance = covariance_of(here->information);
    double change = 0.0;
    for (Index c = 0; c < n; ++c) {
      const SplineCurve& curve = model.curves[static_cast<std::size_t>(c)];
      if (!curve.smooth) continue;
      const Roughness rough = roughness_at(curve, at, covariance);
      const double g = std::clamp(rough.rank - weights[c] * rough.of_errors, 0.0, rough.rank);
      change = std::max(change, round == 0 ? 1.0 : std::abs(g + 2.0 - freedom[c]));
      freedom[c] = g + 2.0;
      if (g < kStraight && round > 0) continue;  // a straight line: more weight changes nothing
      const double next =
          round == 0 ? rough.rank / (rough.of_values + rough.of_errors) : g / rough.of_values;
      if (std::isfinite(next)) weights[c] = next;
    }
    if (change < kSettled) break;
    if (round == kMostRounds) {
      found.best.summary.termination = Termination::no_progress;
      found.best.summary.message = "the smoothness of the curves does not settle";
      break;
    }
    likelihood.weigh_roughness(weights);
    search_again(found, likelihood, factors, options);
    found.best_ends = {found.best.x};  // others were those of rougher curves
  }
  return freedom;
}

namespace {

// The values at the knots with their errors, in their unit.
struct AtKnots {
  VectorXd f;
  MatrixXd covariance;  // as reported: of fixed values none, of those not determined NaN
};

AtKnots at_knots(const SplineCurve& curve, const Estimate& estimate, const ParameterSet& end,
                 const Unit& unit) {
  const auto n = static_cast<Index>(curve.values.size());
  AtKnots out{VectorXd(n), MatrixXd::Zero(n, n)};
  VectorXd se = VectorXd::Zero(n);
  std::vector<Index> row;  // of the correlation; -1: in none
  for (Index i = 0; i < n; ++i) {
    const Parameter& p = end[static_cast<std::size_t>(curve.values[static_cast<std::size_t>(i)])];
    out.f[i] = unit.from_si(p.value(0, 0));
    const auto reported =
        std::find_if(estimate.parameters.begin(), estimate.parameters.end(),
                     [&](const EstimatedParameter& e) { return e.name == p.name; });
    if (!p.fixed && reported != estimate.parameters.end()) se[i] = reported->se;
    const auto& names = estimate.correlation_names;
    const auto at = std::find(names.begin(), names.end(), p.name);
    row.push_back(at == names.end() ? -1 : at - names.begin());
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      const Index a = row[static_cast<std::size_t>(i)], b = row[static_cast<std::size_t>(j)];
      const double together = i == j ? 1.0 : a >= 0 && b >= 0 ? estimate.correlation(a, b) : 0.0;
      out.covariance(i, j) = together == 0.0 ? 0.0 : together * se[i] * se[j];
    }
  }
  return out;
}

}  // namespace

void report_curves(Estimate& estimate, const Model& model, const ParameterSet& end,
                   const VectorXd& freedom) {
  constexpr Index kPoints = 61;
  for (std::size_t c = 0; c < model.curves.size(); ++c) {
    const SplineCurve& curve = model.curves[c];
    const std::string& unit = end[static_cast<std::size_t>(curve.values.front())].unit;
    const AtKnots knots = at_knots(curve, estimate, end, unit_or_dimensionless(unit));
    EstimatedCurve out{curve.name,        unit,
                       curve.axis,        curve.axis_unit,
                       VectorXd(kPoints), VectorXd(kPoints),
                       VectorXd(kPoints), freedom[static_cast<Index>(c)]};
    for (Index k = 0; k < kPoints; ++k) {
      const double z =
          curve.knots.back() * static_cast<double>(k) / static_cast<double>(kPoints - 1);
      const VectorXd weights = spline_weights(curve.knots, z);
      const double variance = weights.dot(knots.covariance * weights);
      out.at[k] = curve.origin + curve.distance * z;
      out.value[k] = weights.dot(knots.f);
      out.se[k] = std::isfinite(variance) ? std::sqrt(std::max(0.0, variance)) : kNone;
    }
    if (curve.smooth) {
      estimate.notes.push_back(fmt::format(
          "curve '{}': follows the data by {:.1f} free numbers of {}, as smooth as is likeliest",
          curve.name, out.freedom, curve.values.size()));
    }
    estimate.curves.push_back(std::move(out));
  }
}

}  // namespace identikal
