// What does the Kalman filter say about a recording? States, innovations and the Gaussian
// log-likelihood, with its exact gradient when derivatives of the model are given.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Runs the filter over a record.
///
///   e = y - C x - D u,  Sigma = C P C' + R,  K = (A P C' + G S) Sigma^-1,  x+ = A x + B u + K e,
///   P+ = (A - K C) P (A - K C)' + G Q G' - K (G S)' - (G S) K' + K R K'.
///
/// The Joseph form stays definite.
///
/// A missing sample (NaN) takes its channel out of C, D, R and S at that time. A diffuse start uses
/// the augmented form of de Jong (1991): x(1) = s^(1/2) xi + delta with delta diffuse; the finite
/// part changes nothing (it is absorbed by delta) but keeps Sigma regular from the first sample.
/// The states are folded in as soon as delta is determined. Once covariance and derivatives have
/// stopped changing (to 1e-14 and 1e-12 of themselves), the gain is kept until a sample is missing.
///
/// Example:
///
///     const FilterResult filter = kalman_filter(model, InitialState::diffuse, y, u);
///     if (filter.status != FilterStatus::ok) std::puts(describe(filter.status));
///     const Eigen::VectorXd state_now = filter.x_filt.rightCols(1);
///
/// @param model    shapes checked; x0 and P0 are used with InitialState::given and partly_diffuse
/// @param y        ny x N, NaN = missing
/// @param u        nu x N
/// @throws std::invalid_argument when shapes disagree.
/// Source: Matisko (2013), section 2.1, with the A that the gain after (2.6) lacks; Durbin &
/// Koopman (2012), chapter 5.
FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const Eigen::MatrixXd>& y,
                           const Eigen::Ref<const Eigen::MatrixXd>& u,
                           Keep keep = Keep::everything);

/// The same for a time-varying model. A stationary start is that of the model at t = 0.
/// @throws std::invalid_argument also when sizes change.
FilterResult kalman_filter(const ModelAt& model, InitialState initial,
                           const Eigen::Ref<const Eigen::MatrixXd>& y,
                           const Eigen::Ref<const Eigen::MatrixXd>& u,
                           Keep keep = Keep::everything);

/// The log-likelihood alone, or with gradient and information when `derivatives` holds
/// d(model)/d(theta_i), i = 1..k. Same recursion, arguments and exceptions as kalman_filter;
/// forward sensitivities of x, P.
Likelihood log_likelihood(const StateSpace& model, InitialState initial,
                          const Eigen::Ref<const Eigen::MatrixXd>& y,
                          const Eigen::Ref<const Eigen::MatrixXd>& u,
                          const std::vector<StateSpace>& derivatives = {});

/// The same for a time-varying model, all derivatives side by side.
/// @param motion_changes  false: A, B, G, Q and S, and their derivatives, are those of t = 0 at every
///   sample, and only what is measured changes. That takes less time.
Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const Eigen::MatrixXd>& y,
                          const Eigen::Ref<const Eigen::MatrixXd>& u, bool with_derivatives,
                          bool motion_changes = true);

/// Runs the filter and shows its state at every sample, with exact derivatives: the same forward
/// sensitivities, behind the measurement,
///
///   Kf = P C' Sigma^-1,  x_filt = x + Kf e,  P_filt = (I - Kf C) P (I - Kf C)' + Kf R Kf'.
///
/// Samples of a diffuse start are not shown. Arguments and exceptions as log_likelihood().
///
/// Example:
///
///     double worst = 0.0;  // standard deviation of the first state
///     const auto see = [&](const FilteredState& s) { worst = std::max(worst, std::sqrt(s.P(0, 0))); };
///     watch_filtered_states(model, InitialState::diffuse, y, u, {}, see);
Likelihood watch_filtered_states(const StateSpace& model, InitialState initial,
                                 const Eigen::Ref<const Eigen::MatrixXd>& y,
                                 const Eigen::Ref<const Eigen::MatrixXd>& u,
                                 const std::vector<StateSpace>& derivatives,
                                 const FilteredStateWatcher& see);
/// The same for a time-varying model.
Likelihood watch_filtered_states(const ModelAt& model, InitialState initial,
                                 const Eigen::Ref<const Eigen::MatrixXd>& y,
                                 const Eigen::Ref<const Eigen::MatrixXd>& u, bool with_derivatives,
                                 const FilteredStateWatcher& see);

/// sum_t s_t s_t' of the samples' own scores, s_t = d/d(theta) of the log-density of y(t) given
/// what came before: with the observed information H, H^-1 (sum s s') H^-1 is the covariance of the
/// estimate also where the noise is not Gaussian (White 1982). The samples of a diffuse start count
/// as one. Arguments and exceptions as log_likelihood; empty when the filter does not run.
Eigen::MatrixXd score_products(const StateSpace& model, InitialState initial,
                               const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const Eigen::Ref<const Eigen::MatrixXd>& u,
                               const std::vector<StateSpace>& derivatives);
/// The same for a time-varying model.
Eigen::MatrixXd score_products(const ModelAt& model, InitialState initial,
                               const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const Eigen::Ref<const Eigen::MatrixXd>& u);

}  // namespace identikal
