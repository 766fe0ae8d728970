// What do all estimators of noise covariances do before and after their own work?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "solvers/problem.h"

namespace identikal {

/// Objective::method where the filter is the caller's own.
inline constexpr const char* kOwnFilter = "own filter";

/// The free parameters that have errors: those that lie inside their bounds.
struct InteriorParameters {
  std::vector<Eigen::Index> entries;  ///< their positions among the free entries
  std::vector<EstimatedParameter*> reported;
  Eigen::VectorXd unit;  ///< SI values of their units
};

/// The others get the verdict at_bound; where all are, the estimate says that there is no error.
/// @param at_boundary  of each free entry
InteriorParameters interior_parameters(Estimate& estimate, const std::vector<bool>& at_boundary);

/// Without convergence no error is left standing: the shape of the likelihood away from its maximum
/// says nothing about errors.
void withdraw_errors(Estimate& estimate);

/// That the data do not determine the unknowns, and that the search did not converge.
/// @param more  behind the names of what is not determined
Findings check_search(const Estimate& estimate, const SolverSummary& summary,
                      const std::string& more = "");

/// That there are fewer than five samples for each unknown: the likelihood is no parabola yet.
/// Serious below three.
/// @param freedom  of errors that allow for it (Estimate::covariance_freedom): then it is a warning
Findings check_length(long samples, double unknowns, double freedom = kNone);

/// What the errors of the parameters cost the filter (lib/filter/information.h), from their
/// standard errors and correlations as the estimate has them; or why that has no answer.
ExcessMeanSquareError excess_error(const Estimate& estimate, const Model& model,
                                   const ParameterSet& at);

/// Intervals of variances end at zero; what the errors cost; the filter at `end`, its tests and AIC
/// and BIC; what the innovations show: outliers, an offset, colour.
/// @throws InputError when the filter cannot run
void report_noise_estimate(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                           const std::vector<Dataset>& recordings);

/// The same where recordings are no longer there: what the likelihood alone says.
void report_digest_estimate(NoiseEstimate& estimate, const Model& model, const ParameterSet& end,
                            RecordingsLikelihood& likelihood);

/// Channels whose innovations are not white, or follow the inputs, by the tests of the estimate.
///
/// Example:
///
///     const Findings left = check_innovations(estimate);
///     for (const Finding& finding : left) std::puts(finding.text.c_str());
///
/// @param of_own_values  the share of variance that colour may have by values fitted to single
///   recordings
Findings check_innovations(const FilterEstimate& estimate, double of_own_values = 0.0);

}  // namespace identikal
