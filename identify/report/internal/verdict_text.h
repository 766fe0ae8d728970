// How do verdicts and findings read?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/estimate.h"

namespace identikal {

/// "poorly determined", "correlated with a b"; "ok, effective" of a yaw inertia that holds more than
/// that of the masses (identify/estimate/effective_inertia.h).
std::string verdict_text(const EstimatedParameter& parameter);

/// The combinations that the data do not determine, a line each.
std::string unidentifiable_text(const Estimate& estimate);

/// Findings, each with its remedy on a line of its own.
std::string findings_text(const Findings& findings);

}  // namespace identikal
