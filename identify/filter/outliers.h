// Does anything in the recordings not belong to the model's noise: outliers, an offset?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"

namespace identikal {

struct Outlier {
  std::size_t recording;
  Eigen::Index channel, sample;
  double deviations;  ///< of its innovation, in robust standard deviations
};

/// Samples whose innovation, whitened by its own covariance, lies more than 6 robust standard
/// deviations (1.4826 median) from zero: of Gaussian noise one in 5e8. Where a sensor stands still,
/// ten equal samples or more, its innovations say nothing of its noise: the median is that of the
/// others. An outlier disturbs the
/// filter for a while, so it is taken out as it is met and what follows is predicted without it; and
/// once more, as long as the median without them finds others. Where a linear model changes from
/// sample to sample, or noise of equations is Student's, one is looked for at a time in every hundred
/// samples, and the filter run again.
///
/// Example:
///
///     const std::vector<Outlier> wrong = find_outliers(model, model.parameters, recordings);
///     const std::vector<Dataset> cleaned = without(recordings, wrong);
std::vector<Outlier> find_outliers(const Model& model, const ParameterSet& parameters,
                                   const std::vector<Dataset>& recordings);

/// The recordings with these samples missing.
std::vector<Dataset> without(std::vector<Dataset> recordings, const std::vector<Outlier>& outliers);

/// What becomes of an estimate when outliers are left out.
struct OutlierEffect {
  bool matters = false;
  std::string text;  ///< behind "... lie off", in words
};
using OutlierEffectOf = std::function<OutlierEffect(const std::vector<Dataset>& cleaned)>;

/// Outliers, and innovations whose mean is not zero, with the offset that would explain it.
/// An offset is serious, so that the result is not to be trusted, when it makes up more than 5 % of
/// the innovations' power: by that much the noise is overestimated. Outliers are serious when
/// they matter to the estimate; without `effect`, when they make up more than 5 % of the power.
/// @param filters  of each recording, at these parameters (identify/filter/report.h)
Findings check_outliers_and_offset(const Model& model, const ParameterSet& parameters,
                                   const std::vector<Dataset>& recordings,
                                   const std::vector<FilterResult>& filters,
                                   const OutlierEffectOf& effect = {});

/// Runs the estimator, leaves out what its estimate shows to be outliers, and runs it again until
/// no more are found. The result's finding "outliers_left_out" names them. More than a tenth of the
/// samples of an output are no outliers but a noise of another kind: then none is left out, and
/// "too_many_outliers" says so.
NoiseEstimate tune_robust(
    const Model& model, const std::vector<Dataset>& recordings,
    const std::function<NoiseEstimate(const std::vector<Dataset>& recordings)>& estimator);

}  // namespace identikal
