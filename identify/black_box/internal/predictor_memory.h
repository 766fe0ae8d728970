// How far back does a predictor look, and from which state does it begin?
#pragma once

#include <Eigen/Core>

#include "lib/subspace/innovation_form.h"

namespace identikal {

inline constexpr Eigen::Index kRowsForState =
    50;  ///< that the first state of a simulation is taken from

/// Rows after which a millionth is left in the predictor of what was before them; infinite where it never forgets.
double memory_of(const InnovationForm& model);

/// Within so many rows?
bool forgets(const InnovationForm& model, Eigen::Index lags);

/// The predictor as a simulation: A - K C, driven by inputs and outputs, its outputs W y.
InnovationForm predictor_in(const InnovationForm& model, const Eigen::MatrixXd& W);

/// What drives it: inputs, and below them outputs.
Eigen::MatrixXd driving(const Eigen::MatrixXd& y, const Eigen::MatrixXd& u);

/// The state in the first row from which the first predictions are best, by so many rows.
/// @param y  p x N, nothing missing: outputs drive the predictor
Eigen::VectorXd state_before_predictions(const InnovationForm& model, const Eigen::MatrixXd& y,
                                         const Eigen::MatrixXd& u, Eigen::Index rows);

/// The same by all predictions that remember it; zero where none does behind the lags, and where outputs are missing.
Eigen::VectorXd first_state(const InnovationForm& model, const Eigen::MatrixXd& y,
                            const Eigen::MatrixXd& u, Eigen::Index lags);

}  // namespace identikal
