// What was found amiss in a recording, a model or an estimate?
#pragma once

#include <string>
#include <vector>

namespace identikal {

enum class Severity {
  note,
  warning,
  serious,  ///< makes the result untrusted
};

/// As results print it: "note", "warning", "serious".
std::string to_string(Severity severity);

struct Warning {
  std::string code;  ///< stable, e.g. "tyre_saturation"
  Severity severity = Severity::note;
  std::vector<std::string> about;
  std::string text;    ///< what was seen, with figures
  std::string remedy;  ///< what to do about it; may be empty
};

/// Appends a warning.
void warn(std::vector<Warning>& warnings, Severity severity, std::string code,
          std::vector<std::string> about, std::string text, std::string remedy = "");

}  // namespace identikal
