// What does a filter make of samples whose measurement noise follows Student's t?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The degrees of freedom nu of the model's measurement noise at its own values.
double degrees_of_freedom(const Model& model);

/// What results say of such a filter.
std::string student_note(const Model& model);

/// The model without Student's t, its filter taking Dataset::noise_scale: a linear model becomes one
/// that changes from sample to sample, with the same matrices.
Model normal_model(const Model& model);

/// Recordings with a weight lambda for every sample, as Dataset::noise_scale = lambda^-1/2:
///
///   y_i = h_i(x) + v_i,  v_i | lambda ~ N(0, R_ii / lambda),  lambda ~ Gamma(nu/2, nu/2)
///   lambda = (nu + 1) / (nu + E[v_i^2] / R_ii)
///
/// where v_i is Student's t with nu degrees of freedom and scale R_ii^1/2, outputs and samples
/// independent. E[v_i^2] is that of the filter given y up to and with that sample, itself weighted;
/// both are repeated until they agree. With the weights the filter is the ordinary one.
/// Sources: Agamennoni, Nieto & Nebot (2012), "Approximate inference in state-space models with
/// heavy-tailed noise", IEEE Trans. Signal Processing 60(10), eq. (12) and (13) for one output; Roth,
/// Ozkan & Gustafsson (2013), "A Student's t filter for heavy tailed process and measurement noise".
///
/// Example:
///
///     const std::vector<Dataset> weighted = student_weighted(model, recordings);
///     const Model normal = normal_model(model);
///     const FilterResult filter = run_filter(normal, normal.parameters, weighted[0]);
///
/// @param model  with StudentNoise
/// @throws InputError when noises of outputs are correlated or the filter does not run
std::vector<Dataset> student_weighted(const Model& model, const std::vector<Dataset>& recordings);

/// E[v_i^2] / R_ii of every sample, ny x N, given the whole recording where the model is linear, and
/// up to the sample else; NaN where nothing was measured, or R_ii is zero.
/// @param normal    normal_model(); @param recording  weighted or not
/// @throws InputError as student_weighted()
Eigen::MatrixXd expected_squares(const Model& normal, const Dataset& recording);

/// The weights as scales. @param squares  expected_squares()
Eigen::MatrixXd noise_scale_of(const Eigen::MatrixXd& squares, double freedom);

/// log p(y(t) | y(1), ..., y(t-1)) of every row, with the state taken for Gaussian: of every output
/// in turn
///
///   p(e) = integral of N(e; 0, s + R_ii / lambda) Gamma(lambda; nu/2, nu/2) d lambda,
///
/// e its innovation given the outputs before it in the same row, s what the state adds to its
/// variance. 0 in rows of a diffuse start. @param recording  as student_weighted() has weighted it
Eigen::VectorXd student_log_densities(const Model& normal, double freedom,
                                      const Dataset& recording);

/// The same with normal noise. @param recording  without weights
Eigen::VectorXd normal_log_densities(const Model& model, const Dataset& recording);

}  // namespace identikal
