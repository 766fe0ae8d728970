// How smooth and how short are the responses of these recordings? The prior of largest evidence.
#pragma once

#include "lib/subspace/impulse_regression.h"
#include "lib/subspace/predictor.h"

namespace identikal {

/// Of all responses of the predictor. @param start  of the search; null: from nothing
PredictorPrior likeliest_prior(const PredictorRegression& regression, const PredictorPrior* start);

/// Of impulse responses: the kernel, too, where `all_kernels`; else TC.
KernelPrior likeliest_kernel(const ImpulseRegression& regression, bool all_kernels);

}  // namespace identikal
