// How likely is a recording under a model made of formulas?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"
#include "lib/model/discretise.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// x(k+1) = step(x(k)) + w(k), y(k) = h(x(k), u(k), p, t(k)) + v(k): zero-mean Gaussian noise,
/// white, w and v independent, and the state before the first measurement.
struct FilterNoise {
  Eigen::MatrixXd Q;  ///< nx x nx: covariance of w(k), or its density per second in continuous time
  Eigen::MatrixXd R;  ///< ny x ny: covariance of v
  Eigen::VectorXd x0;  ///< nx: mean of the state at the first sample
  Eigen::MatrixXd P0;  ///< nx x nx: its covariance
};
/// All of it zero, in the model's shapes.
FilterNoise zero_noise(const NonlinearModel& model);

/// A direction that the likelihood is derived in: a parameter of the model, numbers of the noise
/// and the start, or both at once.
struct FilterDirection {
  Eigen::Index parameter = -1;  ///< p_i, 0-based, moves at unit speed; -1: none
  FilterNoise noise;            ///< d(noise)/d(direction), symmetric
};

/// How means and covariances go through what is not linear.
enum class NonlinearMethod {
  extended,  ///< f and h straight at the mean (Jazwinski 1970, section 8.3)
  iterated,  ///< h straight at the mean of what is known after the measurement (Bell & Cathey 1993)
  unscented,  ///< f and h at sigma points (Julier & Uhlmann 2004)
};

/// Sigma points x and x +- sqrt(alpha^2 (nx + kappa)) L_j with P = L L', L lower triangular. With
/// lambda = alpha^2 (nx + kappa) - nx the weight of each of the 2 nx outer ones is
/// 1 / (2 (nx + lambda)), that of the middle one lambda / (nx + lambda) in a mean and
/// 1 - alpha^2 + beta more in a covariance (Wan & van der Merwe 2000). With these numbers no weight
/// is negative, and a covariance never is; the mean of a quadratic is exact, its variance with one
/// state too, with more it is above.
struct UnscentedWeights {
  double alpha = 1.0, beta = 2.0, kappa = 0.0;
};

struct NonlinearFilterOptions {
  NonlinearMethod method = NonlinearMethod::extended;
  ProcessNoise noise = ProcessNoise::per_sample;  ///< what Q is; density in continuous time only
  /// Values of h at a sample that NonlinearMethod::iterated looks at, at most. It ends before that
  /// once no state would move by 1e-10 of its standard deviation; a step that lowers the sum of
  /// squares by less than a quarter of what it promised is halved. What has not settled is taken as
  /// it is, with the exact derivatives of the steps made.
  int iterations = 30;
  UnscentedWeights weights;
  /// Per output: an angle [rad] that is measured up to whole turns. An innovation is then the nearest
  /// of those, and sigma points are. Empty: none.
  std::vector<bool> wraps;
  /// ny x N, above 0: R of a sample is that of the noise with every standard deviation times its
  /// scale. Empty: 1.
  Eigen::MatrixXd noise_scale;
  /// A further scale of the same kind, by formulas: ny outputs of a model with the same states,
  /// inputs and parameters, at the state before the sample, x(k|k-1). One that is not above 0 there
  /// gives FilterStatus::indefinite. Null: 1.
  const NonlinearModel* scales = nullptr;
};

/// Runs the filter over a record.
///
/// From sample to sample x by step(), P by Phi P Phi' + W with the exact Phi = dx(k+1)/dx(k) and
/// W = Q, or the integral of Phi(t(k+1), s) Q Phi(t(k+1), s)' along the trajectory, which has the
/// order of the Runge-Kutta method. At a sample, with H = dh/dx at xi,
///
///   e = y - h(xi) - H (x - xi),  Sigma = H P H' + R,  K = P H' Sigma^-1,  x+ = x + K e,
///   P+ = (I - K H) P (I - K H)' + K R K'                     (Joseph form: stays definite)
///
/// with xi = x (extended) or the x+ of the last linearisation, until that has settled (iterated).
/// Unscented: the moments of step() and h() come from sigma points, drawn again before each; W is
/// that of the trajectory from the mean. A covariance may be semidefinite there; one that is
/// indefinite by more than rounding gives FilterStatus::indefinite, and so does a derivative with
/// respect to a variance that is zero, as points that coincide do not determine how they would
/// part. A missing sample (NaN) takes its channel out.
///
/// Example:
///
///     const InputNodes inputs = input_nodes(time, u, InputPath::linear, 0.01);
///     const NonlinearFilterOptions options{.method = NonlinearMethod::unscented};
///     const FilterResult filter = nonlinear_filter(pendulum, p, noise, inputs, y, options);
///
/// @param p       parameters, SI
/// @param inputs  N samples
/// @param y       ny x N, NaN = missing
/// @return e, e_sd and standardised, and with Keep::everything states, covariances and Sigma, as
///   kalman_filter() returns them
/// @throws std::invalid_argument when shapes disagree, a density is given in discrete time,
///   iterations < 1 or alpha^2 (nx + kappa) <= 0
FilterResult nonlinear_filter(const NonlinearModel& model,
                              const Eigen::Ref<const Eigen::VectorXd>& p, const FilterNoise& noise,
                              const InputNodes& inputs, const Eigen::Ref<const Eigen::MatrixXd>& y,
                              const NonlinearFilterOptions& options = {},
                              Keep keep = Keep::everything);

/// Its innovations behind a gate (lib/filter/gated_innovations.h).
/// Arguments and exceptions as nonlinear_filter(), and:
/// @param y    ny x N, NaN = missing; receives NaN where an output was refused
/// @param most_in_a_row  of the samples that an output has
/// @param far  the output of sample t that is to go, 0-based, or -1
FilterResult gated_innovations(
    const NonlinearModel& model, const Eigen::Ref<const Eigen::VectorXd>& p,
    const FilterNoise& noise, const InputNodes& inputs, Eigen::MatrixXd& y,
    const NonlinearFilterOptions& options, Eigen::Index most_in_a_row,
    const std::function<int(Eigen::Index t, const FilterResult& so_far)>& far);

/// The same filter's log-likelihood, with exact gradient and information by the directions: forward
/// sensitivities of x and P. Where Q, P0 and all their derivatives are zero (output error) P stays
/// zero and only the simulation is made.
/// @param memory  of this model; what parameters it was set to does not matter
/// @param directions  k; none: the value alone
/// @param score_products  k x k, written when not null: sum_t s_t s_t' of the samples' own scores
///   (lib/filter/kalman.h)
/// @throws std::invalid_argument as nonlinear_filter(), and when there are directions but the model
///   was made without the second derivatives that their derivatives need: all need them but output
///   error and the unscented filter with noise per sample
Likelihood nonlinear_likelihood(
    const NonlinearModel& model, ModelMemory& memory, const Eigen::Ref<const Eigen::VectorXd>& p,
    const FilterNoise& noise, const std::vector<FilterDirection>& directions,
    const InputNodes& inputs, const Eigen::Ref<const Eigen::MatrixXd>& y,
    const NonlinearFilterOptions& options = {}, Eigen::MatrixXd* score_products = nullptr);

/// The same filter, and its state at every sample with exact derivatives by the directions.
/// Arguments and exceptions as nonlinear_likelihood().
Likelihood watch_filtered_states(
    const NonlinearModel& model, ModelMemory& memory, const Eigen::Ref<const Eigen::VectorXd>& p,
    const FilterNoise& noise, const std::vector<FilterDirection>& directions,
    const InputNodes& inputs, const Eigen::Ref<const Eigen::MatrixXd>& y,
    const NonlinearFilterOptions& options, const FilteredStateWatcher& see);

}  // namespace identikal
