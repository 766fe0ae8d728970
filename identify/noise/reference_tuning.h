// Which noise makes a filter's estimates closest to a reference?
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/parameter.h"
#include "solvers/problem.h"

namespace identikal {

struct ReferenceTuningOptions {
  /// Optimisations: from the model's values, the likeliest, a slower filter, a faster one, scattered ones;
  /// 0: up to five, until the first three or more of them agree.
  int starts = 0;
  std::uint64_t seed = 1;  ///< of the scattered starts
  /// Called after every iteration; return false to stop: the best so far, not converged.
  std::function<bool(int start, int iteration, double criterion)> progress;
};

/// Minimises over the model's free parameters
///
///   J = sum_i n_i (1/2 log m_i + 0.01/2 (log nu_i)^2),   m_i = mean e_i^2,  nu_i = mean e_i^2 / v_i
///
/// with the errors e of reference i and their variances v (identify/filter/reference_errors.h), n_i
/// of them. The first term does not depend on units; common factors of Q and R, which it does not
/// see, are told by the second: of filters whose errors are the same, the one whose variance is
/// theirs. Exact derivatives through the filter's recursion; scoring in the logarithms of
/// variances. Standard errors allow for errors that are correlated in time (Newey & West 1987).
///
/// Example:
///
///     const NoiseEstimate estimate = tune_to_references(model, recordings);
///     for (const ReferenceFit& fit : estimate.references) std::printf("%g\n", fit.rmse);
///
/// @throws InputError as tune_ml(), and where the recordings hold no reference
NoiseEstimate tune_to_references(const Model& model, const std::vector<Dataset>& recordings,
                                 const ReferenceTuningOptions& options = {});

/// Where a likelihood was largest, would other values bring the estimates closer to the references?
/// Says by how much, and names the parameter that differs most, in its standard errors; nothing
/// without references. @param likeliest  the values to begin from
Findings check_against_references(const Model& model, const ParameterSet& likeliest,
                                  const std::vector<Dataset>& recordings);

}  // namespace identikal
