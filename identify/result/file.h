// What does a result that was written before say? Reads result.json and what lies beside it.
#pragma once

#include <string>

#include "identify/estimate/results.h"

namespace identikal {

/// A result that was written before: all that result.json holds, hence neither series nor pictures.
/// A largest axle force that is null in the file, as it lies beyond what the recording showed, is
/// infinite here.
struct StoredResult {
  std::string path, text;       ///< of result.json
  std::string data_path, data;  ///< of kReportDataFile, of the same run; empty data: none was read
  std::string command;          ///< that made the result; empty: not known
  std::string version;          ///< of the program that wrote it
  StoredEstimate estimate;
};

/// Whether kReportDataFile, beside a result, is read.
enum class PageData { not_read, if_there, required };

/// @param path  result.json, or the folder that holds it
/// @throws InputError when a file is missing, is not whole, is of another schema version than 1 and
///   kSchemaVersion, lacks a key or holds something of another kind, was changed, or the two do not
///   belong together
///
/// Example:
///
///     const StoredResult tuned = read_stored_result("out");  // the folder that -o names
///     std::puts(tuned.estimate.message.c_str());
StoredResult read_stored_result(const std::string& path, PageData data = PageData::not_read);

/// The same from the files' texts. @param result  its paths, text and data are read
StoredResult parse_stored_result(StoredResult result);

/// A result's text, and that of what its page draws, as this program writes them: of schema version
/// 1 the keys and values are renamed, all else comes back as it is. Both were read before.
std::string result_in_this_version(const std::string& text);
std::string page_data_in_this_version(const std::string& text);

/// SHA-256 of a result's text without the one field that differs between equal runs.
std::string result_fingerprint(const std::string& text);

/// SHA-256 of kReportDataFile's text without the field that holds it.
std::string report_data_fingerprint(const std::string& text);

}  // namespace identikal
