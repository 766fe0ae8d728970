// How much of the answer hangs on what a single track leaves out?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/finding.h"
#include "identify/vehicle/output_error.h"
#include "lib/vehicle/secondary_effects.h"

namespace identikal {

/// Something that the model takes as absent or as known, what cars and test equipment have of it,
/// and what it is with the recording in view. All numbers are in `unit`.
struct StructureCause {
  std::string name, unit;
  double as_written = 0.0;  ///< what the model takes
  double prior_mean = 0.0, prior_sd = 0.0;
  double value = 0.0, sd = 0.0;
  std::string separated_by;  ///< the measurement that would tell it from the others
  bool heavy_tails = false;  ///< of the prior: values far out are no surprise
};

/// What somebody may have got wrong, and how probable that is with the recording in view.
struct SuspectedMistake {
  std::string name, unit;
  double size = 0.0, sd = 0.0;  ///< as the recording says
  double gross = 0.0;           ///< a size from where on derivatives lead no further
  double evidence = 1.0;        ///< likelihood with it over that without
  double probability = 0.0;     ///< that somebody made it, beside that nobody made any
  bool may_be_a_car = false;    ///< a car of another kind looks like it
  FindingCode code = FindingCode::sensor_differs;  ///< that says so
  std::string separated_by;
};

struct StructureStudy {
  bool converged = false;
  Eigen::VectorXd value;       ///< of the free parameters, SI, every cause allowed for
  Eigen::MatrixXd covariance;  ///< of them, SI
  std::vector<StructureCause> causes;
  std::vector<SuspectedMistake> mistakes;
  Eigen::MatrixXd with_causes;       ///< free parameters x causes: correlation
  std::optional<double> wide_angle;  ///< of the road wheels [rad], where it is no small one
  Eigen::VectorXd errors;  ///< simulated minus measured there, SI, as the problem's residuals
};

/// Fits the vehicle once more with everything unknown at once that explains the same milliseconds
/// and degrees: delay, lag and noise of the steering, relaxation length, roll with camber and roll
/// steer, bending tyres, wheels that turn by large angles, filters, places and gains of the sensors,
/// offsets and the steering ratio.
/// Each has a prior that says what cars and test equipment have; what the model file frees or names
/// is left to it.
/// The maximum of
///   -1/2 sum_j 1/f_j sum_t (e_j(t)/sigma_j)^2 - 1/2 sum_c ((c - mean_c)/sd_c)^2
/// with f_j the integrated autocorrelation of the residuals, so that samples which tell the same
/// thing count once. Its curvature there is the precision of parameters and causes together, which
/// averages over the structures instead of choosing one. Then it weighs possible_mistakes(), of size
/// x, each as one more unknown: x^ +- s says the problem linear about there, with the noise that is
/// left with it, and beside that nobody made any the odds are
///   odds N(x^; mean, s^2 + sd^2) / N(x^; 0, s^2 + usual^2).
/// The covariance grows by what they would change, by the probability that the recording adds.
///
/// @param optimum  of output error, where it begins
StructureStudy study_structure(const VehicleProblem& problem, const VehicleOptimum& optimum);

}  // namespace identikal
