// Which noise covariances explain the autocovariances of a filter's innovations? Autocovariance
// least squares: linear in the unknowns, no search, no start but the filter's gain.
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

struct NoiseAlsOptions {
  /// By the inverse of the covariance that the estimate itself gives the sample autocovariances,
  /// iterated; false: all alike, as published.
  bool weighted = true;
  Eigen::Index lags = 0;  ///< autocovariances used, from lag 0 on; 0 = until the filter forgets
  bool iterate = false;   ///< filter again with the estimate's own gain, until that settles
  /// Not weighted: fit the whole matrix of autocovariances, Y_(i-j) in block (i, j), and not one
  /// column of it (Odelson et al. 2006).
  bool full_matrix = false;
  /// Q of the smallest rank that the fit allows (identify/noise/internal/minimum_rank.h).
  bool min_rank = false;
};

/// Least squares of the innovations' sample autocovariances (lib/statistics/autocovariance.h) of
/// all recordings on the free entries of Q, R and S,
///
///   minimise || W^(1/2) (sum_e theta_e Y(dQ_e, dR_e, dS_e) - sample Y) ||^2,
///   [Q S; S' R] positive semidefinite, min <= theta_e <= max where a parameter has them,
///
/// under the gain of the model's own values. The constraints are part of the problem, which stays
/// convex: a variance that ends at zero, or at another bound, is reported as such. Q is the one
/// that the model writes: in continuous time a density. Standard errors from the covariance of the sample
/// autocovariances at the estimate; alongside the Cramér-Rao bound from outputs alone. Only noise
/// can be free. Sources: Odelson, Rajamani & Rawlings (2006), Automatica 42; Rajamani & Rawlings
/// (2009), Automatica 45 (single column); Akesson et al. (2008) for S; Matisko (2013), section 4.3.
///
/// Example:
///
///     const auto estimate = tune_als(model, recordings, {.lags = 20});
///
/// @throws InputError as check_recordings(), when anything but noise is free or a prior is stated, when the model's
/// values give no stable filter, when the recordings are shorter than its memory, and when there
/// are more than 6000 autocovariances to weigh
NoiseEstimate tune_als(const Model& model, const std::vector<Dataset>& recordings,
                       const NoiseAlsOptions& options = {});

/// The least squares of tune_als() alone, unweighted, as the method was first published (Odelson
/// et al. 2006, before its section on constraints): theta, SI, in the order of the free entries.
/// Variances may come out negative, and then there is no filter of them. For comparisons with
/// published numbers; tune_als() is what to estimate with.
///
///     const Eigen::VectorXd theta = unconstrained_als(model, recordings, 20);
///
/// @throws as tune_als()
Eigen::VectorXd unconstrained_als(const Model& model, const std::vector<Dataset>& recordings,
                                  Eigen::Index lags);

}  // namespace identikal
