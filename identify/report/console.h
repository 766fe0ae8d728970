// What does a person read of a result on the console?
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The result as text within 80 columns, ending in a line feed.
std::string console_report(const ResultSections& result);

}  // namespace identikal
