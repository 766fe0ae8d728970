// What does a result that was written before say? Reads result.json.
#pragma once

#include <string>

#include "identify/estimate.h"

namespace identikal {

/// A result that was written before. Of the estimate there are identity, status, inputs,
/// parameters, objective and fits.
struct StoredResult {
  std::string path, text;  ///< of result.json
  Estimate estimate;
};

/// @param path  result.json, or the folder that holds it
/// @throws InputError when a file is missing, is not whole, is of another schema version, lacks a
///   key or holds something of another kind
StoredResult read_stored_result(const std::string& path);

}  // namespace identikal
