// What was found amiss in a recording, a model or an estimate?
#pragma once

#include <string>
#include <vector>

namespace identikal {

struct Warning {
  std::string code;      ///< stable, e.g. "tyre_saturation"
  std::string severity;  ///< "note", "warning" or "serious"; serious makes the result untrusted
  std::vector<std::string> about;
  std::string text;    ///< what was seen, with figures
  std::string remedy;  ///< what to do about it
};

}  // namespace identikal
