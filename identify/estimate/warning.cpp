#include "identify/estimate/warning.h"

#include <utility>

namespace identikal {

std::string to_string(Severity severity) {
  switch (severity) {
    case Severity::note:
      return "note";
    case Severity::warning:
      return "warning";
    case Severity::serious:
      return "serious";
  }
  return "";
}

void warn(std::vector<Warning>& warnings, Severity severity, std::string code,
          std::vector<std::string> about, std::string text, std::string remedy) {
  warnings.push_back(
      {std::move(code), severity, std::move(about), std::move(text), std::move(remedy)});
}

}  // namespace identikal
