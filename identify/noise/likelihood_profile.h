// How fast does the likelihood fall on both sides of its maximum?
#pragma once

#include <functional>
#include <optional>

#include "identify/estimate/pictures.h"

namespace identikal {

/// Walks from the maximum to both sides until the likelihood has fallen to twice the 95 % limit,
/// the bound is reached or nothing more can be computed.
///
/// Example:
///
///     const auto drop = [](double value, bool) { return std::optional(std::pow(value - 3, 2)); };
///     const LikelihoodProfile profile = walk_profile(3.0, 1.0, 0.0, 9.0, drop);
///
/// @param at            the maximum, in any unit
/// @param se            standard error there, same unit: sets the steps, > 0
/// @param lower, upper  bounds; may be infinite
/// @param drop          2 (L_max - L) with the parameter held at `value` and all others estimated;
///   `turned` when the walk begins again at the maximum; nothing where it has no answer
/// @return without a name; the maximum is one of its points
LikelihoodProfile walk_profile(
    double at, double se, double lower, double upper,
    const std::function<std::optional<double>(double value, bool turned)>& drop);

}  // namespace identikal
