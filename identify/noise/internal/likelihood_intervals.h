// Where has the profile likelihood of each parameter fallen so far that a value is contradicted?
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/likelihood_errors.h"

namespace identikal {

/// A likelihood's slopes in the coordinates of the factors.
struct Slopes {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
};

/// At x, or nothing where the likelihood is not defined.
std::optional<Slopes> slopes_at(const LikelihoodProblem& problem, const Eigen::VectorXd& x);

/// What profiles are taken about.
struct ProfiledMaximum {
  RecordingsLikelihood& likelihood;
  const FactorCoordinates& factors;
  const ParameterSet& end;  ///< the parameters there
  const Solution& best;     ///< in the coordinates of the factors
  const JudgedMaximum& judged;
  std::optional<Slopes> slopes;  ///< there
  Eigen::Index samples = 0;      ///< measured values
  int threads = 1;
  double freedom = kNone;  ///< residual_freedom(), where errors go by it
};

/// The interval of every parameter that has a standard error becomes that of its profile
/// likelihood, 3.84 / 2 below the maximum, or n/2 log(1 + t^2 / (n - p)) with n - p degrees of freedom
/// (Bates & Watts 1988, section 6.1), where that can be had: not for entries of covariances of
/// lost rank or of Domain::positive_definite, and not where evaluations are dear and the standard error
/// is small beside the value. Both intervals are then the same but for a part of the order of
/// their ratio.
void take_profile_intervals(Estimate& estimate, const ProfiledMaximum& at);

/// A variance that ended at zero: how large could it be (one-sided 95 %)? False: nothing is known
/// there.
bool limit_variances_at_zero(Estimate& estimate, const ProfiledMaximum& at);

/// Positive numbers of which the recording says only that they are large, as a rate that is faster than
/// anything it shows: their interval begins where the profile likelihood says so (one-sided 95 %) and
/// has no end, and they have no standard error. @return a finding for each
Findings limit_from_below(Estimate& estimate, const ProfiledMaximum& at);

/// The profile likelihoods as curves: from the maximum outwards until they have fallen well below
/// the 95 % limit, or to the bound.
void picture_profiles(NoiseEstimate& estimate, const ProfiledMaximum& at);

}  // namespace identikal
