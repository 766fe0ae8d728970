// Which numbers of a model are sizes of its noise alone?
#pragma once

#include <vector>

#include "identify/model/model.h"

namespace identikal {

/// For every free entry (lib/model/parameter.h), in their order: does it move nothing but Q, R and
/// S (at the values of the model)?
///
/// Example:
///
///     const Model model = read_model_file("motor.yaml");
///     const std::vector<bool> noise = entries_of_noise(model);
///     if (std::find(noise.begin(), noise.end(), false) == noise.end()) std::puts("noise alone");
std::vector<bool> entries_of_noise(const Model& model);

/// Can no noise move the states, whatever the values are? They then follow from their start.
bool moves_without_noise(const Model& model);

}  // namespace identikal
