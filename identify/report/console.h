// What does a person read of a result on the console?
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The result as text within 80 columns, ending in a line feed.
///
/// Example:
///
///     std::fputs(console_report(sections_of(estimate)).c_str(), stdout);
std::string console_report(const ResultSections& result);

}  // namespace identikal
