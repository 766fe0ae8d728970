// What was the state, given the whole recording, or what was recorded up to some time later?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

struct SmootherResult {
  FilterStatus status = FilterStatus::ok;
  double log_likelihood = 0.0;  ///< of the recording, as kalman_filter()
  Eigen::MatrixXd x;            ///< n x N: E x(t); NaN where a diffuse start is not determined yet
  Eigen::MatrixXd sd;           ///< n x N: standard deviations, the roots of the diagonal of P
  std::vector<Eigen::MatrixXd> P;  ///< N of n x n: cov x(t); empty unless requested
};

/// What a smoother stores: n x n covariances of a long record take much memory.
enum class SmootherKeep { deviations, covariances };

/// Fixed-interval smoother: state and covariance given the whole record,
///
///   r(t-1) = C' Sigma^-1 e + F' r(t),   N(t-1) = C' Sigma^-1 C + F' N(t) F,   F = A - K C,
///   E x(t) = x_filt + M r(t),   cov x(t) = P_filt - M N(t) M',   M = P_filt A' - P C' Sigma^-1 (G S)'
///
/// backwards from r(N) = 0, N(N) = 0, with e, Sigma, K, P of kalman_filter(): no inverse of A or P,
/// so both may be singular. M is the covariance of the errors of x_filt(t) and x_pred(t+1); K and F
/// hold S, so e stays white. A missing sample takes its channel out of C, R and S.
///
/// A diffuse start stays apart through the whole record: x(1) = proper part + delta, every vector
/// above gets one more column per element of delta, X(t) those of E x(t), and
///
///   delta = -I^-1 s,  E x(t) = ... + X(t) delta,  cov x(t) = ... + X(t) I^-1 X(t)'
///
/// with the information I and score s of delta from all innovations.
///
/// The filter runs twice, in blocks: beside what is returned, memory grows with N^1/2 (with N for a
/// model that changes). While the gain is constant, N(t) is once it has settled, to 1e-14.
///
/// Example:
///
///     const SmootherResult path = smooth(model, InitialState::diffuse, y, u);
///     const Eigen::MatrixXd above = path.x + 1.96 * path.sd, below = path.x - 1.96 * path.sd;
///
/// @param model, initial, y, u  as kalman_filter()
/// @throws std::invalid_argument when shapes disagree.
/// Sources: de Jong (1989) for r and N, de Jong (1991) for the diffuse start; Durbin & Koopman
/// (2012), sections 4.4 and 5.7.3. The form from P_filt is theirs with (4.32) put in: it loses no
/// digits where P is much larger than P_filt.
SmootherResult smooth(const StateSpace& model, InitialState initial,
                      const Eigen::Ref<const Eigen::MatrixXd>& y,
                      const Eigen::Ref<const Eigen::MatrixXd>& u,
                      SmootherKeep keep = SmootherKeep::covariances);
SmootherResult smooth(const ModelAt& model, InitialState initial,
                      const Eigen::Ref<const Eigen::MatrixXd>& y,
                      const Eigen::Ref<const Eigen::MatrixXd>& u,
                      SmootherKeep keep = SmootherKeep::covariances);

/// Fixed-lag smoother: at every t what smooth() says of the record up to t + lag, or up to its end
/// where that comes first. lag = 0 is the filter. Costs `lag` steps backwards per sample, of
/// vectors alone where the gain is constant; memory beside what is returned grows with the lag.
/// @param lag  samples, >= 0
/// @throws std::invalid_argument when shapes disagree or the lag is negative.
SmootherResult smooth_with_lag(const StateSpace& model, InitialState initial,
                               const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index lag,
                               SmootherKeep keep = SmootherKeep::covariances);
SmootherResult smooth_with_lag(const ModelAt& model, InitialState initial,
                               const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index lag,
                               SmootherKeep keep = SmootherKeep::covariances);

}  // namespace identikal
