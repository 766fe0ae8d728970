// What does the report page look like? Made from identify/report/page/ by the build.
#pragma once

#include <string_view>

namespace identikal {

/// The page, with {{result}}, {{data}}, {{paste}} and {{versions}} where its JSON blocks belong.
std::string_view report_template();

/// Names and versions of this program and of what it is made of, as JSON.
///
/// Example:
///
///     const std::string versions(report_versions());
///     std::puts(versions.c_str());
std::string_view report_versions();

}  // namespace identikal
