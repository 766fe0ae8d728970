// How do verbs estimate what is free in a Kalman filter's model?
#pragma once

#include <functional>
#include <vector>

#include "jobs/run.h"

#include "identify/model/extension.h"
#include "identify/noise/ml.h"

namespace identikal {

/// Of the search for the greatest likelihood. It refers to the run.
NoiseMlOptions likelihood_options(const SearchOptions& search, const Run& run);

/// Can further parts be weighed: states that move, one model of all recordings, and normal noise?
bool takes_further_parts(const Model& model);

/// The run's model file as a tree, with what `components` and `sensors` stand for.
YamlNode written_out(const Run& run);

/// Tells the caller which further part is tried.
std::function<bool(const ModelExtension& extension)> told_of_parts(const Run& run);

/// What a verb makes of the model once the recordings are there.
using ModelPreparation =
    std::function<Model(const Model& model, const std::vector<Dataset>& recordings)>;

using FilterEstimator =
    std::function<NoiseEstimate(const Model& model, const std::vector<Dataset>& recordings)>;

/// Loads the recordings, estimates, validates on what is held out, and finishes.
/// @param reject_outliers  samples that are outliers are found and left out
Outcome estimate_filter(const Run& run, Model model, const RecordingOptions& options,
                        const std::string& held_out, bool reject_outliers,
                        const FilterEstimator& estimator, const ModelPreparation& prepare = {});

}  // namespace identikal
