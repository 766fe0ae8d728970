// What does the study of the structure mean for values, errors and verdict?
#pragma once

#include "identify/estimate/results.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/internal/structure_study.h"

namespace identikal {

/// How much of the shift counts as an error: all of it as written, two thirds of it where the
/// study's values are taken, for its causes are not all there are.
double shift_share(bool adopted);

/// Adds to the covariance what the structure leaves open: the study's covariance, and the square of
/// the shift between the values of the model as it is written and the study's; where the method does
/// not simulate, that of the shift to what a simulation gives too.
/// @param value, simulated  of the free parameters, SI, by the method and by a simulation of the
///   model as it is written
void widen_by_structure(const StructureStudy& study, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& simulated, VehicleCovariance& covariance);

/// The covariance of the study's own values: the study's, and the square of its share of the shift, of
/// Cf, Cr and Iz up to a fifth of them.
/// @param value  of the model as it is written
void take_structure(const StructureStudy& study, const VehicleUnknowns& unknowns,
                    const Eigen::VectorXd& value, VehicleCovariance& covariance);

/// Fills EstimatedParameter::se_structure, notes what the recording shows of the causes, and where
/// the study's values are taken lists all of them among the derived values.
/// @param of_noise, of_all  the covariance before and after widen_by_structure() or
///   take_structure()
void report_structure(const StructureStudy& study, bool adopted, const VehicleUnknowns& unknowns,
                      const VehicleCovariance& of_noise, const VehicleCovariance& of_all,
                      VehicleEstimate& estimate);

/// structure_dependent, serious, where a stiffness or the yaw inertia is left open by more than a
/// quarter of it, or where a cause would have to lie more than 3.5 standard deviations from what cars
/// and test equipment have: it stands for something else then. What is a mistake, by its code.
Findings check_structure(const StructureStudy& study, const VehicleUnknowns& unknowns,
                         const VehicleEstimate& estimate);

/// Where there is no study, because the car with its secondary effects cannot be simulated: serious.
Findings check_structure_unknown(const VehicleUnknowns& unknowns, const VehicleEstimate& estimate);

}  // namespace identikal
