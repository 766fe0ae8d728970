// Which rows of a recording does a model made of formulas use?
#pragma once

#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The segments of rows where use_when holds and every input is there, each a recording of its own
/// that starts from the model's initial state. Without either, the recording itself. Segments of
/// one row are left out. What was left out is said in the notes of the first.
///
/// Example:
///
///     const std::vector<Dataset> segments = usable_segments(model, recordings[0]);
///
/// @throws InputError when no segment is left
std::vector<Dataset> usable_segments(const Model& model, Dataset recording);

}  // namespace identikal
