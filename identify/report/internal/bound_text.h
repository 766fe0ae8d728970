// How does a Cramér-Rao bound read?
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The table of the bounds, what they mean for the steady gain, and those of K and Sigma
/// themselves.
std::string bound_text(const ResultSections& result);

}  // namespace identikal
