// How far are a filter's estimates from what another instrument measured?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/recording_fit.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// One value of a reference z, measured with the standard deviation s, and what the filter says of
/// it given y up to and with the same row:
///
///   e = h(x_filt) - z,   v = H P_filt H' + s^2,   H = dh/dx
///
/// with derivatives by the model's free entries. SI.
struct ReferenceError {
  std::size_t recording = 0;
  Eigen::Index row = 0;        ///< of the recording
  Eigen::Index reference = 0;  ///< which of the model's
  double e = 0.0, v = 0.0;
  Eigen::VectorXd de, dv;  ///< empty unless requested
};

/// Shows every value of every reference of the recordings, but those of a diffuse start.
///
/// Example:
///
///     RecordingsLikelihood filters(model, recordings);
///     double squares = 0.0;
///     const auto see = [&](const ReferenceError& at) { squares += at.e * at.e; };
///     for_each_reference(model, model.parameters, recordings, filters, false, see);
///
/// @param filters  of this model and these recordings
/// @return how the filter ended; anything but ok: not all was shown
FilterStatus for_each_reference(const Model& model, const ParameterSet& at,
                                const std::vector<Dataset>& recordings,
                                RecordingsLikelihood& filters, bool with_derivatives,
                                const std::function<void(const ReferenceError&)>& see);

/// Per recording and reference, the first row at which v is no more than four times its median:
/// the filter has settled. What comes before says how it begins, not how it estimates. Empty where
/// the filter does not run.
using SettledRows = std::vector<std::vector<Eigen::Index>>;
SettledRows first_settled_rows(const Model& model, const ParameterSet& at,
                               const std::vector<Dataset>& recordings,
                               RecordingsLikelihood& filters);

/// What all of them come to from those rows on, per reference that has any value there, over the
/// recordings together.
/// @param settled  rows to begin with, for a comparison of several filters; empty: this one's own
std::vector<ReferenceFit> reference_fits(const Model& model, const ParameterSet& at,
                                         const std::vector<Dataset>& recordings,
                                         SettledRows settled = {});

/// Are the errors of another size than the filter says? Where nees is below 1/2 or above 2, and less
/// likely than 1 in 100 of as many independent errors (chi-square).
///
/// Example:
///
///     for (const ReferenceFit& fit : reference_fits(model, model.parameters, recordings)) {
///       if (is_out_of_band(fit)) std::printf("%s: NEES %g\n", fit.name.c_str(), fit.nees);
///     }
bool is_out_of_band(const ReferenceFit& fit);

}  // namespace identikal
