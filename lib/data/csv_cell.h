// Texts and numbers as cells of a CSV file.
#pragma once

#include <string>

namespace identikal {

/// The text, in quotes where it would be taken for several cells or a comment (RFC 4180).
std::string csv_cell(const std::string& text);
/// The number with all its digits; nothing where it is not finite.
std::string csv_cell(double value);

}  // namespace identikal
