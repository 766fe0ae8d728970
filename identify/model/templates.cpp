#include "identify/model/templates.h"

namespace identikal {

std::string purpose_of(const ModelTemplate& model) {
  const std::string line = model.text.substr(0, model.text.find('\n'));
  return line.starts_with("# ") ? line.substr(2) : line;
}

}  // namespace identikal
