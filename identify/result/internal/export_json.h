// How do exported numbers read as JSON?
#pragma once

#include <string>

#include "identify/result/internal/export_contents.h"

namespace identikal {

/// @param date  of the result; empty: not known
std::string export_json(const StoredResult& result, const ExportContents& contents,
                        const std::string& date);

}  // namespace identikal
