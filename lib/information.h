// How much will a recording tell about the parameters? The Fisher information of a model's own
// output, before any data; its inverse is the Cramer-Rao bound.
#pragma once

#include <optional>
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
/// covariance of [x, dx/d(theta_1), ..., dx/d(theta_k)], which the innovations drive. Where only
/// noise changes, x takes no part, and the covariances of pairs of dx/d(theta) follow from one
/// recursion of n x n, backwards: k parameters of a large system are then as many times n x n, not
/// the square of it. A diffuse start has no expectation of its own (what the first samples say of
/// the state has no size): all samples are then counted with the steady filter, started at zero.
/// @param derivatives  d(model)/d(theta_i), i = 1..k, of constant size
/// @param u  nu x samples, or empty for inputs that are zero; inputs are known, and what they
/// excite
///   adds information
/// @return status unstable when a stationary start or, with a diffuse one, a steady filter does not
///   exist; indefinite and not_finite as kalman_filter().
/// @throws std::invalid_argument when shapes disagree or samples < 1.
/// Source: Cavanaugh & Shumway (1996), "On computing the expected Fisher information matrix for
/// state-space model parameters". The bound of Matisko (2013), chapter 6, is another one: see
/// complete_data_information().
ExpectedInformation expected_information(const StateSpace& model, InitialState initial,
                                         Eigen::Index samples,
                                         const std::vector<StateSpace>& derivatives,
                                         const Eigen::Ref<const Eigen::MatrixXd>& u);

/// The steady gain and its derivatives, by the derivative of the Riccati equation.
struct GainSensitivity {
  Eigen::MatrixXd P;                     ///< n x n, of the state's prediction error
  Eigen::MatrixXd Sigma;                 ///< ny x ny, of the innovations
  Eigen::MatrixXd K;                     ///< n x ny
  std::vector<Eigen::MatrixXd> K_theta;  ///< k of n x ny
};
/// @return nothing where steady_state() does not exist. Source: Matisko (2013), (4.33).
std::optional<GainSensitivity> steady_gain_sensitivity(const StateSpace& model,
                                                       const std::vector<StateSpace>& derivatives);

/// What errors of noise parameters cost the filter that is built with them: how much of its
/// prediction error, in the mean, is due to them, tr X / tr P. The steady gain is off by
/// dK = sum_i K_i dtheta_i, and the prediction error's covariance exceeds the optimal P by
///
///   X = F X F' + E dK Sigma dK',  E dK Sigma dK' = sum_ij Cov_ij K_i Sigma K_j',  F = A - K C,
///
/// up to third order in dtheta: P is the least that any gain gives, so the first order vanishes.
/// @param gain        of the model, with the derivatives by its k parameters, none of which changes
///   anything but noise (a wrong A is not a wrong gain alone)
/// @param covariance  k x k, of the errors
/// @return nothing when tr P is zero
/// Source: the exact difference X = (F - dK C) X (F - dK C)' + dK Sigma dK' of two Lyapunov
/// equations, as in Kleinman (1968).
/// @throws std::invalid_argument when shapes disagree
std::optional<double> expected_filter_loss(const StateSpace& model, const GainSensitivity& gain,
                                           const Eigen::Ref<const Eigen::MatrixXd>& covariance);

/// The information per sample about the noise if the states were observed too,
///   J_ij = 1/2 tr(V^-1 dV_i V^-1 dV_j), V = [Q S; S' R]:
/// no method reaches it from outputs alone. Zero for parameters that are not of the noise.
/// @return nothing where V is singular. Source: Matisko (2013), (6.36), for matrices.
std::optional<Eigen::MatrixXd> complete_data_information(
    const StateSpace& model, const std::vector<StateSpace>& derivatives);

}  // namespace identikal
