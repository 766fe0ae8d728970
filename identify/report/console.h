// What does a person read, and what does a program? The console table and the files of a result.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "identify/estimate/estimate.h"

namespace identikal {

/// The result as text within 80 columns, ending in a line feed.
std::string console_report(const Estimate& estimate);

/// Of result.json and of what the report page draws; identify/result/result.schema.json states it
/// too.
inline constexpr int kSchemaVersion = 1;

/// The result as JSON (identify/result/result.schema.json). NaN and infinity become null.
/// @param timing_s  wall time of the job [s], the only field that may differ between equal runs
std::string result_json(const Estimate& estimate, bool strict, double timing_s);

/// Version of this program, "0.1.0".
std::string program_version();

/// Heading of a CSV column, "name [unit]", in quotes where a comma or a quote would end it.
std::string csv_heading(const std::string& name, const std::string& unit);

/// Measured, predicted and standardised residual of every channel as CSV, in the user's units.
std::string residuals_csv(const Estimate& estimate);

/// Estimate::course as CSV: mean and standard deviation of every parameter, and the statistic of
/// the test for a change.
std::string course_csv(const Estimate& estimate);

/// The spectra of Estimate::shaping as CSV: of the standardised innovations of the white model and
/// of the shaped one, 1 where white, with the band that holds 95 % of a white sequence.
std::string spectrum_csv(const Estimate& estimate);

/// SHA-256 of these bytes in hexadecimal.
std::string sha256_of_text(std::string_view text);

/// A file's bytes. @throws InputError, with what was expected and a hint, when it cannot be read.
std::string text_of_file(const std::string& path, const std::string& expected = "",
                         const std::string& hint = "");

/// SHA-256 of a file's bytes in hexadecimal. @throws InputError when it cannot be read.
std::string sha256_of_file(const std::string& path);

}  // namespace identikal
