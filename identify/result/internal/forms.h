// How does a field stand in result.json where its C++ type alone does not say it?
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "identify/estimate/results.h"

namespace identikal {

/// A part of a result that not all jobs have; null where there is none.
template <class T>
struct Section {
  const T* held;           ///< what is written
  std::optional<T>* read;  ///< where a reader puts it
};

/// One of the values that this version knows; a result of another version may hold others.
template <class T>
struct Choice {
  T& value;
  std::vector<T> known;
};
inline Choice<std::string> one_of(std::string& text, std::vector<std::string> known) {
  return {text, std::move(known)};
}
inline Choice<int> one_of(int& number, std::vector<int> known) {
  return {number, std::move(known)};
}

/// The same, null where the text is empty.
struct ChoiceOrNull {
  std::string& text;
  std::vector<std::string> known;
};

/// A text that is never empty, a number that is never null.
template <class T>
struct Present {
  T& value;
};

/// 64 hexadecimal digits.
struct Sha256 {
  std::string& text;
};

/// Two ends, null where there is none: infinite on its side.
struct Ends {
  std::array<double, 2>& ends;
};

/// An object with the names of the channels as its keys.
struct ByChannel {
  std::vector<ChannelFit>& fits;
};

/// The code by its name, which another version may have given.
struct CodeOf {
  Finding& finding;
};

/// Only the printed() ones: a finding whose text is in the message of the status is left out.
struct Printed {
  Findings& findings;
};

// The values of the enumerations that stand in results, by their to_string().
inline constexpr std::array kStatusValues{Status::ok, Status::rejected, Status::not_converged,
                                          Status::untrusted};
inline constexpr std::array kVerdictValues{
    Verdict::ok,        Verdict::poorly_determined, Verdict::correlated, Verdict::at_bound,
    Verdict::unexcited, Verdict::not_identifiable,  Verdict::unfitted,   Verdict::untrusted};
inline constexpr std::array kSeverityValues{Severity::note, Severity::warning, Severity::serious};
constexpr const auto& values_of(Status /*any*/) { return kStatusValues; }
constexpr const auto& values_of(Verdict /*any*/) { return kVerdictValues; }
constexpr const auto& values_of(Severity /*any*/) { return kSeverityValues; }

}  // namespace identikal
