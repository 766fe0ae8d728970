// How smooth and how short are the responses of these recordings? The prior of largest evidence.
#pragma once

#include <vector>

#include "lib/subspace/impulse_regression.h"
#include "lib/subspace/predictor.h"

namespace identikal {

/// Of all responses of the predictor. @param start  of the search; null: from nothing
PredictorPrior likeliest_prior(const PredictorRegression& regression, const PredictorPrior* start);

/// Of impulse responses. The wide ones are what their errors are taken of: a kernel that fades with the fastest part of a
/// response is sure that there is no slower one.
struct KernelPriors {
  KernelPrior likeliest;
  std::vector<KernelPrior> wide;
};

/// The kernel, too, where `all_kernels`; else TC. All with a part that fades slowly, smooth or (of all kernels) as rough as
/// the rest: of the size of largest evidence, and at the upper end of that size's 95 % interval.
KernelPriors likeliest_kernel(const ImpulseRegression& regression, bool all_kernels);

}  // namespace identikal
