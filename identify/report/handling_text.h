// How does the engineer's sheet of a vehicle read?
#pragma once

#include <string>

#include "identify/estimate/handling.h"

namespace identikal {

/// The sheet as text within 80 columns: figures of log and model side by side with their standard
/// errors, the characteristic curve, the frequency response at eight frequencies. What is blank has
/// the number of a sentence below that says why.
///
/// Example:
///
///     HandlingSheet sheet;  // of handling_sheet(), identify/handling/sheet.h
///     std::puts(handling_text(sheet).c_str());
std::string handling_text(const HandlingSheet& sheet);

}  // namespace identikal
