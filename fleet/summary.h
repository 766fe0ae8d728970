// What came out of a fleet, for people and for scripts?
#pragma once

#include <string>

#include "fleet/run.h"
#include "fleet/store.h"

namespace identikal {

/// How a run went: recordings, statuses, what failed and why. @param with_time  and how long it took
std::string summary_text(FleetStore& store, const FleetSummary& run, bool with_time);

/// How far the fleet is: statuses, every parameter's median and middle half over recordings with
/// status ok, what failed and why.
std::string status_text(FleetStore& store);
/// The same as JSON.
std::string status_json(FleetStore& store);

/// 0 when every recording is done and one at least has a result; 3 when some are not done; 2 when
/// none has a result.
int exit_code_of(const FleetCounts& counts);

}  // namespace identikal
