// Which model does a result stand for? The model file that it was made from, with the estimates in
// it.
#pragma once

#include <optional>
#include <string>

#include "identify/estimate/results.h"
#include "identify/model/model.h"

namespace identikal {

/// The model of the result's own copy of the model file, at the values that the result holds, known
/// ones (--set) too; linear.dt is that of the result's filter.
///
/// Example:
///
///     const Model fitted = estimated_model(stored.estimate, stored.path);
///
/// @param path  of the result, for messages
/// @throws InputError when the result holds no model file, one that includes a file that is gone or
///   has changed, or parameters that are not the model's
Model estimated_model(const StoredEstimate& result, const std::string& path);

/// The text of the model file with the values of estimated_model() where it has its starts; all
/// else stays as the user wrote it. Values beyond what the recording showed stay at their start. A
/// whole matrix that is singular is marked as fixed, for no search can start there.
/// @return nothing where a value stands such that no other can be put there (over several lines, in
///   a file that the model file includes)
/// @throws as estimated_model()
std::optional<std::string> estimated_model_text(const StoredEstimate& result,
                                                const std::string& path);

}  // namespace identikal
