// How much will a recording tell about the parameters? The Fisher information of a model's own
// output, before any data; its inverse is the Cramer-Rao bound.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"

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
/// the square of it. A diffuse start, in some states or all, has no expectation of its own (what the first samples say of
/// the state has no size): all samples are then counted with the steady filter, started at zero.
///
/// Example:
///
///     const auto J =
///         expected_information(model, InitialState::stationary, u.cols(), derivatives, u);
///     const Eigen::VectorXd least_sd = J.total.inverse().diagonal().cwiseSqrt();  // Cramer-Rao
///
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

/// The steady gain and innovation covariance and their derivatives, by the derivative of the
/// Riccati equation.
struct GainSensitivity {
  Eigen::MatrixXd P;                         ///< n x n, of the state's prediction error
  Eigen::MatrixXd Sigma;                     ///< ny x ny, of the innovations
  Eigen::MatrixXd K;                         ///< n x ny
  std::vector<Eigen::MatrixXd> K_theta;      ///< k of n x ny
  std::vector<Eigen::MatrixXd> Sigma_theta;  ///< k of ny x ny
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
/// @param gain        of the model, with the derivatives with respect to its k parameters, none of
///   which changes anything but noise (a wrong A is not a wrong gain alone)
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

/// The information per sample about K and Sigma themselves, of the innovation form
///   x+ = A x + B u + K e, y = C x + D u + e, cov e = Sigma,
/// from outputs alone, A, B, C and D known: with O = F' O F + C' Sigma^-1 C and F = A - K C
///   J = [ Sigma (x) O            0               ]   K column by column,
///       [ 0           1/2 tr(Sigma^-1 dSigma ..) ]   Sigma's lower triangle column by column.
/// Its inverse bounds K and Sigma, not Q and R: K by Sigma^-1 (x) O^-1 / N, of one state and output
/// (1 - (a - k)^2) / N; Sigma(i,j) by (Sigma(i,j)^2 + Sigma(i,i) Sigma(j,j)) / N. With T the
/// derivatives of K and Sigma by parameters of the noise, T' J T is their steady information; where
/// T is square and regular, T^-1 J^-1 T^-T is their bound (delta method). Inputs add nothing.
/// Singular where (A, C) is not observable.
/// @param K      n x ny, A - K C stable     @param Sigma  ny x ny, positive definite
/// @return nothing where A - K C is not stable or Sigma not positive definite
/// @throws std::invalid_argument when shapes disagree
std::optional<Eigen::MatrixXd> innovation_form_information(
    const Eigen::Ref<const Eigen::MatrixXd>& A, const Eigen::Ref<const Eigen::MatrixXd>& C,
    const Eigen::Ref<const Eigen::MatrixXd>& K, const Eigen::Ref<const Eigen::MatrixXd>& Sigma);

/// The same as Matisko (2013), (6.45), prints it for one state and one output, by k and Sigma:
///   [ 2 / k^2, 1 / (k Sigma); 1 / (k Sigma), 1 / Sigma^2 ].
/// It is the information of the state and the output as if the state were seen and k e and e were
/// independent: each innovation counts twice. Its inverse, k^2 / N and 2 Sigma^2 / N, has the right
/// Sigma; k^2 instead of 1 - (a - k)^2 is too small where noise makes the gain of a stable system,
/// and too large, so that it is no bound, where k^2 + (a - k)^2 > 1. It has no counterpart for
/// matrices: K Sigma K' is singular for more states than outputs, and for as many it leaves K
/// undetermined up to a rotation.
/// @throws std::invalid_argument when k is zero or Sigma not positive
Eigen::Matrix2d published_innovation_information(double k, double Sigma);

}  // namespace identikal
