// What is unknown about the car: which parameters are free, from where, and within which bounds?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/model/constraints.h"
#include "lib/model/parameter.h"
#include "lib/vehicle/motion.h"

namespace identikal {

/// What is unknown about the car, in SI.
struct VehicleUnknowns {
  VehicleParameters<double> value;     ///< fixed values; of free ones the file's start
  std::vector<VehicleParameter> free;  ///< in the order of the model file
  std::vector<std::size_t> position;   ///< of each free one in the ParameterSet
  std::vector<bool> is_stated;         ///< whether that one is free in the model file
  std::vector<Prior> prior;            ///< of each free one, in the user's terms, SI
  Eigen::VectorXd lower, upper;        ///< bounds of the free ones
  Eigen::VectorXd scale;               ///< typical size of the free ones, for the optimiser
  TyreCurve curve = TyreCurve::linear;
  std::optional<double> front_drive;  ///< share of the front axle in the drive, where it is known
  Constraints constraints;            ///< between parameters of the model file
  Eigen::VectorXd stated;  ///< values of those, in the user's terms, SI; of free ones the starts

  /// Position of the parameter among the free ones, or -1.
  Eigen::Index find(VehicleParameter parameter) const;
};

/// Whether a parameter is positive by its nature: mass, lengths, inertia, stiffnesses, largest
/// forces, steering ratio, shape of the curve.
bool must_be_positive(VehicleParameter parameter);

/// The user speaks of an axle's largest force F where the mathematics has the inverse saturation
/// 1/F^2; all other parameters are the same for both. `slope` is d user / d SI.
struct UserValue {
  double value, slope;
};
UserValue in_user_terms(VehicleParameter parameter, double value);
double from_user_terms(VehicleParameter parameter, double value);

/// Whether this value of a free parameter is the least inverse saturation that its curve allows
/// (and not one that the user set): the axle is linear over the whole recording.
/// @param free  position among the free parameters
bool is_straight(const VehicleUnknowns& unknowns, std::size_t free, double value);

/// Adds a parameter to the free ones, with the bounds and the scale that a model file without any
/// gives it; it starts at value[parameter].
void set_free(VehicleUnknowns& unknowns, VehicleParameter parameter);

/// Reads the parameters of the model file; what it does not name is neutral (neutral_vehicle()).
///
/// Example:
///
///     VehicleUnknowns unknowns = vehicle_unknowns(car);
///     set_free(unknowns, kSteeringOffset);
///     const Eigen::Vector2d loads = axle_loads(unknowns.value);  // [N]
///
/// @throws InputError for a name that the vehicle does not have, a needed one that is missing, or a
/// mass, length, inertia, stiffness or steering ratio that is not positive
VehicleUnknowns vehicle_unknowns(const Model& model);

/// The unknowns with tyres of another curve, with largest forces free if it has any.
VehicleUnknowns with_curve(VehicleUnknowns unknowns, TyreCurve curve);

/// Axle loads at standstill [N], front and rear.
Eigen::Vector2d axle_loads(const VehicleParameters<double>& p);

/// What the integration needs for these parameters; a relaxation length that is free is taken at
/// its lower bound.
IntegrationDemand demand_of(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p);

}  // namespace identikal
