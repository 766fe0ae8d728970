// What does a quantity on the command line mean in SI?
#pragma once

#include <string>

#include "lib/data/dataset.h"

namespace identikal {

/// NAME=VALUE may be given once for each name. @throws InputError
void refuse_twice(const std::string& option, const std::vector<std::string>& assignments);

/// "12", "12s", "60 km/h" in SI.
/// @param option  for the message
/// @param kind    a unit of the quantity expected, in which a bare number is
/// @throws InputError
double quantity(const std::string& option, const std::string& text, const std::string& kind);

/// "70%", "70" as 0.7. @throws InputError for "0.7" too, which could be 70 % or less than one
double percentage(const std::string& option, const std::string& text);

/// The share of a recording that is held out, "30%" as 0.3. @throws InputError outside 5% to 80%
double hold_out_share(const std::string& text);

/// "10s:95s", "10s:", ":95s"; empty: everything. @throws InputError
TimeRange parse_range(const std::string& text);

}  // namespace identikal
