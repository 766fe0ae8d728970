// Is this filter optimal for this recording? Tests of the innovations at the noise covariances that
// the model file gives.
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

/// Runs the filter with the file's values, nothing estimated, and puts its innovations to the tests
/// of identify/optimality/optimality.h, which together err with 5 % at most. Status rejected when
/// one fails; the message says what is wrong where: which entry of Q or R and which way, which
/// channel at which lag. `derived` holds the excess mean-square error of the present noise where the
/// model is linear; a nonlinear one has no steady filter to compare with.
///
/// Example:
///
///     const auto verdict = check(model, recordings);
///
/// @throws InputError for a vehicle or a regression, an output that never changes, an
/// input with gaps, or too few innovations
OptimalityReport check(const Model& model, const std::vector<Dataset>& recordings);
/// The same of recordings that are no longer there: the score test of Q and R, with all of the 5 %, and
/// how far the noise is from the likeliest. @throws InputError as check_takes_digests()
OptimalityReport check(const Model& model, const std::vector<RecordingDigest>& digests);

}  // namespace identikal
