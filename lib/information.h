// How much will a recording tell about the parameters? The Fisher information of a model's own
// output, before any data; its inverse is the Cramer-Rao bound.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/kalman.h"

namespace identikal {

struct ExpectedInformation {
  FilterStatus status = FilterStatus::ok;
  Eigen::MatrixXd total;       ///< k x k, of all samples
  Eigen::MatrixXd per_sample;  ///< k x k, what every further sample adds once the filter is steady;
                               ///< empty when it does not become so within the samples
};

/// The Fisher information of `samples` samples of the model's output,
///
///   J_ij = sum_t [ 1/2 tr(Sigma^-1 dSigma_i Sigma^-1 dSigma_j) + E de_i' Sigma^-1 de_j ],
///
/// exact for a start that is stationary or given. The expectation is taken by running the
/// covariance of [x, dx/d(theta_1), ..., dx/d(theta_k)], which the innovations drive. A diffuse
/// start has no expectation of its own (what the first samples say of the state has no size): all
/// samples are then counted with the steady filter, started at zero.
/// @param derivatives  d(model)/d(theta_i), i = 1..k, of constant size
/// @param u            nu x samples; inputs are known, and what they excite adds information
/// @return status unstable when a stationary start or, with a diffuse one, a steady filter does not
///   exist; indefinite and not_finite as kalman_filter().
/// @throws std::invalid_argument when shapes disagree or samples < 1.
/// Source: Matisko (2013), section 4.4 has the complete-data bound; this is the bound from outputs
/// alone, by the innovations form of the likelihood (Cavanaugh & Shumway 1996, "On computing the
/// expected Fisher information matrix for state-space model parameters").
ExpectedInformation expected_information(const StateSpace& model, InitialState initial,
                                         Eigen::Index samples,
                                         const std::vector<StateSpace>& derivatives,
                                         const Eigen::Ref<const Eigen::MatrixXd>& u);

}  // namespace identikal
