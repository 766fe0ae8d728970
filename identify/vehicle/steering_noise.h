// What does noise of the steering's sensor do to the values?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/vehicle/search.h"

namespace identikal {

/// Standard deviation of the white noise on a smooth signal: of its highest differences
///   d = (1 - q^-1)^p x,  sd = rms(d) / sqrt(binomial(2 p, p)),
/// which noise is as large in for every p and smooth motion hardly is; the median over blocks of
/// half a second or more, so that jumps here and there count little. 0 where that cannot be told:
/// the highest differences still shrink with p, as motion does that is fast for the sampling rate;
/// samples are held; or the readings come in steps that are larger than the noise (step_of()).
///
/// Example:
///
///     const Eigen::VectorXd angle = recordings[0].u.row(0);
///     const double sd = white_noise_sd({angle}, recordings[0].dt);
///
/// @param parts  evenly sampled, without gaps
/// @param step   between samples [s]
double white_noise_sd(const std::vector<Eigen::VectorXd>& parts, double step);

/// What that noise has done to the optimum.
struct SteeringNoise {
  double sd = 0.0;         ///< white, of a sample [rad]; 0: none is seen, or none that matters
  double of_motion = 0.0;  ///< over the standard deviation of the angle
  Eigen::VectorXd shift;   ///< of the free parameters, SI: with the noise less without
  bool corrected = false;  ///< the answer is without it
  bool any() const { return sd > 0.0; }
};

/// Noise of an input acts otherwise than noise of the outputs: the simulation answers to what the
/// car never did, and the search makes up for it by a car that answers less. With the errors
/// e(theta) = yhat(theta, u) - y and the angle u = u0 + n their expected sum of squares has that of
/// yhat(theta, u) - yhat(theta, u0) too much. The corrected estimate is where
///   J'e - E[dJ'de] = 0,  by steps of  -(J'J - E[dJ'dJ])^-1 (J'e - E[dJ'de]),
/// de and dJ the changes of errors and Jacobian by as much noise again, drawn four times (corrected
/// scores by Monte Carlo; Carroll, Ruppert, Stefanski & Crainiceanu 2006, chapter 7).
///
/// Where no noise is given it is that of white_noise_sd(), less what the outputs show of it: angles
/// above 3 Hz that a driver steered they show, and noise they do not. Where they tell it to a
/// quarter its size is theirs; where they do not, noise of a size that they may hide changes the
/// values by a few percent at most.
///
/// @param problem  of a simulation, at its optimum
/// @param given    sd of the noise [rad]; 0: to be found
SteeringNoise study_steering_noise(const VehicleProblem& problem, const VehicleOptimum& optimum,
                                   double given = 0.0);

/// steering_noise, with the size of the change: serious where that of Cf, Cr or Iz is above 5 %, or
/// above 2 % and the standard error that there would be without it; a note where the answer is
/// without it.
/// @param allowed  the answer is one that smooths the angle (--structure auto)
Findings check_steering_noise(const Model& model, const VehicleSearch& found,
                              const SteeringNoise& noise, bool allowed,
                              const VehicleEstimate& estimate);

}  // namespace identikal
