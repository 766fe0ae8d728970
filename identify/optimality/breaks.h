// Where does a state jump by more than its noise: a level that shifts, a slope that breaks?
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// A jump of one state between two samples.
struct Break {
  std::size_t recording = 0;
  Eigen::Index state = 0, sample = 0;  ///< the last sample before it; both 0-based
  double jump = 0.0;                   ///< estimate, SI
  double t = 0.0;                      ///< in its standard deviations
  double p = 0.0;                      ///< of one as large, anywhere in the recording
};

/// The largest jump of every recording, where chance has one as large anywhere in it with less than
/// 1 %: t-values of smooth_disturbances() (lib/filter/disturbance_smoother.h) of all n states at all
/// N samples, in units of their typical size where that is above 1, so that a Q that is too small is
/// no break, and with p = n N P(|z| > |t|). Where a neighbouring output is further off than
/// the state it is an outlier, not a break.
///
/// Example:
///
///     for (const Break& b : find_breaks(model, recordings)) {
///       std::puts(sentence(b, model, recordings).c_str());
///     }
///
/// Nothing where there is no such smoother: for a nonlinear model or S other than zero; nor for
/// recordings of N n^2 above one million, which it would take long to look through.
/// Sources: Harvey & Koopman (1992), "Diagnostic checking of unobserved-components time series
/// models"; de Jong & Penzer (1998), "Diagnosing shocks in time series".
std::vector<Break> find_breaks(const Model& model, const std::vector<Dataset>& recordings);

/// As a result says it.
std::string sentence(const Break& found, const Model& model,
                     const std::vector<Dataset>& recordings);

}  // namespace identikal
