// Which series does a spreadsheet read of a result? As CSV.
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The text as a cell, in quotes where it would be taken for several cells or a comment (RFC 4180).
std::string csv_cell(const std::string& text);
/// The number with all its digits; nothing where it is not finite.
std::string csv_cell(double value);

/// Heading of a CSV column, "name [unit]".
std::string csv_heading(const std::string& name, const std::string& unit);

/// Measured, predicted and standardised residual of every channel as CSV, in the user's units.
///
/// Example:
///
///     std::puts(residuals_csv(estimate.series).c_str());
std::string residuals_csv(const Series& series);

/// Mean and standard deviation of every parameter, and the statistic of the test for a change.
/// @param series  of the same result: its time
std::string course_csv(const TimeHistory& history, const Series& series);

/// The spectra as CSV: of the standardised innovations of the white model and
/// of the shaped one, 1 where white, with the band that holds 95 % of a white sequence.
std::string spectrum_csv(const Shaping& shaping);

}  // namespace identikal
