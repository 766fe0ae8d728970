// Which noise covariances, by two methods that fail in different ways? Autocovariance least squares
// for the start, maximum likelihood for the answer, and a word when they disagree.
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "identify/noise/ml.h"
#include "lib/data/dataset.h"

namespace identikal {

/// tune_ml() started from what tune_als() finds, where that is possible (only noise is free, the
/// recordings are long enough, the gain is stable). An entry on which the two lie further apart
/// than their errors allow is named in a warning: on data that the model describes, the difference
/// of two estimates, one of them efficient, has the variance se_als^2 - se_ml^2 (Hausman 1978); the
/// warning asks for four standard errors of the larger.
///
/// Example:
///
///     const auto estimate = tune_auto(model, recordings);
///
/// @throws InputError as tune_ml()
NoiseEstimate tune_auto(const Model& model, const std::vector<Dataset>& recordings,
                        const NoiseMlOptions& options = {});

}  // namespace identikal
