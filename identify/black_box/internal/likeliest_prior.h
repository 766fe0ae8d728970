// How smooth and how short are the responses of these recordings? The prior of largest evidence.
#pragma once

#include "lib/subspace/predictor.h"

namespace identikal {

/// Of all responses of the predictor. @param start  of the search; null: from nothing
PredictorPrior likeliest_prior(const PredictorRegression& regression, const PredictorPrior* start);

/// Of a regression on inputs alone.
PredictorPrior likeliest_impulse_prior(const PredictorRegression& regression);

}  // namespace identikal
