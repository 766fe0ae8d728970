// How do exported numbers read as source code?
#pragma once

#include <string>

#include "identify/result/internal/export_contents.h"

namespace identikal {

/// A header of C, or of C++; all stands under the name of the model.
/// @param comments  that it begins with, lines with their marks
std::string c_header(const ExportContents& contents, const std::string& model,
                     const std::string& comments, bool cpp);
std::string matlab_script(const ExportContents& contents);
std::string python_script(const ExportContents& contents);

}  // namespace identikal
