// Do other recordings give significantly different parameters than a result has?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// What a refit of the parameters that a result has estimated would make of them.
struct VehicleRefit {
  struct Change {
    std::string name, unit;
    double known = kNone, refitted = kNone;  ///< of the result, of the refit, in `unit`
    double se = kNone;                       ///< of their difference
    /// Least true difference, relative to the known value, that a test of this parameter alone at
    /// 5 % finds in 80 % of cases.
    double detectable = kNone;
  };
  std::vector<Change> changes;  ///< of the car's own parameters; empty: none was refitted
  double statistic = kNone, dof = 0.0, freedom = 0.0;  ///< F with these degrees of freedom
  double p = kNone;
  /// How far the simulated outputs move with the refit, rms over that of the refitted simulation
  /// about its mean; channels as in the run.
  std::vector<double> moves;
  bool tried = false;  ///< false: the result holds nothing that could be refitted
  bool converged = false;
};

/// Fits the estimated parameters and the initial states again, from the result's values, and weighs
/// the difference d by the errors V of both fits (those of residuals that are coloured allow for
/// it, identify/vehicle/covariance.h):
///
///   (f - k + 1) / (f k) d' V^-1 d ~ F(k, f - k + 1)
///
/// with f the lesser degrees of freedom of the two fits' errors, over the k directions that these
/// recordings determine. What belongs to a recording rather than a car (offsets, bank, delay,
/// mounting angle) is refitted and not judged; so is no parameter that has no error in the result.
/// The noise is taken as large as it is here.
/// @param model  estimated_model() of the result
/// Sources: Wald (1943); Hotelling (1931) for V that is itself an estimate.
VehicleRefit refit_vehicle(const Estimate& result, const Model& model,
                           const std::vector<Dataset>& recordings, bool robust);

}  // namespace identikal
