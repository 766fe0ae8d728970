// How do verbs estimate what is free in a Kalman filter's model?
#pragma once

#include <functional>
#include <vector>

#include "command/run.h"
#include "identify/noise/ml.h"

namespace identikal {

/// Of the search for the greatest likelihood. It refers to `progress`.
NoiseMlOptions likelihood_options(const SearchOptions& search, const ResultOptions& result,
                                  Progress& progress);

using FilterEstimator =
    std::function<Estimate(const ModelFile& model, const std::vector<Dataset>& recordings)>;

/// Loads the recordings, estimates, validates on what is held out, and finishes.
/// @param reject_outliers  samples that are outliers are found and left out
/// @return the exit code
int estimate_filter(const Run& run, ModelFile model, const RecordingOptions& options,
                    const std::string& held_out, bool reject_outliers, Progress& progress,
                    const FilterEstimator& estimator);

}  // namespace identikal
