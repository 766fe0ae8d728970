// Which models of which orders are there to choose from, and how well does each do on rows it has not seen?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/black_box/internal/scaled_recordings.h"
#include "lib/subspace/innovation_form.h"
#include "lib/subspace/lagged_products.h"
#include "lib/subspace/predictor.h"
#include "lib/subspace/realisation.h"

namespace identikal {

/// Sums, predictor and states of one set of recordings.
struct SubspaceStart {
  LaggedProducts sums;
  PredictorPrior prior;
  Realisation states;
};

/// Rows that the predictor looks back: as many as recordings of this length determine.
/// @throws InputError for recordings too short for any
Eigen::Index suitable_lags(const ScaledRecordings& recordings, int most_order);

/// @param start  of the search for the prior; null: from nothing
SubspaceStart subspace_start(const ScaledRecordings& recordings, Eigen::Index lags,
                             const PredictorPrior* start);

/// How B and D (and all else, of the prediction error method) are found.
enum class Refinement {
  none,              ///< regression on the states
  simulation,        ///< B and D by simulation
  prediction_error,  ///< all of it by the prediction error method
};

struct BlackBoxCandidate {
  int order = 0;
  Refinement refinement = Refinement::none;
  InnovationForm model;         ///< of scaled recordings
  double log_likelihood = 0.0;  ///< of the predictions of rows that it was fitted to
  double bic = 0.0;
  double simulation = 0.0;  ///< fit of held-out rows, share of 1; NaN without inputs
  double prediction = 0.0;  ///< the same, one step ahead
};

/// The model of an order; stable where its simulation has to be.
InnovationForm fitted(const SubspaceStart& start, const ScaledRecordings& recordings, int order,
                      Refinement how, bool stable);

/// Fills log-likelihood and BIC by the sums.
void judge_on_sums(BlackBoxCandidate& candidate, const LaggedProducts& sums);
/// Fills the fits of rows that were not seen, mean over outputs.
void judge_on_held_out(BlackBoxCandidate& candidate, const ScaledRecordings& held_out);

/// The same by the prediction error method from this model on.
InnovationForm refined(const InnovationForm& start, const LaggedProducts& sums);

}  // namespace identikal
