// Which model files can a user begin with? Commented, working ones, from identify/model/templates/.
#pragma once

#include <string>
#include <vector>

namespace identikal {

struct ModelTemplate {
  std::string name;
  std::string text;  ///< of the model file; its first comment says what it is for
};

/// In the order of their names.
///
/// Example:
///
///     for (const ModelTemplate& file : model_templates()) std::puts(purpose_of(file).c_str());
const std::vector<ModelTemplate>& model_templates();

/// What the template is for: its first comment line.
std::string purpose_of(const ModelTemplate& model);

}  // namespace identikal
