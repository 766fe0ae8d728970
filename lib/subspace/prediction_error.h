// How do the one-step predictions of an innovation model change with its matrices? The prediction error method
// on sums of products: its cost does not depend on how long the recordings are.
#pragma once

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

/// Theta = [vec(A - K C); vec [K, B - K D]; vec C; vec D], columns one after the other. A change of the state's
/// basis moves it along n^2 directions that change no prediction.
Eigen::VectorXd predictor_parameters(const InnovationForm& model);
/// The model of these parameters; sigma stays.
InnovationForm with_predictor_parameters(InnovationForm model, const Eigen::VectorXd& theta);

/// Orthonormal directions of theta that are no change of basis, theta x (theta - n^2): around this model every other one has
/// one set of coordinates along them (McKelvey, Helmersson & Ribarits 2004, data-driven local coordinates).
Eigen::MatrixXd local_coordinates(const InnovationForm& model);

/// The directions of theta along which K alone changes, theta x n p.
Eigen::MatrixXd gain_directions(const InnovationForm& model);

/// Numbers of free parameters of a model in any basis: n(m + 2p) + p m (Ljung 1999, section 4.3).
Eigen::Index free_parameters(const InnovationForm& model);

/// The sums as a problem of least squares, 1/2 ||r||^2 = 1/2 windows tr(W V) with V of
/// prediction_error_covariance(): r = vec(W^(1/2) [I, -H] G^(1/2)).
///
/// Where the sums have states, those are of a predictor that this one is near: what they change with theta is left out, for
/// it is uncorrelated with the innovations and fades with the lags.
///
/// Example:
///
///     const InnovationForm second_order = states.model(2);
///     const PredictionErrorProblem errors(sums, second_order.sigma);  // weighed by its inverse
///     Eigen::VectorXd r;
///     Eigen::MatrixXd J;
///     errors.evaluate(second_order, r, &J);
class PredictionErrorProblem {
 public:
  /// @param sigma  p x p: W is its inverse
  /// @throws std::invalid_argument for another size, or where it is not positive definite
  PredictionErrorProblem(const LaggedProducts& sums, const Eigen::MatrixXd& sigma);
  Eigen::Index residuals() const { return root_.cols() * whiten_.rows(); }
  /// @param J  residuals() x parameters, where it is asked for; with W the inverse of the innovations' covariance
  ///           J'J is the information of theta (Ljung 1999, section 9.3)
  /// @return false where the predictor overflows
  bool evaluate(const InnovationForm& model, Eigen::VectorXd& r, Eigen::MatrixXd* J) const;

 private:
  Eigen::MatrixXd derivatives(const InnovationForm& model) const;

  Eigen::Index p_, q_, lags_, states_;
  Eigen::MatrixXd root_;    // G = root root'
  Eigen::MatrixXd whiten_;  // W = whiten' whiten
};

}  // namespace identikal
