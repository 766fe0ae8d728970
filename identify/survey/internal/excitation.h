// How was the car driven, and what could a fit tell from that?
#pragma once

#include "identify/survey/internal/aligned_signals.h"

namespace identikal::surveying {

/// Speeds, lateral accelerations, frequencies and sides of the drive.
void look_at_excitation(Scene& scene);

/// What the sensors say in straight driving, for a second and more, is their offset.
void look_at_straights(Scene& scene);

/// The verdicts, by the conditions of identifiability that are known before a fit.
void judge_identifiability(Scene& scene);

}  // namespace identikal::surveying
