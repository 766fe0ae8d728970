// What does each signal of a vehicle's recording look like on its own: rate, range, held samples,
// outliers, dead channels?
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// Lists the signals. Finds dead_channel, held_samples, outliers.
void list_signals(const VehicleSignals& signals, Scene& scene);

/// How long, how fast. Finds standstill, reversing, units_speed.
void measure_speed(Scene& scene);

/// Channels that freeze while another one that follows them moves: stuck_channel.
void check_stuck(Scene& scene);

}  // namespace identikal::surveying
