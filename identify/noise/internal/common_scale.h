// How large is all noise together, once everything else is given?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/noise/internal/covariance_factors.h"
#include "solvers/scoring.h"

namespace identikal {

/// The coordinates that all noise is proportional to, variances each of their own, with a start that
/// is proportional to them too: stationary or diffuse. With n values, S = sum e' Sigma^-1 e, and g
/// the slopes by those coordinates x,
///
///   S = n + 2 sum x g,   L = L_0 - (n log(S/n) - S + n)/2 at x S/n,
///
/// which is the maximum over their common size.
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
