// What drove the states, and what disturbed the outputs, given the whole recording? And which trajectories may
// the states have taken?
#pragma once

#include <cstdint>
#include <iosfwd>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Time, and of every process noise its estimate and that estimate's standard deviation; of every output
/// the same of its noise; then t-values of a jump of every state behind this row, and of every output's
/// error: N(0, 1) each, if the model is right. Equations: lib/filter/disturbance_smoother.h. Process
/// noise has the name of its state where there is one for each, with "_noise", else w1, w2, ...
///
/// Example:
///
///     std::ostringstream csv;
///     write_disturbances_csv(csv, model, recordings);
///
/// @param model  has_disturbance_smoother() (identify/filter/model_filter.h)
/// @throws InputError where the filter cannot run
void write_disturbances_csv(std::ostream& out, const Model& model,
                            const std::vector<Dataset>& recordings);

/// Draws from p(x(1), ..., x(N) | y), jointly over all rows: number of the trajectory, time, every state.
/// Equations: lib/filter/simulation_smoother.h. The same seed draws the same ones.
/// @param model  linear, one that changes from sample to sample included
/// @throws InputError for another one, and where the filter cannot run
void write_trajectories_csv(std::ostream& out, const Model& model,
                            const std::vector<Dataset>& recordings, int count, std::uint64_t seed);

}  // namespace identikal
