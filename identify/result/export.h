// How does a result get into other programs? As text to paste: C++, C, MATLAB, Python, a model
// file, JSON.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "identify/result/file.h"

namespace identikal {

/// What to write.
enum class ExportFormat { cpp, c, matlab, python, yaml, json };

/// "cpp", "c", "matlab", "python", "yaml", "json".
const std::vector<std::string>& export_formats();
/// The same for people: "cpp, c, matlab, python, yaml or json".
std::string export_format_list();
std::optional<ExportFormat> export_format(std::string_view name);
/// For people: "MATLAB, Octave".
std::string_view describe(ExportFormat format);

/// The text, ending in a line feed. Numbers are the result's own, to the last digit. A filter comes
/// as its discrete-time matrices in SI with both gains, K of the predictor and L of the filter, a
/// vehicle as its parameters in SI and its tyre curve, a model of formulas as its parameters, noise
/// and start in SI, YAML as the model file with the estimates in it. All begins with comments, or
/// in JSON with keys: what it is, whether to trust it, the standard errors and verdicts, files with
/// SHA-256, version, command. An axle that stays straight as far as the recording goes has no
/// largest force: it is left out, and the tyre curve says so.
///
/// Example:
///
///     std::puts(export_text(stored, ExportFormat::cpp).c_str());
///
/// @param date  of the result, for the comments; empty: not known
/// @throws InputError when the result holds nothing to export, lacks a number of it, or its model
/// file cannot be filled
std::string export_text(const StoredResult& result, ExportFormat format,
                        const std::string& date = "");

}  // namespace identikal
