// What do all estimators of noise covariances do before and after their own work?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/model/model_file.h"
#include "lib/data/dataset.h"
#include "solvers/problem.h"

namespace identikal {

/// Measured values in all recordings together.
Eigen::Index samples_present(const std::vector<Dataset>& recordings);

/// @throws InputError when nothing is free, samples are fewer than unknowns, an output never
/// changes or an input has gaps; std::invalid_argument without a recording
void check_recordings(const ModelFile& model, const std::vector<Dataset>& recordings);

/// @throws InputError when an input has gaps; std::invalid_argument without a recording
void check_inputs(const std::vector<Dataset>& recordings);

/// @throws InputError when an output never changes or an input has gaps
void check_channels(const std::vector<Dataset>& recordings);

/// SI value of one `unit`; 1 for an unknown one.
double unit_scale(const std::string& unit);

/// Values of all reported entries in the user's units, and where they started.
void list_parameters(Estimate& estimate, const ParameterSet& start, const ParameterSet& end);

/// The same of values that are known, as far as this result goes.
void list_known_parameters(Estimate& estimate, const ParameterSet& parameters);

/// The parameters with the values that a result holds.
ParameterSet parameters_of(const Estimate& estimate, const ParameterSet& parameters);

/// The free parameters that have errors: those that lie inside their bounds.
struct InteriorParameters {
  std::vector<Eigen::Index> entries;  ///< their positions among the free entries
  std::vector<EstimatedParameter*> reported;
  Eigen::VectorXd unit;  ///< SI values of their units
};

/// The others get the verdict at_bound; where all are, the estimate says that there is no error.
/// @param at_boundary  of each free entry
InteriorParameters interior_parameters(Estimate& estimate, const std::vector<bool>& at_boundary);

/// Status and message: converged or not, and whether the data determine the unknowns. Without
/// convergence no error is left standing.
void conclude_noise_estimate(Estimate& estimate, const SolverSummary& summary);

/// What the errors of the parameters cost the filter (lib/filter/information.h), from their
/// standard errors and correlations as the estimate has them; or why that has no answer.
void describe_filter_loss(Estimate& estimate, const ModelFile& model, const ParameterSet& at);

/// Intervals of variances end at zero; what the errors cost; the filter at `end`, its tests and AIC
/// and BIC; a warning for innovations that are not white.
/// @throws InputError when the filter cannot run
void describe_noise_estimate(Estimate& estimate, const ModelFile& model, const ParameterSet& end,
                             const std::vector<Dataset>& recordings);

/// A result with a serious warning is untrusted.
void distrust_serious_warnings(Estimate& estimate);

/// A warning for every channel whose innovations are not white.
void warn_of_coloured_innovations(Estimate& estimate);

}  // namespace identikal
