#include "identify/estimate/conclusion.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace identikal {
namespace {

bool has_effect(const Finding& finding, Basis basis) {
  // That errors against a reference contradict the filter, no test of its innovations says.
  const bool of_tests = concludes(finding.code) || finding.code == FindingCode::reference_band;
  return finding.severity == Severity::serious && kind_of(finding.code).effect != Status::ok &&
         (basis == Basis::fit || of_tests);
}

/// Those that decide: of the first rank that has an effect.
Findings deciding(const Findings& findings, Basis basis) {
  Findings out;
  for (const Finding& f : findings) {
    if (!has_effect(f, basis)) continue;
    const Rank rank = kind_of(f.code).rank;
    if (!out.empty() && rank < kind_of(out.front().code).rank) out.clear();
    if (out.empty() || rank == kind_of(out.front().code).rank) out.push_back(f);
  }
  return out;
}

bool is_consequence(const Finding& finding) {
  return kind_of(finding.code).rank == Rank::consequence;
}

/// One note for all consequences: each code with what it is about.
Finding summary_of(const Findings& consequences) {
  std::vector<std::string> about;
  std::vector<std::pair<std::string, std::vector<std::string>>> by_name;
  for (const Finding& f : consequences) {
    const std::string own = name_of(f);
    const std::string name = own.starts_with("implausible_") ? "implausible" : own;
    auto at = std::find_if(by_name.begin(), by_name.end(),
                           [&](const auto& each) { return each.first == name; });
    if (at == by_name.end()) at = by_name.insert(at, {name, {}});
    at->second.insert(at->second.end(), f.about.begin(), f.about.end());
    for (const std::string& each : f.about) {
      if (std::find(about.begin(), about.end(), each) == about.end()) about.push_back(each);
    }
  }
  std::string list;
  for (const auto& [name, of] : by_name) {
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", name, fmt::join(of, ", "));
  }
  return make_finding(FindingCode::consequences, about,
                      "also found, as the above causes it: " + list,
                      "fit again when the above is fixed");
}

Findings causes_first(const Findings& findings) {
  Findings causes, consequences, others;
  for (const Finding& f : findings) {
    (is_misreading(f) ? causes : is_consequence(f) ? consequences : others).push_back(f);
  }
  if (!consequences.empty()) causes.push_back(summary_of(consequences));
  append(causes, others);
  return causes;
}

std::vector<std::string> reasons(const Findings& findings) {
  std::vector<std::string> out;
  for (const Finding& f : findings) {
    const bool named =
        f.severity == Severity::serious && kind_of(f.code).in_message == InMessage::name;
    const std::string name = name_of(f);
    if (named && std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
  }
  return out;
}

std::string texts(const Findings& findings, const std::string& between) {
  std::string out;
  for (const Finding& f : findings) out += (out.empty() ? "" : between) + f.text;
  return out;
}

/// @param by  what decides, not empty; all: every finding, in order
std::string message_of(const Findings& by, const Findings& all,
                       const std::string& message_when_ok) {
  switch (kind_of(by.front().code).in_message) {
    case InMessage::text:
      return texts(by, "; ");
    case InMessage::addition:
      return message_when_ok + texts(by, "");
    case InMessage::misfit:
      return message_when_ok + ", but the data do not fit the model: see the warnings";
    case InMessage::name:
    case InMessage::nothing:
      break;
  }
  return fmt::format("do not use these values: {}", fmt::join(reasons(all), ", "));
}

/// What is said behind any message: it has no effect on the status.
std::string standing_addition(const Findings& findings) {
  Findings out;
  std::copy_if(findings.begin(), findings.end(), std::back_inserter(out), [](const Finding& f) {
    const FindingKind& kind = kind_of(f.code);
    return kind.in_message == InMessage::addition && kind.effect == Status::ok;
  });
  return texts(out, "");
}

}  // namespace

Conclusion conclude(const Findings& findings, const std::string& message_when_ok, Basis basis) {
  Conclusion out{Status::ok, message_when_ok, findings};
  const Findings by = deciding(findings, basis);
  if (!by.empty()) {
    const FindingKind& first = kind_of(by.front().code);
    if (first.rank == Rank::misreading) out.findings = causes_first(findings);
    out.status = first.effect;
    out.message = message_of(by, out.findings, message_when_ok);
  }
  out.message += standing_addition(findings);
  return out;
}

}  // namespace identikal
