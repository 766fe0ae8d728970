// What has a reader of exported numbers to know? Where they come from, whether to trust them, what
// they mean.
#pragma once

#include <string>
#include <vector>

#include "identify/result/file.h"

namespace identikal {

/// The largest force of an axle that stays straight as far as it was driven: it has no number.
bool is_straight(const EstimatedParameter& parameter);

/// What everybody who finds the numbers later wants to know. @param date  empty: not known
std::vector<std::string> origin_lines(const StoredResult& result, const std::string& date);

/// A parameter's standard error and verdict, or why it has none.
std::string remark_of(const EstimatedParameter& parameter);
std::vector<std::string> parameter_lines(const StoredEstimate& estimate, bool with_known);

/// The equations of a vehicle with the result's tyre curve, and those of a filter.
std::vector<std::string> vehicle_lines(const StoredEstimate& estimate);
std::vector<std::string> filter_lines(const StoredEstimate& estimate);

/// "level (recorded in cm), ...".
std::string channel_list(const std::vector<SteadyFilter::Channel>& channels,
                         const char* unit_is = "recorded in ");

/// One comment a line; nothing that a user wrote ends it or carries it on into the next.
std::string commented(const std::vector<std::string>& lines, const std::string& mark);

}  // namespace identikal
