// What were the states, sample by sample? Filtered or smoothed states and innovations of recordings
// as CSV.
#pragma once

#include <iosfwd>
#include <optional>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/filter/output_predictions.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"
#include "lib/filter/smoother.h"

namespace identikal {

struct FilterRunOptions {
  /// Given all that was recorded up to so many samples later: 0 filters. Nothing: given the whole
  /// recording.
  std::optional<Eigen::Index> lag = 0;
  /// The log-likelihood is that of what comes behind so many samples of every recording, given them:
  /// at least those that determine a diffuse start.
  Eigen::Index skip_first = 0;
  bool by_row = false;  ///< whether log-likelihoods and predictions of every row are wanted
};

/// Noise, gain, fit, tests, and a note about every state; status ok.
struct StateEstimate : FilterEstimate {
  std::vector<SmootherResult> states;     ///< of every recording; deviations only
  std::vector<FilterResult> innovations;  ///< of every recording
  /// Of every recording, N (identify/filter/leading_samples.h); NaN with noise of Student's t. Empty
  /// unless FilterRunOptions ask for it.
  std::vector<Eigen::VectorXd> log_likelihood_by_row;
  std::vector<OutputPredictions> predictions;  ///< likewise
};

/// Runs the model's filter, as it is, over every recording, each from the model's initial state.
///
/// Example:
///
///     const StateEstimate run = filter_recordings(model, recordings, {.lag = 10});
///     const Eigen::MatrixXd x = run.states[0].x, sd = run.states[0].sd;  // of the first recording
///
/// @param model  of the form linear or nonlinear
/// @throws InputError for an input with gaps, and where the filter cannot run;
///   std::invalid_argument for a model of another form
StateEstimate filter_recordings(const Model& model, const std::vector<Dataset>& recordings,
                                const FilterRunOptions& options);

/// Time as recorded [s], and of every state its value and standard deviation. States that formulas
/// name are called and measured so; else a state that an output shows as it is has that output's
/// name and unit, and the others are x1, x2, ... in SI. Empty cells while a diffuse start is not
/// determined. Several recordings follow each other, their number in the first column.
void write_states_csv(std::ostream& out, const Model& model, const std::vector<Dataset>& recordings,
                      const StateEstimate& run);

/// Time, and of every output the innovation, its standard deviation, and the standardised
/// innovation (lib/filter/kalman.h), in the outputs' units, empty where nothing was measured; then
/// the log-likelihood of the row, given those before, where the run has it.
void write_innovations_csv(std::ostream& out, const std::vector<Dataset>& recordings,
                           const StateEstimate& run);

/// Time, and of every output what the filter expects of it, given the rows before, with the standard
/// deviation of a measurement, in the outputs' units; then, of every two outputs, the correlation of
/// their innovations. In every row, measured or not; empty cells before a diffuse start is determined.
void write_predictions_csv(std::ostream& out, const std::vector<Dataset>& recordings,
                           const StateEstimate& run);

}  // namespace identikal
