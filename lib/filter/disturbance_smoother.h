// Which noise did every sample have, given the whole recording, and where was it more than noise: an
// outlier, a state that jumps?
#pragma once

#include <Eigen/Core>

#include "lib/filter/kalman.h"
#include "lib/model/state_space.h"

namespace identikal {

/// NaN where nothing is known: of outputs that are missing, of w at the last sample, and of what a
/// diffuse start leaves open.
struct DisturbanceResult {
  FilterStatus status = FilterStatus::ok;
  Eigen::MatrixXd w, w_sd;   ///< nw x N: E w(t) and the standard deviation of that estimate
  Eigen::MatrixXd v, v_sd;   ///< ny x N: E v(t), likewise
  Eigen::MatrixXd output_t;  ///< ny x N: v / v_sd, the auxiliary residuals of the outputs
  /// n x N: the t-value of a jump of state i between samples t and t + 1, whether or not noise
  /// drives it; of a state in whose equation there is noise, its auxiliary residual.
  Eigen::MatrixXd state_t;
  Eigen::MatrixXd state_jump;  ///< n x N: the size of that jump as it is estimated, r_i / N_ii
};

/// Fixed-interval disturbance smoother. With r and N of smooth() (lib/filter/smoother.h),
///
///   E w(t) = Q G' r(t),       cov of it   Q G' N(t) G Q,
///   E v(t) = y - C E x - D u,  cov of it   R - C cov(x) C',
///
/// and a jump of state i is estimated as r_i / N_ii, with the t-value r_i / N_ii^(1/2). Under the
/// model all t-values are N(0, 1), correlated from sample to sample. With a diffuse start
/// r = r_0 + X_r delta, and N loses X_r I^-1 X_r', what estimating delta takes.
///
/// Example:
///
///     const DisturbanceResult noise = smooth_disturbances(model, InitialState::diffuse, y, u);
///     Eigen::Index state, sample;
///     const double t = noise.state_t.cwiseAbs().maxCoeff(&state, &sample);  // the largest jump
///
/// @param model, initial, y, u  as kalman_filter(); S is zero
/// @throws std::invalid_argument when shapes disagree or S is not zero
/// Sources: Koopman (1993), "Disturbance smoother for state space models"; Harvey & Koopman (1992),
/// "Diagnostic checking of unobserved-components time series models"; de Jong & Penzer (1998),
/// "Diagnosing shocks in time series".
DisturbanceResult smooth_disturbances(const StateSpace& model, InitialState initial,
                                      const Eigen::Ref<const Eigen::MatrixXd>& y,
                                      const Eigen::Ref<const Eigen::MatrixXd>& u);
/// The same for a time-varying model.
DisturbanceResult smooth_disturbances(const ModelAt& model, InitialState initial,
                                      const Eigen::Ref<const Eigen::MatrixXd>& y,
                                      const Eigen::Ref<const Eigen::MatrixXd>& u);

}  // namespace identikal
