// What does a model file say whose measurement noise has heavy tails?
#pragma once

#include "identify/model/yaml_reader.h"

namespace identikal {

/// The file with noise: {measurement: {kind: student}} beside what it says of the noise; itself where
/// it says that already.
///
/// Example:
///
///     const YamlNode heavy = with_student_noise(read_yaml("tracker.yaml"));
///     std::puts(model_file_text(heavy).c_str());
///
/// @throws InputError when the file gives the measurement noise of formulas as R
YamlNode with_student_noise(YamlNode root);

}  // namespace identikal
