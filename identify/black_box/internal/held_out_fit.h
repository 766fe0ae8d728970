// How well does a model do on rows it has not seen, and is another surely better there?
#pragma once

#include <Eigen/Core>

#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/scaled_recordings.h"

namespace identikal {

/// Fills the fits of rows that were not seen by the model of the first rows, mean over outputs, and whether they are luck;
/// takes it as that.
void judge_on_held_out(BlackBoxCandidate& candidate, const SplitRecordings& parts);

/// Fills `control`: of the outputs 1 to `horizon` rows ahead together, inputs known, from at most 2000 places.
void judge_for_control(BlackBoxCandidate& candidate, const ScaledRecordings& held_out,
                       Eigen::Index horizon);

/// Is the simulation of these rows by one of two worse than that by the other, by more than the scatter of the difference
/// from tenth to tenth of the rows allows (one-sided, 5 %)? Errors of simulations are slow: few rows hold few of them.
bool simulates_worse(const BlackBoxCandidate& one, const BlackBoxCandidate& than,
                     const ScaledRecordings& held_out);

}  // namespace identikal
