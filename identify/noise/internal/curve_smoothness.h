// How smooth do recordings ask the curves of a model to be, and what are the curves then?
#pragma once

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/several_starts.h"

namespace identikal {

/// Of every curve of the model that is smooth (lib/model/spline_curve.h), f at its knots is
/// Gaussian before the data with density proportional to exp(-w f' R f / 2), and w is that of
/// largest marginal likelihood, Laplace's approximation of it:
///
///   w = g / f' R f,   g = rank R - w tr(R cov f),
///
/// repeated with searches in between until it settles. Straight lines cost nothing. g + 2 is by how
/// many free numbers the curve follows the data.
/// Source: MacKay (1992), "Bayesian interpolation", section 4; Green and Silverman (1994), section
/// 3.4.
/// @param found  the best without roughness; the best with it afterwards
/// @return g + 2 of each curve of the model; kNone of those that are not smooth
Eigen::VectorXd learn_smoothness(SeveralStarts& found, RecordingsLikelihood& likelihood,
                                 const FactorCoordinates& factors, const NoiseMlOptions& options);

/// The curves at the estimates, with bands by their standard errors and correlation; with roughness
/// these are a posterior's.
/// @param freedom  as learn_smoothness() has it
void report_curves(Estimate& estimate, const Model& model, const ParameterSet& end,
                   const Eigen::VectorXd& freedom);

}  // namespace identikal
