// How much does each measured sample count for a state?
#pragma once

#include <iosfwd>
#include <optional>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// What an estimate of the states at one row owes to every measured sample,
///
///   x(t) = x0(t) + sum_k W_k y(k),
///
/// where x0 is what the start and the inputs alone would give.
struct ObservationWeights {
  Eigen::Index row = 0;  ///< t
  Eigen::MatrixXd
      weights;  ///< n x (ny N), W_0, W_1, ... side by side, SI; 0 where nothing was measured
};

/// By the smoother itself, of one impulse after the other: it is linear in what was measured, whatever the
/// start, the gaps, and the changes of its matrices. Cost: that of the smoother for every sample.
///
/// Example:
///
///     const ObservationWeights of = observation_weights(model, recordings[0], 50, std::nullopt);
///     std::printf("%g\n", of.weights.row(0).sum());  // 1 for a level whose start is diffuse
///
/// @param model  linear, one that changes from sample to sample included
/// @param row    t, from 0
/// @param lag    as run_smoother() has it (identify/filter/model_filter.h)
/// @throws InputError for another model or a wrapped output, for more than 5000 samples, where the
///   filter cannot run, and where a diffuse start is not determined at that row
/// Source: Koopman and Harvey (2003), "Computing observation weights for signal extraction and filtering".
ObservationWeights observation_weights(const Model& model, const Dataset& recording,
                                       Eigen::Index row, std::optional<Eigen::Index> lag);

/// Time of every row, and of every state and output what the state changes by one unit more of that output
/// there, in their units.
void write_weights_csv(std::ostream& out, const Model& model, const Dataset& recording,
                       const ObservationWeights& weights);

}  // namespace identikal
