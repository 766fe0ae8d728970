// Which lines of a model file would read this vehicle's recording?
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// The signals as they were taken.
void propose_mapping(const VehicleSignals& signals, Scene& scene);

/// Adds what the lags between signals say of their clocks. Finds one_clock.
void propose_delays(Scene& scene);

/// Files keep their own time, and the lags say how far apart these run: several_clocks.
void report_clocks(Scene& scene);

}  // namespace identikal::surveying
