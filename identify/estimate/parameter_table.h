// Which parameters does a result report, in which units, and which ParameterSet do they stand for?
#pragma once

#include <string>
#include <string_view>

#include "identify/estimate/estimate.h"
#include "lib/model/parameter.h"

namespace identikal {

/// SI value of one `unit`; 1 for an unknown one.
double unit_scale(const std::string& unit);

/// Values of all reported entries in the user's units, and where they started.
void list_parameters(Estimate& estimate, const ParameterSet& start, const ParameterSet& end);

/// The same of values that are known, as far as this result goes.
void list_known_parameters(Estimate& estimate, const ParameterSet& parameters);

/// The parameter that a result calls so, nullptr where there is none.
const EstimatedParameter* reported(const Estimate& estimate, std::string_view name);

/// Correlation of two estimates; 0 where one of them has none.
double correlation_of(const Estimate& estimate, std::string_view a, std::string_view b);

/// The parameters with the values that a result holds.
///
/// Example:
///
///     const ParameterSet at = parameters_of(estimate, model.parameters);  // SI
ParameterSet parameters_of(const Estimate& estimate, const ParameterSet& parameters);

}  // namespace identikal
