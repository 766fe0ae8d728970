// How does a result become a page that a browser shows? One file, nothing fetched.
#pragma once

#include <string>

#include "identify/report/page_data.h"

namespace identikal {

/// What the page draws beyond the result, as JSON of kSchemaVersion: lines over time as {y} or
/// {lo, hi}, numbers rounded to a twenty-thousandth of their line's range (of themselves where the
/// axis is logarithmic), null for NaN.
/// @param result  what result_json() gave for the same estimate: its SHA-256 without the time that
///   the job took is kept, so that no page is made of parts that do not belong together; its own
///   too
std::string report_data_json(const ReportData& data, const std::string& result);

/// The page: HTML with styles, scripts and both JSON texts inside, of a result that was made just now
/// or read again (read_stored_result() with PageData::required: its text and data).
///
/// Example:
///
///     const std::string result = result_json(sections_of(estimate), false, 0.0);
///     const ReportData data = report_data(sections_of(estimate), recordings, {}, {});
///     const std::string html = report_page(result, report_data_json(data, result));
/// @param model_file  what the job has read, files that it includes too; null: those are read again
std::string report_page(const std::string& result, const std::string& data,
                        const ModelSource* model_file = nullptr);

}  // namespace identikal
