// Which linear model do recordings of inputs and outputs ask for, when nobody brings one? Order, matrices and
// noise together, with their errors.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/polynomial/polynomial_model.h"

namespace identikal {

enum class BlackBoxPurpose {
  automatic,   ///< the likeliest model, unless another simulates better
  simulation,  ///< outputs from inputs alone
  prediction,  ///< the next row from all before
  /// All rows up to a horizon ahead alike, from all before and the inputs until then: what a predictive controller minimises
  /// (Shook, Mohtadi and Shah 1992).
  control,
};

/// What kind of model; all but the first are polynomials of every output by itself (lib/polynomial/polynomial_model.h).
enum class ModelStructure {
  states,        ///< a state-space model of all outputs together
  arx,           ///< A y = B u + e
  armax,         ///< A y = B u + C e
  output_error,  ///< y = B/F u + e: the noise is left out of the model
  box_jenkins,   ///< y = B/F u + C/D e, C and D of one or two coefficients
};

struct BlackBoxOptions {
  ModelStructure structure = ModelStructure::states;
  /// Number of states, or of coefficients of each polynomial.
  int least_order = 1, most_order = 12;
  /// In place of a choice of orders; of polynomials alone.
  std::optional<PolynomialOrders> polynomials = {};
  /// Rows until every input is seen, of polynomials, at most 100; none: as Wald's test tells (BlackBox::delays).
  std::optional<Eigen::Index> delay = {};
  BlackBoxPurpose purpose = BlackBoxPurpose::automatic;
  /// Rows ahead that control looks, 1 to 1000; none: until the slowest pole of the likeliest model has come to 1/e, 2 to 100.
  std::optional<Eigen::Index> horizon = {};
  /// Of every recording, at its end, that candidates are judged on. The model that is chosen is estimated anew
  /// from all rows. Above 0, below 0.8.
  double held_out_share = 0.3;
  /// Called with what it does; false ends the search with the orders that were tried, which is a finding.
  std::function<bool(const std::string& what)> progress = {};
};

/// The model, and what the filter that it is makes of the recordings.
struct BlackBoxResult {
  BlackBoxEstimate estimate;
  Model model;
  std::vector<Dataset> recordings;  ///< as the model sees them: deviations from its operating point
};

/// x(t+1) = A x + B u + K e, y = C x + D u + e, of deviations from the operating point.
///
/// 1. A regularised predictor of many lags, its smoothness by empirical Bayes (lib/subspace/predictor.h).
/// 2. States of all orders by canonical variates (lib/subspace/realisation.h).
/// 3. Every order from the first rows of the recordings, with B and D by regression or by simulation; the
///    order by the fit of the held-out rows (simulation) or by BIC, for predictions by inputs from there upwards by
///    the criterion of Hannan & Quinn (1979).
/// 4. The one that is chosen by the prediction error method from all rows (lib/subspace/prediction_error.h);
///    where simulation is the purpose, kept where it does better on held-out rows.
///
/// Of polynomials: the prediction error method for every order from several starts (lib/polynomial/polynomial_errors.h), the
/// order by BIC, or where simulation is the purpose by held-out rows.
///
/// Example:
///
///     const BlackBoxResult motor = estimate_black_box(model, recordings, {.most_order = 8});
///     std::printf("%d states: %s\n", motor.estimate.black_box.order, motor.estimate.message.c_str());
///
/// @param channels    whose name, inputs, outputs and time are taken, nothing else
/// @param recordings  of these channels, on one sampling grid; outputs may miss samples, inputs not
/// @throws InputError for a channel that never changes, an input with gaps, recordings too short for any model or
///   for the least order
/// @throws InputError for a structure of inputs alone without inputs
/// @throws std::invalid_argument for options outside of their limits
BlackBoxResult estimate_black_box(const Model& channels, const std::vector<Dataset>& recordings,
                                  const BlackBoxOptions& options);

}  // namespace identikal
