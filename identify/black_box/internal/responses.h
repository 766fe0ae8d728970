// How do outputs answer to inputs, over rows and over frequency: without a model, and by the model?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/black_box/internal/characteristics.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/estimate/details.h"
#include "lib/data/dataset.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// Of every output to every input over up to `rows` rows without a model, by the kernel of largest evidence, in SI.
std::vector<BlackBox::ImpulseResponse> impulse_responses(const ScaledRecordings& recordings,
                                                         const Dataset& channels,
                                                         Eigen::Index rows);

/// What the model's outputs do behind a unit step of an input, in SI, with standard errors where there are moves.
/// @param model,moves  of scaled recordings
std::vector<BlackBox::StepResponse> step_responses(const InnovationForm& model,
                                                   const std::vector<Move>& moves,
                                                   const OperatingPoint& point,
                                                   const Dataset& channels, Eigen::Index rows);

/// Gain and phase of the model, and by spectral analysis, in SI.
std::vector<BlackBox::FrequencyResponse> frequency_responses(const InnovationForm& model,
                                                             const std::vector<Move>& moves,
                                                             const ScaledRecordings& recordings,
                                                             const Dataset& channels);

}  // namespace identikal
