#include "identify/report/internal/verdict_text.h"

#include <fmt/format.h>

#include "identify/estimate/effective_inertia.h"
#include "identify/report/internal/text_layout.h"
#include "identify/result/schema.h"

namespace identikal {

std::string verdict_text(const EstimatedParameter& parameter) {
  std::string out = in_words(to_string(parameter.verdict));
  if (!parameter.with.empty()) out += " with";
  for (const std::string& other : parameter.with) out += " " + other;
  if (is_effective_inertia(parameter)) out += ", effective";
  return out;
}

std::string unidentifiable_text(const Estimate& estimate) {
  std::string out;
  for (const Identifiability::Direction& d : estimate.identifiability.unidentifiable_directions) {
    std::string line = "not identifiable: the combination";
    for (std::size_t i = 0; i < d.names.size(); ++i) {
      line += fmt::format(" {:+.2f} {}", d.weights[i], d.names[i]);
    }
    out += wrapped(line + " (in units of their standard errors)", 7);
  }
  return out;
}

std::string findings_text(const Findings& findings) {
  std::string out;
  for (const Finding& w : findings) {
    const std::string severity = w.severity == Severity::note      ? "note "
                                 : w.severity == Severity::serious ? "SERIOUS "
                                                                   : "warn ";
    out += wrapped(severity + name_of(w) + ": " + w.text, 7);
    if (!w.remedy.empty()) out += wrapped("       -> " + w.remedy, 10);
  }
  return out;
}

}  // namespace identikal
