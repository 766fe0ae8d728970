// How was the car driven, and which parameters does that determine?
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// Speeds, lateral accelerations, frequencies and sides of the drive.
void measure_excitation(Scene& scene);

/// What the sensors read in straight running, for a second and more, is their offset.
void measure_straight_running(Scene& scene);

/// The verdicts, by the conditions of identifiability that are known before a fit.
void assess_identifiability(Scene& scene);

}  // namespace identikal::surveying
