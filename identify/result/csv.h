// Which series does a spreadsheet read of a result? As CSV.
#pragma once

#include <string>

#include "identify/estimate/estimate.h"

namespace identikal {

/// Heading of a CSV column, "name [unit]", in quotes where a comma or a quote would end it.
std::string csv_heading(const std::string& name, const std::string& unit);

/// Measured, predicted and standardised residual of every channel as CSV, in the user's units.
std::string residuals_csv(const Estimate& estimate);

/// Estimate::time_history as CSV: mean and standard deviation of every parameter, and the statistic
/// of the test for a change.
std::string course_csv(const Estimate& estimate);

/// The spectra of Estimate::shaping as CSV: of the standardised innovations of the white model and
/// of the shaped one, 1 where white, with the band that holds 95 % of a white sequence.
std::string spectrum_csv(const Estimate& estimate);

}  // namespace identikal
