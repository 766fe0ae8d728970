// How well is a figure of the car known, as its parameters are?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/handling.h"
#include "identify/handling/sheet.h"

namespace identikal {

/// Figures of the car of these parameters; NaN where one does not exist.
using FiguresOfCar = std::function<Eigen::VectorXd(const VehicleParameters<double>& p)>;

/// The figures with their standard errors, J V J' with central differences over a tenth of every
/// parameter's standard error, and 95 % intervals; where there is no error, with the reason.
///
/// Example:
///
///     const FiguresOfCar gradient = [](const auto& p) {
///       return Eigen::VectorXd::Constant(1, understeer_gradient(linear_car(p)));
///     };
///     const HandlingSheet::Value K = with_carried_errors(car, gradient)[0];
std::vector<HandlingSheet::Value> with_carried_errors(const KnownVehicle& car,
                                                      const FiguresOfCar& figures);

/// A figure of the log with its 95 % interval.
/// @param freedom  of the Student's t; kNone: normal
HandlingSheet::Value of_log(double value, double se, double freedom = kNone);

/// A figure that does not exist, and why.
HandlingSheet::Value blank(std::string why);

/// The same in another unit, `per_si` of which make one of SI.
HandlingSheet::Value in_units(HandlingSheet::Value value, double per_si);

}  // namespace identikal
