// Which models of which orders are there to choose from?
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "identify/black_box/internal/scaled_recordings.h"
#include "lib/polynomial/polynomial_model.h"
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

inline constexpr double kLargestPole = 0.9999;  ///< of stable models

/// Rows that the predictor looks back: as many as recordings of this length and with these gaps determine.
/// @throws InputError for recordings too short for any
Eigen::Index suitable_lags(const ScaledRecordings& recordings, int most_order);

/// @param start  of the search for the prior; null: from nothing
SubspaceStart subspace_start(const ScaledRecordings& recordings, Eigen::Index lags,
                             const PredictorPrior* start);

/// How B and D (and all else, of the prediction error method) are found.
enum class Refinement {
  none,              ///< regression on the states
  simulation,        ///< B and D by simulation
  output_error,      ///< all but K by simulation
  prediction_error,  ///< all of it by the prediction error method
  any_poles,         ///< the same, unstable ones too
  polynomials,       ///< the prediction error method of polynomials
};

struct BlackBoxCandidate {
  int order = 0;
  Refinement refinement = Refinement::none;
  InnovationForm model;                           ///< of scaled recordings
  InnovationForm of_first = {};                   ///< the same, fitted to the first rows alone
  std::vector<PolynomialModel> polynomials = {};  ///< of every output; empty of others
  /// Of the predictions of all rows; NaN where it was not asked.
  double log_likelihood = std::numeric_limits<double>::quiet_NaN();
  double bic = std::numeric_limits<double>::quiet_NaN();
  double hannan_quinn = std::numeric_limits<double>::quiet_NaN();
  double simulation = 0.0;  ///< fit of held-out rows, share of 1; NaN without inputs
  double prediction = 0.0;  ///< the same, one step ahead
  /// Held-out rows are simulated noticeably better than they are predicted, and than the rows that the
  /// model was fitted to are simulated.
  bool lucky = false;
  double control =
      std::numeric_limits<double>::quiet_NaN();  ///< the same, 1 to horizon steps ahead together
};

/// The model of an order, its sigma of the regression on the states; stable where its simulation has to be.
InnovationForm fitted(const SubspaceStart& start, const ScaledRecordings& recordings, int order,
                      Refinement how, bool stable);

/// Fills sigma, log-likelihood and the criteria of order by the predictions of the rows that it was fitted to.
void judge_on_fitted(BlackBoxCandidate& candidate, const ScaledRecordings& recordings,
                     const LaggedProducts& sums);
/// Covariance of the one-step prediction errors, p x p, row by row behind as many first rows of each recording as the
/// sums have lags; of the first 200 000 rows where there are more, or by the sums where the predictor forgets within
/// their lags.
Eigen::MatrixXd prediction_errors(const InnovationForm& model, const ScaledRecordings& recordings,
                                  const LaggedProducts& sums);

/// The sums with the states of this model before every window: near it nothing is cut off behind the lags.
LaggedProducts sums_around(const InnovationForm& model, const ScaledRecordings& recordings,
                           Eigen::Index lags);

/// The model of the prediction error method from this one on, by the sums; the start where it predicts no better.
InnovationForm refined(const InnovationForm& start, const ScaledRecordings& recordings,
                       const LaggedProducts& sums);

}  // namespace identikal
