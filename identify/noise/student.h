// Which noise covariances make a recording most likely whose measurement noise has heavy tails?
#pragma once

#include <vector>

#include "identify/noise/ml.h"

namespace identikal {

/// Maximum likelihood with Student's t as measurement noise (identify/filter/student_weights.h), by
/// turns: weights of all samples at the present values, then tune_ml()'s maximum with these weights,
/// until the values stay; in a linear model that is variational expectation maximisation, whose lower
/// bound of the likelihood never falls. R is then the squared scale of the distribution, below its
/// variance R nu / (nu - 2). Degrees of freedom that the model file leaves free are the ones that the
/// weights are likeliest with,
///
///   log(nu/2) + 1 - psi(nu/2) + mean of (E log lambda - E lambda) = 0,  1 <= nu <= 200.
///
/// The log-likelihood of the result is that of student_log_densities(), so that it compares with a
/// normal model's; errors take the weights as known. The notes compare both on the last 30 % of every
/// recording, each fitted to the rest.
/// Source: Lange, Little & Taylor (1989), "Robust statistical modeling using the t distribution",
/// section 3, with the state's distribution given all data for the complete data's.
///
/// Example:
///
///     Model heavy = model;
///     heavy.student = StudentNoise{.freedom = 4.0};
///     const NoiseEstimate estimate = tune_student(heavy, recordings);
///
/// @throws as tune_ml(), and InputError as student_weighted()
NoiseEstimate tune_student(const Model& model, const std::vector<Dataset>& recordings,
                           const NoiseMlOptions& options = {});

}  // namespace identikal
