// Matrix equations of linear systems.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

/// P = A P A' + W by doubling (Smith 1968): P <- P + A P A', A <- A A.
/// @param A  n x n
/// @param W  n x n, need not be symmetric
/// @return nothing when A is not stable (spectral radius >= 1 to working precision).
/// @throws std::invalid_argument when shapes disagree
std::optional<Eigen::MatrixXd> solve_discrete_lyapunov(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                                       const Eigen::Ref<const Eigen::MatrixXd>& W);

/// Steady state of the Kalman predictor: P = A P A' + G Q G' - K Sigma K', Sigma = C P C' + R,
/// K = (A P C' + G S) Sigma^-1.
struct SteadyState {
  Eigen::MatrixXd P;      ///< n x n
  Eigen::MatrixXd K;      ///< n x ny
  Eigen::MatrixXd Sigma;  ///< ny x ny
};

/// By structure-preserving doubling (Chu, Fan & Lin 2005), polished by Newton's method (Kleinman
/// 1968). Where none of them settles, and w and v are one noise whose predictor is stable: P = 0,
/// K = G S R^-1 (innovation form).
///
/// Example:
///
///     const std::optional<SteadyState> steady = steady_state(model);
///     if (steady) std::printf("tr P = %g\n", steady->P.trace());
///
/// @return nothing when no gain makes A - K C stable, or Sigma is singular.
std::optional<SteadyState> steady_state(const StateSpace& model);

}  // namespace identikal
