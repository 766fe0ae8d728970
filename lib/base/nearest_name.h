// Which known name did the user probably mean?
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace identikal {

/// ASCII letters in lower case.
std::string lower_case(std::string_view text);

/// The candidate nearest to `name` in Damerau-Levenshtein distance, ignoring case; empty when none
/// is within max(2, size/3) edits, and fewer edits than letters, or when there are no candidates.
/// Among equally near ones that with the same first and last letter.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// "did you mean 'x'?", or "" when nothing is near. Ready to be the hint of an InputError.
///
/// Example:
///
///     const std::string hint = did_you_mean("yawrate", {"yaw_rate", "vx"});
std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace identikal
