// A linear model as identification sees it: driven by inputs and by its own innovations. Its predictor, its
// simulation, and the errors of both.
#pragma once

#include <Eigen/Core>

#include "lib/subspace/lagged_products.h"

namespace identikal {

/// x(t+1) = A x + B u + K e, y = C x + D u + e, cov(e) = sigma (Ljung 1999, eq (4.91)).
/// Shapes: A n x n, B n x m, C p x n, D p x m, K n x p.
struct InnovationForm {
  Eigen::MatrixXd A, B, C, D, K, sigma;
  Eigen::Index states() const { return A.rows(); }
  Eigen::Index inputs() const { return B.cols(); }
  Eigen::Index outputs() const { return C.rows(); }
};

/// Largest absolute value of an eigenvalue; 0 of an empty matrix.
double spectral_radius(const Eigen::MatrixXd& A);

/// Its one-step predictor as responses in the order of LaggedProducts, p x (L+1)(p+m) + states: block 0 is [0 D], block
/// k is C (A - K C)^(k-1) [K, B - K D], and behind them, where there are states, C (A - K C)^L.
Eigen::MatrixXd predictor_responses(const InnovationForm& model, Eigen::Index lags,
                                    bool with_states = false);

/// Covariance of the one-step prediction error on the recordings behind the sums, the predictor cut off behind
/// their lags.
///
/// Example:
///
///     const InnovationForm second_order = states.model(2);
///     const Eigen::MatrixXd V = prediction_error_covariance(second_order, sums);
///     std::printf("log det %g\n", std::log(V.determinant()));
///
/// @throws std::invalid_argument for sums of other channels
Eigen::MatrixXd prediction_error_covariance(const InnovationForm& model,
                                            const LaggedProducts& sums);

/// The outputs of a simulation, p x N: without innovations.
/// @param u   m x N, nothing missing
/// @param x0  n: the state in the first row
Eigen::MatrixXd simulated_outputs(const InnovationForm& model,
                                  const Eigen::Ref<const Eigen::MatrixXd>& u,
                                  const Eigen::VectorXd& x0);

/// The states of its predictor before every row, n x N; where an output is missing its prediction stands for it.
Eigen::MatrixXd predictor_states(const InnovationForm& model,
                                 const Eigen::Ref<const Eigen::MatrixXd>& y,
                                 const Eigen::Ref<const Eigen::MatrixXd>& u,
                                 const Eigen::VectorXd& x0);

/// One-step predictions, p x N, each from all rows before; where an output is missing, its prediction stands for it.
/// @param u   m x N, nothing missing
/// @param x0  n: the state in the first row
Eigen::MatrixXd one_step_predictions(const InnovationForm& model,
                                     const Eigen::Ref<const Eigen::MatrixXd>& y,
                                     const Eigen::Ref<const Eigen::MatrixXd>& u,
                                     const Eigen::VectorXd& x0);

/// The state in the first row whose simulation fits the first `rows` rows best; least squares of smallest norm,
/// outputs weighed as they are. Missing outputs do not count.
Eigen::VectorXd initial_state(const InnovationForm& model,
                              const Eigen::Ref<const Eigen::MatrixXd>& y,
                              const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index rows);

/// The model with the same outputs' spectrum whose predictor is stable: zeros of the noise outside of the unit circle
/// are mirrored into it (K and sigma of the steady Kalman filter of A, C and the noise). Itself where its predictor is
/// stable already, or where there is none.
InnovationForm with_stable_predictor(const InnovationForm& model);

/// The model that has its poles, where they lie outside of `radius`, put onto that circle; C, K and the
/// directions of its modes stay.
InnovationForm with_poles_within(InnovationForm model, double radius);

}  // namespace identikal
