// Which weights do samples have whose measurement noise follows Student's t, and what is a normal
// filter with these?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// What results say of such a filter.
std::string student_note(const Model& model);

/// The model without Student's t, its filter taking Dataset::noise_scale: a linear model becomes one
/// that changes from sample to sample, with the same matrices.
Model normal_model(const Model& model);

/// Recordings with the weights of StudentFilter (student_filter.h) as Dataset::noise_scale =
/// weight^-1/2: the noises that a normal smoother takes.
///
/// Example:
///
///     const auto weighted = student_weighted(model, model.parameters, recordings);
///     const Model normal = normal_model(model);
///     const auto smoothed = run_smoother(normal, normal.parameters, weighted[0], std::nullopt);
///
/// @param model  with StudentNoise
/// @throws InputError as StudentFilter, and where it does not run
std::vector<Dataset> student_weighted(const Model& model, const ParameterSet& at,
                                      const std::vector<Dataset>& recordings);

/// E[v_i^2] / R_ii of every sample, ny x N, given the whole recording where the model is linear, and
/// up to the sample else; NaN where nothing was measured, or R_ii is zero.
/// @param normal    normal_model(); @param recording  weighted or not
/// @throws InputError when noises of outputs are correlated or the filter does not run
Eigen::MatrixXd expected_squares(const Model& normal, const Dataset& recording);

/// Scales lambda^-1/2 of lambda = (nu + 1) / (nu + square), its expectation given the square.
/// @param squares  expected_squares()
Eigen::MatrixXd noise_scale_of(const Eigen::MatrixXd& squares, double freedom);

/// log p(y(t) | y(1), ..., y(t-1)) of every row with normal noise; 0 in rows of a diffuse start.
Eigen::VectorXd normal_log_densities(const Model& model, const Dataset& recording);

}  // namespace identikal
