// What is a model in continuous time, where its inputs are held between the rows?
#pragma once

#include <vector>

#include "identify/black_box/internal/characteristics.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/estimate/details.h"
#include "lib/data/dataset.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// Of every output to every input,
///   G(s) = C (s I - A_c)^-1 B_c + D,   [A_c B_c; 0 0] = log [A B; 0 I] / dt,
/// which has the model's outputs at the rows where inputs are constant between them (Åström &
/// Wittenmark 1997, section 2.5). Nothing where the logarithm is not real: of a pole at or below zero,
/// as delays and oscillations by the sampling rate have.
/// @param model,moves  of scaled recordings
std::vector<BlackBox::TransferFunction> transfer_functions(const InnovationForm& model,
                                                           const std::vector<Move>& moves,
                                                           const OperatingPoint& point,
                                                           const Dataset& channels);

}  // namespace identikal
