// What does the Kalman filter say now, with the sample that has just come?
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// The filter between two samples. Read state, state_sd, innovation and innovation_sd after every
/// step(); the rest is what it remembers, and room to work in.
///
/// Example:
///
///     OnlineFilter filter = start_online_filter(model, InitialState::diffuse);
///     for (Eigen::Index t = 0; t < y.cols(); ++t) step(filter, y.col(t), u.col(t));
///     const Eigen::VectorXd state_now = filter.state, sd = filter.state_sd;
struct OnlineFilter {
  Eigen::VectorXd state, state_sd;  ///< n: given y up to now; NaN while nothing determines it
  /// ny: y minus its prediction, and the standard deviation of that; NaN where nothing is measured
  /// and while the state is not determined
  Eigen::VectorXd innovation, innovation_sd;

  StateSpace model;
  Eigen::MatrixXd P, Z;        ///< of the next sample: covariance; state and responses to delta
  Eigen::Index columns = 1;    ///< of Z, that are in use: 1, or 1 + n while delta is apart
  Eigen::MatrixXd GQG, GS, R;  ///< of the model
  Eigen::VectorXd scale;       ///< variances of the d states that start diffuse
  Eigen::MatrixXd delta_information, delta_factor;  ///< L L' = I, once it is determined
  Eigen::VectorXd delta_score, delta;
  bool diffuse = false, determined = true;
  bool settled = false;  ///< the gain does not change any more while nothing is missing
  std::vector<Eigen::Index> present;  ///< channels of the sample taken last
  Eigen::MatrixXd C, Sigma, L, E, SiE, PC, M, K, F, P_next, Z_next, P_filt, Z_filt, KR, FP, moved,
      responses;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
};

/// @param model  as kalman_filter() in lib/filter/kalman.h takes it
/// @throws std::invalid_argument when shapes disagree, or for a stationary start of a model that is
///   not stable
OnlineFilter start_online_filter(const StateSpace& model, InitialState initial);

/// Takes a sample and moves on: the recursion of kalman_filter(), for one sample, with the same
/// numbers to rounding. Allocates nothing after the first sample; a diffuse start keeps delta
/// apart until nothing of it is left in the state (de Jong 1991).
/// @param y  ny, NaN = missing
/// @param u  nu
/// @return false, and nothing has changed, when the covariance of the innovation is not positive
///   definite, an input is not finite, or a number's square overflows
/// @throws std::invalid_argument when shapes disagree
/// Source: Matisko (2013), section 2.1; Durbin & Koopman (2012), chapter 5.
bool step(OnlineFilter& filter, const Eigen::Ref<const Eigen::VectorXd>& y,
          const Eigen::Ref<const Eigen::VectorXd>& u);

}  // namespace identikal
