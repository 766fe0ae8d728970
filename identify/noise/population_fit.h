// Which values have parameters that differ from recording to recording as draws of a population?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "identify/noise/ml.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Maximises the marginal likelihood (identify/population/mixed_effects.h) of a model whose file says
/// `spread` of some parameters: each of them is their mean, `sd_NAME` the standard deviation between
/// recordings (or between labels, as `per` says), and the values of single recordings are their most
/// probable ones, drawn to the mean by as little as the recording says of them. Of a parameter that
/// cannot be negative the logarithm is normal: the mean is its median. Searches begin at the file's
/// values and at scattered ones, four by default and two of more than 10,000 samples. The
/// log-likelihood, AIC and BIC are marginal; recordings that do not belong to the population are
/// named, with at most 5 % of those named on average being of it all the same.
///
/// Example:
///
///     const Model model = for_recordings(read_model_file("growth.yaml"), recordings);
///     const NoiseEstimate all = fit_population(model, recordings);
///     for (const EstimatedParameter& p : all.parameters) std::puts(p.name.c_str());
///
/// @throws InputError for spreads by different labels, a recording with a number of its own for such a
///   parameter, fewer than three recordings or labels, and an objective other than one step
NoiseEstimate fit_population(const Model& model, const std::vector<Dataset>& recordings,
                             const NoiseMlOptions& options = {});

}  // namespace identikal
