// How likely are the innovations that somebody's own filter left, and how does that change with its
// parameters?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"

namespace identikal {

/// What a filter made of its recordings, whatever filter it is.
struct Innovations {
  Eigen::MatrixXd e;  ///< ny x N: measured minus predicted; NaN = missing
  /// ny x ny covariances that the filter gave them: one per sample, or one for all.
  std::vector<Eigen::MatrixXd> Sigma;
};

/// Innovations on either side of the parameters, for differences: at x + up h and at x - down h.
struct InnovationsBeside {
  Innovations above, below;
  double distance = 0.0;  ///< between the two, > 0
};

/// -1/2 sum_t [ log|Sigma_t| + e_t' Sigma_t^-1 e_t + n_t log 2 pi ] over the channels present and,
/// with k parameters' neighbours, its gradient from the differences de, dSigma of the innovations
/// and the information sum_t [ 1/2 tr(Sigma^-1 dSigma_i Sigma^-1 dSigma_j) + de_i' Sigma^-1 de_j ].
///
/// Example:
///
///     const Eigen::MatrixXd Sigma = e * e.transpose() / e.cols();
///     const Likelihood at = innovations_likelihood({.e = e, .Sigma = {Sigma}});
///
/// @param score_products  k x k, written when not null: sum_t s_t s_t' (lib/filter/kalman.h)
/// @return FilterStatus::indefinite where a covariance is not positive definite, not_finite where
///   numbers are not
/// @throws std::invalid_argument when shapes disagree
Likelihood innovations_likelihood(const Innovations& at,
                                  const std::vector<InnovationsBeside>& beside = {},
                                  Eigen::MatrixXd* score_products = nullptr);

}  // namespace identikal
