// What is the car known by? Understeer gradient, characteristic speed, yaw gain, ...
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/internal/structure_study.h"

namespace identikal {

/// The answer, and the one of the other kind: with the structure as written, or allowed for.
struct StructuredAnswer {
  VehicleParameters<double> p;
  const StructureStudy* study = nullptr;  ///< null: not made
  bool adopted = false;                   ///< p is the study's, else as written
  VehicleParameters<double> other = {};   ///< of the other kind, where there is a study
};

/// Appends characteristic values, which the data may determine even where single parameters are not,
/// to the derived ones: by delta method from the noise, and with the structure by what the study
/// makes of them.
void report_characteristic_values(const VehicleProblem& problem, const StructuredAnswer& answer,
                                  const VehicleCovariance& of_noise, VehicleEstimate& estimate);

}  // namespace identikal
