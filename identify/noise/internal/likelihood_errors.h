// What are the errors of a maximum of the likelihood?
#pragma once

#include <vector>

#include "identify/estimate/estimate.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/covariance_factors.h"

namespace identikal {

/// Errors of everything that was estimated, from the information at the maximum: of what lies on a
/// boundary none, of a covariance that has lost rank those along the directions in which it is
/// free (identify/noise/internal/free_directions.h).
/// @param best  where the search ended, in the coordinates of `problem`, which are the likelihood's
/// @return the covariances that have lost rank: none of their entries has a profile
std::vector<CovarianceEntries> judge_maximum(Estimate& estimate, RecordingsLikelihood& likelihood,
                                             const LikelihoodProblem& problem,
                                             const ParameterSet& end, const Eigen::VectorXd& best);

}  // namespace identikal
