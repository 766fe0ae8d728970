// Which of several Kalman filters suits these recordings best?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Ranks filters as they are, nothing estimated: on recordings they were not tuned on this is the
/// held-out likelihood. tests[] holds for every filter, by its file,
///
///   log_likelihood  with p of the difference to the best one: of its mean over the samples,
///                   against the scatter of their differences (Diebold & Mariano 1995, long-run
///                   variance), the covariance of the innovations taken as steady
///   measure_mean    N/l sum_j Psi_j(M), (3.23)
///   measure_worst   max_j N Psi_j(M), (3.24)
///   measure_order   max over m of -(N log|I - ...| + m l^2 log N), the negative of (3.22): how
///                   much an autoregressive model of the innovations would gain. As printed,
///                   (3.25) takes absolute values, and is then largest of white innovations
///   optimal         1 or 0 (identify/optimality/optimality.h)
///
/// and `pass` with the best of each. Lower measures are better. Lines in notes say the same in a
/// table. Status ok.
///
/// Example:
///
///     Model louder = model;
///     louder.parameters[0].value *= 2.0;
///     const auto ranking = compare_filters({model, louder}, {recordings, recordings});
///
/// @param recordings  of each model: its own view of the same files; units and offsets of the
///   outputs may differ, likelihoods are those in units of the first
/// @throws InputError for fewer than two models, a vehicle, a regression, and outputs that differ
/// Source: Matisko (2013), (3.23) to (3.25).
Comparison compare_filters(const std::vector<Model>& models,
                           const std::vector<std::vector<Dataset>>& recordings);

}  // namespace identikal
