// What does a posterior look like whose likelihood is dear? Weighted draws about its maxima.
#pragma once

#include <optional>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/bayes.h"

namespace identikal {

/// Importance sampling. The maxima of the posterior are found by Fisher scoring from several
/// starts, in the prior's coordinates; draws come from Student's t with 5 degrees of freedom about
/// each, as wide as the information there and the prior say, and a tenth of them from the prior
/// itself, so that no weight grows without limit. Where weights are too unequal, a t fitted to the
/// draws so far is added, and all draws are weighed by the mixture of what they came from. It takes
/// some thousand likelihoods where sequential Monte Carlo takes some hundred thousand. Sources:
/// Owen & Zhou (2000), Safe and effective importance sampling, JASA 95; Cornuet et al. (2012),
/// Adaptive multiple importance sampling, Scand. J. Statist. 39.
///
///     const auto points = importance_sample(model, prior, likelihood, {.draws = 2000});
///
/// @param likelihood  of the model; no priors of its own
/// @return weights that are worth half of options.draws, or at least a tenth; nothing when they
///   stay more unequal than that
std::optional<PosteriorPoints> importance_sample(const Model& model, const ParameterPrior& prior,
                                                 RecordingsLikelihood& likelihood,
                                                 const NoiseBayesOptions& options);

}  // namespace identikal
