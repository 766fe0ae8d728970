// Is the linear tyre good enough for this recording?
#pragma once

#include "identify/vehicle/covariance.h"

namespace identikal {

/// A fit with axles that saturate, F = -tanh(s C alpha)/s, alongside the linear one.
struct TyreSaturation {
  double score_p =
      kNone;  ///< p-value of "both axles are linear", from the linear fit, white residuals
  bool refitted = false;  ///< the rest is filled: the score test found something
  VehicleParameters<double>
      saturating{};   ///< of the refit; inverse saturation = 1/(largest force)^2
  double gain = 0.0;  ///< in log-likelihood over the linear fit
  struct Axle {
    bool significant = false;  ///< inverse saturation > 0, one-sided, 0.5 % level
    double slip = kNone;       ///< 95 % quantile of |slip angle| [rad]
    double loss = kNone;       ///< share of the linear force that is missing at that slip angle
  };
  Axle front, rear;
  Eigen::VectorXd rms;  ///< per output of the refit, SI
};

/// Score test (Rao 1948) for the inverse saturation of both axles at the linear optimum; when it rejects at
/// 1 %, the saturating car is fitted. With the robust cost the scores are bounded, as in the fit.
/// The score test takes the residuals as white: it only decides whether the refit is worth its
/// time. What counts is the refit's inverse saturation over its standard error, which allows for coloured
/// residuals (under a wrong linear model those of the linear fit are so coloured that no robust
/// score test finds anything).
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     const VehicleUnknowns theta = vehicle_unknowns(car);
///     const auto problem = make_vehicle_problem(run, theta, demand_of(theta, theta.value));
///     const auto best = maximise_likelihood(problem, coordinates_of(problem, theta.value), {});
///     const auto tyres = test_tyre_saturation(problem, best, vehicle_covariance(problem, best));
TyreSaturation test_tyre_saturation(const VehicleProblem& linear, const VehicleOptimum& optimum,
                                    const VehicleCovariance& covariance);

}  // namespace identikal
