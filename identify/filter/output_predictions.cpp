#include "identify/filter/output_predictions.h"

#include <cmath>

#include "identify/filter/simulated_fit.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The recording's row t by itself: the same `row` each time.
void set_row(const Dataset& recording, Index t, Dataset& row) {
  row.time[0] = recording.time[t];
  row.u.col(0) = recording.u.col(t);
  if (recording.noise_scale.rows() > 0) row.noise_scale.col(0) = recording.noise_scale.col(t);
}

}  // namespace

OutputPredictions predicted_outputs(const Model& model, const ParameterSet& parameters,
                                    const Dataset& recording, const FilterResult& filter) {
  OutputPredictions out{recording.y - filter.e, filter.e_sd, {}};
  if (recording.y.rows() > 1) out.covariance = filter.Sigma;
  Dataset row = samples_from(first_samples(recording, 1), 0);
  for (Index t = filter.first_proper; t < recording.size(); ++t) {
    if (!out.mean.col(t).hasNaN() || filter.x_pred.cols() == 0) continue;
    set_row(recording, t, row);
    const VectorXd expected = outputs_from(model, parameters, row, filter.x_pred.col(t));
    for (Index i = 0; i < expected.size(); ++i) {
      if (std::isnan(out.mean(i, t))) out.mean(i, t) = expected[i];
    }
  }
  return out;
}

}  // namespace identikal
