// What did the car do, measured and simulated?
#pragma once

#include "identify/estimate/recording_fit.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// Measured and simulated outputs in the user's units, on all rows of the run; NaN where a row was
/// not used. `standardised` stays empty.
Series vehicle_series(const VehicleProblem& problem, const Eigen::VectorXd& z);

/// Fit percent and rmse of each channel of a series.
/// @param robust  samples weigh as error_weights() has it: outliers count little
std::vector<ChannelFit> channel_fits(const Series& series, bool robust);

/// A known car along recordings.
struct KnownCar {
  Series series;  ///< measured and simulated, to be compared by channel_fits()
  std::vector<DrivenRange> driven;
};

/// How well the car of these parameters predicts other recordings: it is simulated along them, with
/// only the state at the begin of every segment fitted.
///
/// Example:
///
///     const VehicleUnknowns unknowns = vehicle_unknowns(car);
///     const auto along = validate_vehicle(car, recordings, unknowns, unknowns.value, false);
///     const auto fits = channel_fits(along.series, false);
///
/// @param model     its mapping of the channels is used, its parameters are not
/// @param unknowns  of the fit; its curve and the parameters `p` make the car
/// @param robust    noise with outliers, as in the fit
/// @throws InputError when a recording holds no usable segment
KnownCar validate_vehicle(const Model& model, const std::vector<Dataset>& recordings,
                          const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                          bool robust);

}  // namespace identikal
