// Can noise be estimated from these recordings, or a filter run over them?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Measured values in all recordings together.
Eigen::Index samples_present(const std::vector<Dataset>& recordings);
/// Rows in all of them where anything was measured.
Eigen::Index rows_present(const std::vector<Dataset>& recordings);

/// @throws InputError when nothing is free, samples are fewer than unknowns, an output never
/// changes or an input has gaps; std::invalid_argument without a recording
///
/// Example:
///
///     check_recordings(model, recordings);  // throws where noise cannot be estimated from them
///     std::printf("%td measured values\n", samples_present(recordings));
void check_recordings(const Model& model, const std::vector<Dataset>& recordings);

/// @throws InputError when an input has gaps; std::invalid_argument without a recording
void check_inputs(const std::vector<Dataset>& recordings);

/// @throws InputError when an output never changes or an input has gaps
void check_channels(const std::vector<Dataset>& recordings);

}  // namespace identikal
