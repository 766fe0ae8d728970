// Which ARX, ARMAX, output-error or Box-Jenkins model of given orders predicts recordings best, and how sure are its coefficients?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/black_box/black_box.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "lib/polynomial/polynomial_model.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// The polynomials of `order` states, or those that were asked for.
/// @param noise_order  of C and D of Box and Jenkins' model
/// @param delays       of every input
PolynomialModel polynomials_of(ModelStructure structure, int order, int noise_order,
                               const std::optional<PolynomialOrders>& given,
                               const std::vector<Eigen::Index>& delays);

/// Every output's model of least squared prediction errors, by Gauss-Newton steps from several starts.
/// @param states  a state-space model of a like order: one of the starts
std::vector<PolynomialModel> fitted_polynomials(const PolynomialModel& structure,
                                                const InnovationForm& states,
                                                const ScaledRecordings& recordings);

/// Covariance of coefficients(), of the model's own units. An output-error model says nothing of the noise: there it allows
/// for residuals that are coloured (Ljung 1999, section 9.4).
/// @return empty where the recordings do not determine them
Eigen::MatrixXd coefficient_covariance(const PolynomialModel& model,
                                       const ScaledRecordings& recordings, Eigen::Index output);

}  // namespace identikal
