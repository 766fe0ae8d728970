// What does a pass of the filter over a recording leave? Innovations, states and the Gaussian
// log-likelihood, or the reason why there are none.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

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
  beyond_digest,  ///< the filter remembers longer than the digest of a recording reaches
};

/// A sentence for people.
///
/// Example:
///
///     const Likelihood at = log_likelihood(model, InitialState::stationary, y, u);
///     if (at.status != FilterStatus::ok) std::puts(describe(at.status));
const char* describe(FilterStatus status);

struct FilterResult {
  FilterStatus status = FilterStatus::ok;
  double log_likelihood = 0.0;
  /// First sample with a proper innovation; > 0 with a diffuse start.
  Eigen::Index first_proper = 0;
  Eigen::MatrixXd x_pred, x_filt;               ///< n x N: E x(t) given y up to t-1, up to t
  std::vector<Eigen::MatrixXd> P_pred, P_filt;  ///< N of n x n
  Eigen::MatrixXd e;  ///< ny x N innovations; NaN where missing or before first_proper
  /// ny x N: standard deviations of the innovations, Sigma_ii^1/2, where missing too; NaN before
  /// first_proper.
  Eigen::MatrixXd e_sd;
  /// ny x N: L^-1 e with Sigma = L L' over the channels present; NaN as e.
  Eigen::MatrixXd standardised;
  std::vector<Eigen::MatrixXd> Sigma;  ///< N of ny x ny innovation covariances
};

/// What kalman_filter() stores. States and covariances of a long record take much memory.
enum class Keep { everything, innovations };

/// What a filter knows of the state at a sample, given y up to and with it, and how that moves with
/// k parameters.
struct FilteredState {
  Eigen::Index t = 0;
  Eigen::VectorXd x;   ///< n: its mean
  Eigen::MatrixXd P;   ///< n x n: its covariance
  Eigen::MatrixXd dx;  ///< n x k
  Eigen::MatrixXd dP;  ///< n^2 x k: of P column by column
};
using FilteredStateWatcher = std::function<void(const FilteredState&)>;

/// Room for N samples of what is to be kept: vectors are NaN, covariances empty.
FilterResult empty_filter_result(Eigen::Index states, Eigen::Index outputs, Eigen::Index N,
                                 Keep keep);

/// A model that changes from sample to sample. Sets the model of sample t (what links x(t) to y(t)
/// and to x(t+1)), and its derivatives unless they are null; called for t = 0, 1, ... in turn. The
/// sizes must not change.
using ModelAt =
    std::function<void(Eigen::Index t, StateSpace& model, std::vector<StateSpace>* derivatives)>;

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

}  // namespace identikal
