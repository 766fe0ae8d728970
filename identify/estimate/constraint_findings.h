// Which constraints hold an estimate back, and do the data speak against them?
#pragma once

#include "identify/estimate/finding.h"
#include "lib/model/constraints.h"
#include "lib/model/parameter.h"

namespace identikal {

/// One of each equality that the data contradict and of each inequality that holds the estimate back.
/// @param parameters  of the model, to name those that a constraint is about
/// @param tested      whether the multipliers are of a likelihood that may be tested by: one of white
///   errors
///
/// Example:
///
///     const Constraints none;
///     const Findings findings = check_constraints(none, {}, model.parameters, true);
///     if (findings.empty()) std::puts("nothing holds the estimate back");
Findings check_constraints(const Constraints& constraints, const Multipliers& multipliers,
                           const ParameterSet& parameters, bool tested);

}  // namespace identikal
