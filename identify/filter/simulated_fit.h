// What does a model do on its own, and how well does it predict rows that were held out?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The outputs without noise, by the inputs alone, from the state at the first sample as the whole
/// recording determines it (the smoother of identify/filter/model_filter.h; where that does not
/// run, the model's start): nothing of the recording enters but through that state.
///
/// Example:
///
///     const Eigen::MatrixXd simulated = simulated_outputs(model, model.parameters, recordings[0]);
///
/// @param model  of the form linear or nonlinear
/// @return SI, ny x N; infinite where the motion diverges
Eigen::MatrixXd simulated_outputs(const Model& model, const ParameterSet& parameters,
                                  const Dataset& recording);

/// What is measured less what is simulated, an angle's difference the short way round.
/// @return SI, ny x N; NaN where nothing is measured
Eigen::MatrixXd simulation_errors(const Model& model, const ParameterSet& parameters,
                                  const Dataset& recording);

/// simulated_outputs() from a state that is given: x at the recording's first sample.
Eigen::MatrixXd outputs_from(const Model& model, const ParameterSet& parameters,
                             const Dataset& recording, const Eigen::VectorXd& x);

/// Why a simulation of this recording says nothing about the model: no input drives it, so that all
/// that moves it is noise; or it explains nothing of an output and an error of the start does not
/// fade, as in a model that integrates: then neither does what noise has added, and the simulation
/// would fail with the true model too. In words; empty where it says something. Of a nonlinear model
/// the transitions count that are linearised along the recording, at the smoothed states.
/// @param fits  of the simulation
std::string why_no_simulation(const Model& model, const ParameterSet& parameters,
                              const Dataset& recording, const std::vector<ChannelFit>& fits);

/// Fills `simulation` with the fit of these simulations; or says in a note why there is none.
void report_simulation(FilterEstimate& estimate, const Model& model, const ParameterSet& parameters,
                       const std::vector<Dataset>& recordings);

/// Rows from `from` on were not fitted to; those before were.
struct HeldOut {
  Dataset recording;
  Eigen::Index from = 0;
};

/// Fills `hold_out` and `hold_out_one_step`, `derived` with log-likelihoods per row, held out and
/// fitted, and the pictures of held-out rows. The filter goes on from what it knows of the state at
/// the first of them; where nothing was before, from the model's start.
/// @param estimate  of this model; its parameters are taken, its data are the rows before
void report_hold_out(FilterEstimate& estimate, const Model& model,
                     const std::vector<HeldOut>& held_out);

}  // namespace identikal
