// What are the errors of a maximum of the likelihood?
#pragma once

#include <vector>

#include "identify/estimate/estimate.h"
#include "identify/estimate/none.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/internal/coloured_errors.h"
#include "identify/noise/internal/covariance_factors.h"
#include "identify/noise/internal/root_coordinates.h"

namespace identikal {

/// What profiles have to know of a maximum beside what is reported.
struct JudgedMaximum {
  /// Covariances that have lost rank: none of their entries has a profile.
  std::vector<CovarianceEntries> singular;
  /// Observed less expected information by the free entries, in units of the roots of the latter's
  /// diagonal; zero for what lies at a bound. Empty where it is not known, and where a covariance is
  /// estimated as a whole.
  Eigen::MatrixXd excess;
};

/// n - p, of n measured values and p unknowns but those that are sizes of the noise: the degrees of
/// freedom of errors where no noise moves the states and nothing else is known of its size. kNone
/// where that is not so, or where they are none.
/// Source: Seber & Wild (1989), Nonlinear Regression, section 2.1.
double residual_freedom(const Model& model, const std::vector<Dataset>& recordings,
                        Eigen::Index samples);

/// Errors of everything that was estimated, from the information at the maximum: of what lies on a
/// boundary none, of a covariance that has lost rank those along the directions in which it is
/// free (identify/noise/internal/free_directions.h).
/// @param best  where the search ended, in the coordinates of `problem`, which are the likelihood's
/// @param polynomials  there, with roots on the unit circle
/// @param score  of a simulation whose errors are coloured (coloured_errors.h): standard errors allow
///   for that. Null: those of white innovations
/// @param freedom  residual_freedom(): covariances are the inverse of the expected information, J'J / s^2,
///   times n / (n - p), and intervals are Student's; kNone: neither
JudgedMaximum judge_maximum(Estimate& estimate, RecordingsLikelihood& likelihood,
                            const LikelihoodProblem& problem, const ParameterSet& end,
                            const Eigen::VectorXd& best,
                            const std::vector<RootsOnCircle>& polynomials,
                            const SimulationScore* score = nullptr, double freedom = kNone);

}  // namespace identikal
