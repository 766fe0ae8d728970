#include "identify/colour/internal/likelihood.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "identify/filter/recordings_likelihood.h"
#include "solvers/scoring.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Where each filter's own parameters begin among `all`: they are the last, filter by filter.
std::vector<Index> filters_begin(const ShapingStructure& structure, Index all) {
  std::vector<Index> out;
  const auto count = static_cast<Index>(structure.channels.size());
  for (Index c = 0; c < count; ++c) out.push_back(all - (count - c) * structure.unknowns());
  return out;
}

// Begin and length of each filter's denominator and numerator, in that order.
std::vector<std::pair<Index, Index>> polynomials(const ShapingStructure& structure, Index all) {
  std::vector<std::pair<Index, Index>> out;
  for (const Index begin : filters_begin(structure, all)) {
    const Index poles = begin + (structure.own_variance() ? 1 : 0);
    out.emplace_back(poles, structure.order);
    out.emplace_back(poles + structure.order, structure.zeros());
  }
  return out;
}

// Free variances times their factors: the diagonal of a matrix-valued parameter, or the scalar that
// stands first on the diagonal.
void scale_variances(Model& model, const ParametrisedMatrix& matrix, const VectorXd& factor) {
  if (matrix.block >= 0) {
    Parameter& p = model.parameters[matrix.block];
    const VectorXd root = factor.cwiseSqrt();
    if (p.fixed) return;
    if (p.domain == Domain::scaled_identity) {
      p.value *= factor.mean();
    } else {
      p.value = root.asDiagonal() * p.value * root.asDiagonal();
    }
    return;
  }
  std::vector<bool> done(model.parameters.size(), false);
  for (const ParametrisedMatrix::Entry& e : matrix.entries) {
    const auto at = static_cast<std::size_t>(e.parameter);
    Parameter& p = model.parameters[at];
    if (p.fixed || e.row != e.col || done[at]) continue;
    done[at] = true;
    p.value(0, 0) = std::clamp(p.scalar() * factor[e.row], p.min, p.max);
  }
}

}  // namespace

Model shaped_start(const Model& base, const SpectralSolution& spectral) {
  Model scaled = base;
  scale_variances(scaled, as_linear(base).Q, spectral.scale_Q);
  scale_variances(scaled, as_linear(base).R, spectral.scale_R);
  return with_shaping_filters(scaled, spectral.structure.source, spectral.channels);
}

std::optional<Model> maximise_shaped(const Model& shaped, const ShapingStructure& structure,
                                     const std::vector<Dataset>& recordings) {
  RecordingsLikelihood likelihood(shaped, recordings);
  likelihood.condition_on_beginning();
  const LikelihoodProblem plain = likelihood.problem();
  VectorXd z = coordinates(shaped.parameters);
  const std::vector<std::pair<Index, Index>> parts = polynomials(structure, z.size());
  LikelihoodProblem problem = plain;
  for (const auto& [begin, length] : parts) {
    const VectorXd zeta = stable_coordinates(z.segment(begin, length));
    if (!zeta.allFinite()) return std::nullopt;
    z.segment(begin, length) = zeta.cwiseMax(-kFarthestZeta).cwiseMin(kFarthestZeta);
    problem.lower.segment(begin, length).setConstant(-kFarthestZeta);
    problem.upper.segment(begin, length).setConstant(kFarthestZeta);
  }
  problem.evaluate = [&](const VectorXd& at, double& L, VectorXd* g, MatrixXd* J) {
    VectorXd x = at;
    MatrixXd M = MatrixXd::Identity(at.size(), at.size()), block;
    for (const auto& [begin, length] : parts) {
      x.segment(begin, length) = stable_polynomial(at.segment(begin, length), &block);
      M.block(begin, begin, length, length) = block;
    }
    if (!plain.evaluate(x, L, g, J)) return false;
    if (g != nullptr) *g = M.transpose() * *g;
    if (J != nullptr) *J = M.transpose() * *J * M;
    return true;
  };
  // Filters with a pole or zero too many have a ridge for a maximum: its height is known early.
  SolverOptions solver;
  solver.max_iterations = 40;
  solver.decrement_tolerance = 1e-5;
  Solution solution = maximise(problem, z, solver);
  if (!std::isfinite(solution.summary.objective)) return std::nullopt;
  for (const auto& [begin, length] : parts) {
    solution.x.segment(begin, length) = stable_polynomial(solution.x.segment(begin, length));
  }
  Model out = shaped;
  out.parameters = with_coordinates(shaped.parameters, solution.x);
  return out;
}

std::vector<ShapingFilter> filters_of(const ParameterSet& parameters,
                                      const ShapingStructure& structure) {
  VectorXd all(static_cast<Index>(parameters.size()));
  for (Index i = 0; i < all.size(); ++i) {
    all[i] = parameters[i].scalar();
  }
  const std::vector<std::pair<Index, Index>> parts = polynomials(structure, all.size());
  std::vector<ShapingFilter> out;
  for (std::size_t p = 0; p < parts.size(); p += 2) {
    out.push_back({all.segment(parts[p].first, parts[p].second),
                   all.segment(parts[p + 1].first, parts[p + 1].second)});
  }
  return out;
}

}  // namespace identikal
