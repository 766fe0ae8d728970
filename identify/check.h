// Is this filter optimal for this recording? Tests of the innovations at the noise covariances that
// the model file gives.
#pragma once

#include <vector>

#include "identify/estimate.h"
#include "identify/model_file.h"
#include "lib/dataset.h"

namespace identikal {

/// Runs the filter with the file's values, nothing estimated: the normalised innovation squared
/// against its two-sided chi-square band, and Ljung-Box on every channel's standardised
/// innovations. All tests together have a false-alarm rate of 5 % (Bonferroni). Status answer_no
/// when one fails; the message says which and in which direction.
/// @throws InputError for a model that is not in linear form
Estimate check_filter(const ModelFile& model, const std::vector<Dataset>& recordings);

}  // namespace identikal
