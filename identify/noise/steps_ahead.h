// Which parameters predict several samples ahead best?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "identify/noise/ml.h"
#include "lib/data/dataset.h"

namespace identikal {

/// "5-step" of five steps; what a result's objective is called.
std::string steps_ahead_method(int steps);
/// The number in such a word; 0 where it is none.
int steps_in(const std::string& method);

/// Makes small the errors of predictions K samples ahead of the filter,
///
///   L(theta) = - sum over outputs j of n_j/2 log( 1/n_j sum_t e_j(t)^2 ),
///   e(t) = y(t) - h(x(t|t-K)),
///
/// x(t|t-K) being the filtered state of sample t - K moved on without another measurement: between the
/// likelihood (one step) and a simulation. Noise, on which a filter's gain rests, is what the likelihood
/// has it (tune_ml(), which comes first); what moves or shows the states is then searched for by
/// Gauss-Newton steps with exact derivatives through filter and prediction. Standard errors allow for
/// errors that are correlated, as those of several steps are. Source: Ljung (1999), section 3.2.
///
/// Example:
///
///     const NoiseEstimate far = fit_steps_ahead(model, recordings, 10, {});
///
/// @param model  linear, or of formulas that are not; no prior, no constraints
/// @param steps  K, 2 or more
/// @throws InputError for another model, recordings of no more than K samples, and as tune_ml()
NoiseEstimate fit_steps_ahead(const Model& model, const std::vector<Dataset>& recordings, int steps,
                              const NoiseMlOptions& options);

}  // namespace identikal
