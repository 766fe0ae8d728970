// Which lines of a model file would read this vehicle's recording?
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// The signals as they were taken.
void propose_mapping(const VehicleSignals& signals, Scene& scene);

/// Adds delays from the lags between signals. Finds one_clock.
void propose_delays(Scene& scene);

/// Where files have separate clocks, the lags are the offsets between them: several_clocks.
void report_clocks(Scene& scene);

}  // namespace identikal::surveying
