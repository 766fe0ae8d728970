// What does the Kalman filter say about a recording? States, innovations and the Gaussian
// log-likelihood, with its exact gradient when derivatives of the model are given.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// How an evaluation ended; everything but ok leaves the numbers undefined.
enum class FilterStatus {
  ok,
  unstable,      ///< InitialState::stationary and A is not stable
  indefinite,    ///< an innovation covariance is not positive definite: y has a part without noise,
                 ///< or Q or R is indefinite
  undetermined,  ///< InitialState::diffuse and the recording does not determine the initial state
  not_finite,    ///< overflow, or an input u is missing
};

/// A sentence for people.
const char* describe(FilterStatus status);

struct FilterResult {
  FilterStatus status = FilterStatus::ok;
  double log_likelihood = 0.0;
  Eigen::Index first_proper =
      0;  ///< first sample with a proper innovation; > 0 with a diffuse start
  Eigen::MatrixXd x_pred, x_filt;               ///< n x N: E x(t) given y up to t-1, up to t
  std::vector<Eigen::MatrixXd> P_pred, P_filt;  ///< N of n x n
  Eigen::MatrixXd e;     ///< ny x N innovations; NaN where missing or before first_proper
  Eigen::MatrixXd e_sd;  ///< ny x N: sd of the innovations, Sigma_ii^1/2, where missing too; NaN
                         ///< before first_proper
  Eigen::MatrixXd
      standardised;  ///< ny x N: L^-1 e with Sigma = L L' over the channels present; NaN as e
  std::vector<Eigen::MatrixXd> Sigma;  ///< N of ny x ny innovation covariances
};

/// What kalman_filter() stores. States and covariances of a long record take much memory.
enum class Keep { everything, innovations };

/// Runs the filter over a record.
///
///   e = y - C x - D u,  Sigma = C P C' + R,  K = (A P C' + G S) Sigma^-1,  x+ = A x + B u + K e,
///   P+ = (A - K C) P (A - K C)' + G Q G' - K (G S)' - (G S) K' + K R K'       (Joseph form: stays
///   definite)
///
/// A missing sample (NaN) takes its channel out of C, D, R and S at that time. A diffuse start uses
/// the augmented form of de Jong (1991): x(1) = s^(1/2) xi + delta with delta diffuse; the finite
/// part changes nothing (it is absorbed by delta) but keeps Sigma regular from the first sample.
/// The states are folded in as soon as delta is determined. Once covariance and derivatives have
/// stopped changing (to 1e-14 and 1e-12 of themselves), the gain is kept until a sample is missing.
/// @param model    shapes checked; x0 and P0 are used with InitialState::given
/// @param y        ny x N, NaN = missing
/// @param u        nu x N
/// @throws std::invalid_argument when shapes disagree.
/// Source: Matisko (2013), section 2.1, with the A that the gain after (2.6) lacks; Durbin &
/// Koopman (2012), chapter 5.
FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const Eigen::MatrixXd>& y,
                           const Eigen::Ref<const Eigen::MatrixXd>& u,
                           Keep keep = Keep::everything);

/// A model that changes from sample to sample. Sets the model of sample t (what links x(t) to y(t)
/// and to x(t+1)), and its derivatives unless they are null; called for t = 0, 1, ... in turn. The
/// sizes must not change.
using ModelAt =
    std::function<void(Eigen::Index t, StateSpace& model, std::vector<StateSpace>* derivatives)>;

/// The same for a time-varying model. A stationary start is that of the model at t = 0.
/// @throws std::invalid_argument also when sizes change.
FilterResult kalman_filter(const ModelAt& model, InitialState initial,
                           const Eigen::Ref<const Eigen::MatrixXd>& y,
                           const Eigen::Ref<const Eigen::MatrixXd>& u,
                           Keep keep = Keep::everything);

struct Likelihood {
  FilterStatus status = FilterStatus::ok;
  /// -1/2 sum_t [ log|Sigma| + e' Sigma^-1 e ] - 1/2 (samples - diffuse states) log 2 pi, the exact
  /// diffuse log-likelihood when the start is diffuse.
  double value = 0.0;
  Eigen::VectorXd gradient;  ///< k, exact
  /// k x k: sum_t [ 1/2 tr(Sigma^-1 dSigma_i Sigma^-1 dSigma_j) + de_i' Sigma^-1 de_j ], the Fisher
  /// information with the second expectation replaced by its sample value; terms before
  /// first_proper are left out.
  Eigen::MatrixXd information;
};

/// The log-likelihood alone, or with gradient and information when `derivatives` holds
/// d(model)/d(theta_i), i = 1..k. Same recursion, arguments and exceptions as kalman_filter;
/// forward sensitivities of x, P.
Likelihood log_likelihood(const StateSpace& model, InitialState initial,
                          const Eigen::Ref<const Eigen::MatrixXd>& y,
                          const Eigen::Ref<const Eigen::MatrixXd>& u,
                          const std::vector<StateSpace>& derivatives = {});

/// The same for a time-varying model: the full recursion at every sample.
Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const Eigen::MatrixXd>& y,
                          const Eigen::Ref<const Eigen::MatrixXd>& u, bool with_derivatives);

/// sum_t s_t s_t' of the samples' own scores, s_t = d/d(theta) of the log-density of y(t) given
/// what came before: with the observed information H, H^-1 (sum s s') H^-1 is the covariance of the
/// estimate also where the noise is not Gaussian (White 1982). The samples of a diffuse start count
/// as one. Arguments and exceptions as log_likelihood; empty when the filter does not run.
Eigen::MatrixXd score_products(const StateSpace& model, InitialState initial,
                               const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const Eigen::Ref<const Eigen::MatrixXd>& u,
                               const std::vector<StateSpace>& derivatives);

}  // namespace identikal
