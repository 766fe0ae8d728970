// Which noise covariances make a recording most likely whose measurement noise has heavy tails?
#pragma once

#include <vector>

#include "identify/noise/ml.h"

namespace identikal {

/// Maximum likelihood of StudentFilter (identify/filter/student_filter.h) over every free parameter,
/// by scoring with central differences of the rows' log-densities l_t: gradient sum_t s_t,
/// information sum_t s_t s_t' with s_t = dl_t / dz (Berndt, Hall, Hall & Hausman 1974). R is the
/// squared scale of the distribution, below its variance R nu / (nu - 2). Degrees of freedom that
/// are a free parameter are searched up to 200, where the noise is normal.
///
/// The search begins where variational expectation maximisation has come to in a few turns: weights
/// lambda = (nu + 1) / (nu + E[v^2] / R) of all samples, and the maximum of the normal likelihood
/// with them (Agamennoni, Nieto & Nebot 2012, "Approximate inference in state-space models with
/// heavy-tailed noise"). It is not the estimate, as it finds process noises too small: of a level
/// with q = 0.04 and nu = 3 0.028, where this maximum has 0.040 +- 0.005.
///
/// The notes compare the model with normal noise on the last 30 % of every recording, each fitted to
/// the rest.
///
/// Example:
///
///     Model heavy = model;
///     heavy.student = StudentNoise{.freedom = 4.0};
///     const NoiseEstimate estimate = tune_student(heavy, recordings);
///
/// @throws as tune_ml(), and InputError as StudentFilter
NoiseEstimate tune_student(const Model& model, const std::vector<Dataset>& recordings,
                           const NoiseMlOptions& options = {});

}  // namespace identikal
