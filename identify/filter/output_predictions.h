// What does a filter expect of every output before it is measured, whether or not it is measured then?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/filter_result.h"

namespace identikal {

/// SI; NaN before a diffuse start is determined.
struct OutputPredictions {
  Eigen::MatrixXd mean;  ///< ny x N: E[y(t) | y(1), ..., y(t-1)]
  Eigen::MatrixXd sd;    ///< ny x N: of the measurement, Sigma_ii^(1/2)
  /// N of ny x ny: Sigma = C P C' + R, of all outputs together; empty where there is one output.
  std::vector<Eigen::MatrixXd> covariance;
};

/// One step ahead: of an output that was measured its value less its innovation, else C E x + D u, or
/// the formula of a nonlinear model at the state that the filter expects.
///
/// Example:
///
///     const FilterResult filter = run_filter(model, model.parameters, recordings[0]);
///     const auto expected = predicted_outputs(model, model.parameters, recordings[0], filter);
///     std::printf("%g\n", expected.mean(0, 10));
///
/// @param filter  of this recording, with Keep::everything where there are several outputs or any is
///   missing
OutputPredictions predicted_outputs(const Model& model, const ParameterSet& parameters,
                                    const Dataset& recording, const FilterResult& filter);

}  // namespace identikal
