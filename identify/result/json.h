// What does another program read of a result? JSON (identify/result/result.schema.json).
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// The result as JSON (identify/result/result.schema.json). NaN and infinity become null.
///
/// Example:
///
///     std::puts(result_json(sections_of(estimate), false, 0.0).c_str());
///
/// @param timing_s  wall time of the job [s], the only field that may differ between equal runs
std::string result_json(const ResultSections& result, bool strict, double timing_s);

}  // namespace identikal
