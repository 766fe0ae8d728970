// Do other values than the estimates make the recordings as likely?
#pragma once

#include "identify/estimate/finding.h"
#include "identify/estimate/results.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/several_starts.h"
#include "lib/model/parameter.h"
#include "solvers/scoring.h"

namespace identikal {

/// Of searches that have ended as high as the best, those that are more than a standard error from
/// it, and at a maximum of their own: the recordings do not tell these values from the estimates.
/// Serious, but where one becomes the other by exchanging numbers or signs between parameters, as of
/// the terms of a sum.
/// @param estimate    with the parameters listed
/// @param by_entries  the likelihood by the free entries of `parameters`
Findings check_equal_maxima(const Estimate& estimate, const SeveralStarts& found,
                            const LikelihoodProblem& by_entries, const ParameterSet& parameters,
                            const FactorCoordinates& factors);

}  // namespace identikal
