// Does a result hold on data that it was not made from?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

struct ValidateOptions {
  /// What every channel's fit has to reach [%] for the answer yes. Without it a filter has to pass
  /// its tests, and a simulated car has to explain half of its leading output, the yaw rate or else
  /// the one that it explains best, and every other one better than its mean (the limits of `fit`
  /// itself), and the values of a refit must not differ
  /// (identify/validation/internal/vehicle_refit.h): significantly at 5 % and with
  /// simulated outputs that move by more than 5 % of their size.
  std::optional<double> least_fit;
  bool robust = false;  ///< vehicles: outliers count as in fit --robust
};

/// Applies the model of a result to other recordings as it is, nothing refitted but the state at
/// the begin. A filter: one-step fit, log-likelihood per row, and the tests score (do these data
/// require other values?), nis and ljung_box, which allow for the estimates' own errors and err
/// with 5 % in all. A vehicle: fit of the simulation, and the test `refit`, with what it would make
/// of every value and the change of each that it detects (power 80 %) in `notes`. `derived` holds the same figures
/// of the result's own data to compare with. Status rejected where a test rejects it, with the
/// reason in the message. Warnings where a recording is one that the result was made from, where
/// the result was not to be trusted, and where the model file is no longer what it was.
///
/// Example:
///
///     const Model fitted = estimated_model(stored.estimate, stored.path);
///     const Validation answer = validate(sections_of(stored.estimate), fitted, recordings, {});
///     std::puts(answer.message.c_str());
///
/// @param result      sections_of() it, of this program or as read from its file
/// @param model       with its values, as estimated_model() gives it
/// @param recordings  of the model's channels
/// @param inputs      the files that the recordings come from
/// @throws InputError when the recordings cannot be used with the model
Validation validate(const ResultSections& result, const Model& model,
                    const std::vector<Dataset>& recordings, const std::vector<InputRecord>& inputs,
                    const ValidateOptions& options = {});

}  // namespace identikal
