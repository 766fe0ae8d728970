// Which form do the files of a result have?
#pragma once

#include <algorithm>
#include <string>

namespace identikal {

/// Of result.json and of what the report page draws; identify/result/result.schema.json states it
/// too.
inline constexpr int kSchemaVersion = 2;

/// JSON Schema of result.json, as identify/result/result.schema.json holds it.
///
/// Example:
///
///     const std::string schema = result_schema();
std::string result_schema();

/// Name of the file beside result.json that holds what the page draws.
inline constexpr const char* kReportDataFile = "report_data.json";

/// A value of the schema as people read it: "poorly determined" of "poorly_determined".
///
/// Example:
///
///     std::puts(in_words("poorly_determined").c_str());  // poorly determined
inline std::string in_words(std::string value) {
  std::replace(value.begin(), value.end(), '_', ' ');
  return value;
}

}  // namespace identikal
