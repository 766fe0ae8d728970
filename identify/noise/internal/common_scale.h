// How large is all noise together, once everything else is given?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/noise/internal/covariance_factors.h"
#include "solvers/scoring.h"

namespace identikal {

/// The coordinates that all noise is proportional to, variances each of their own, with a start that
/// is proportional to them too: stationary or diffuse. With n values and S = sum e' Sigma^-1 e,
///
///   L(c x) = L(x) - (n log c - S + S/c)/2,
///
/// so that L(x) and L(2 x) tell S, and the maximum over their common size lies at c = S/n.
class CommonScale {
 public:
  /// @param samples  values measured, n
  CommonScale(const Model& model, const FactorCoordinates& factors, double samples);

  /// Moves the point there. @return L, or -infinity where it is undefined; where the noise has no
  /// such coordinates the point stays
  double rescale(const LikelihoodProblem& problem, Eigen::VectorXd& at) const;

 private:
  std::vector<Eigen::Index> coordinates_;
  double samples_;
};

}  // namespace identikal
