// How likely are the first samples of recordings? Likelihoods of two models compare behind them.
#pragma once

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/filter_result.h"

namespace identikal {

struct LeadingSamples {
  /// Of every recording, the samples that determine a diffuse start; 0 where the start is another.
  Eigen::Index diffuse = 0;
  /// log p(y(1), ..., y(k)), k = 1, 2, ..., of all recordings together; NaN for k < diffuse.
  Eigen::VectorXd log_likelihood;
};

/// A diffuse log-likelihood has a constant that depends on the unit of every state and on how many
/// are diffuse. log p(y(1..N)) - log p(y(1..k)) = log p(y(k+1..N) | y(1..k)) has none, and two
/// models compare where both are taken behind the same k samples (Francke, Koopman & de Vos 2010).
///
/// Example:
///
///     const LeadingSamples leading = leading_samples(model, model.parameters, recordings);
///     std::printf("%ld samples determine the start\n", static_cast<long>(leading.diffuse));
///
/// @param model  linear or formulas; log_likelihood is empty where a filter does not run
LeadingSamples leading_samples(const Model& model, const ParameterSet& parameters,
                               const std::vector<Dataset>& recordings);

/// log p(y(t) | y(1), ..., y(t-1)) of every sample with normal noise, N; 0 where nothing was
/// measured, NaN before a diffuse start is determined.
/// Of transformed outputs, the density of what was recorded.
/// @param filter  of this recording, with Keep::everything where there are several outputs
Eigen::VectorXd log_likelihood_by_row(const FilterResult& filter, const Dataset& data);

/// log p(y(k+1), ... | y(1), ..., y(k)) of a result; NaN where it does not say.
double log_likelihood_behind(const Objective& objective, Eigen::Index k);

}  // namespace identikal
