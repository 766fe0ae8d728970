// What would an experienced engineer say about this vehicle fit? Every check_*() returns what it
// finds and changes nothing.
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/tyre_saturation.h"

namespace identikal {

/// A number of an output in the user's unit: a difference, so that no offset is applied.
double in_unit(const VehicleRun::Output& output, double si);

/// vx delta must go with r, and vx r with ay (ISO 8855): a negative correlation is a flipped axis.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const Findings wrong = check_signs(run, vehicle_unknowns(car).value);
///     for (const Finding& finding : wrong) std::puts(finding.text.c_str());
Findings check_signs(const VehicleRun& run, const VehicleParameters<double>& p);

/// Iz/(m a b) outside 0.8 to 1.3 and axle stiffness per load outside 5 to 25 per rad, for
/// determined values.
Findings check_plausibility(const VehicleParameters<double>& p, const VehicleEstimate& estimate);

/// The change of the positive parameters, relative to their size, that the recording determines
/// least, when its standard error is above a quarter: where a user has to look for more knowledge.
/// Serious, and about them alone, where Cf, Cr or Iz is above zero and not known to a quarter.
///   @param estimate  with its standard errors and intervals
Findings check_weakest_direction(const VehicleProblem& problem, const VehicleCovariance& covariance,
                                 const VehicleParameters<double>& p,
                                 const VehicleEstimate& estimate);

/// A simulation of the leading output that explains less is poor [%].
inline constexpr double kPoorFit = 50.0;

/// A simulation that explains less than half, and noise far from what the model file gave.
/// @param rms  per output, SI
Findings check_fit(const VehicleProblem& problem, const Eigen::VectorXd& rms,
                   const VehicleEstimate& estimate);

/// What the survey (identify/survey/survey.h) finds wrong with the recordings as the model file
/// maps them: units, swapped or stuck channels, clocks, outliers, reversing. What the fit leaves
/// out by itself, or reports itself, is not repeated.
Findings check_by_survey(const Model& model, const std::vector<Dataset>& recordings,
                         const VehicleEstimate& estimate);

/// The same for held-out recordings, signs too, with the file named: the fit does not depend on
/// them, so that it is a warning at most. What the fitted recordings have too is not repeated.
Findings check_hold_out_by_survey(const Model& model, const std::vector<Dataset>& hold_out,
                                  const Findings& of_the_fit);

/// Held-out data that the car predicts much worse than what it was fitted to.
Findings check_hold_out(const VehicleEstimate& estimate);

/// A steering gain that was fitted and is not 1: the model file's ratio is then wrong.
Findings check_steering_gain(const VehicleProblem& problem, const VehicleCovariance& covariance,
                             const VehicleParameters<double>& p, bool at_road_wheel);

/// Says when the standard errors had to be widened.
Findings check_whiteness(const VehicleCovariance& covariance);

/// Says whether, and by how much, the tyres leave the linear range.
Findings check_tyres(const VehicleProblem& problem, const TyreSaturation& saturation,
                     const VehicleEstimate& estimate);

/// Notes: how the rows spread over lateral acceleration, and the residuals of each output there.
void note_errors_by_acceleration(const VehicleProblem& problem, const VehicleOptimum& optimum,
                                 VehicleEstimate& estimate);

}  // namespace identikal
