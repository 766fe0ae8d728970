// Which combinations of a car's parameters does steady-state cornering determine (ISO 4138)?
#pragma once

#include <optional>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/vehicle/output_error.h"

namespace identikal {

/// Whether the car was in steady turns all the time, as the survey asks (lib/vehicle/yaw_change.h).
bool is_steady(const VehicleRun& run);

/// The products of the steering ratio i with wheelbase L and understeer gradient K, and the offset
/// of the steering sensor, by least squares on
///   angle + offset = i L r/v + i K v r
/// (v r for the lateral acceleration, as bank, roll and bias of an accelerometer would enter). One
/// equation for the means of every segment driven at one speed; a segment whose speed changes by
/// more than a tenth gives one for each of 20 parts. The error is taken as one of the angle, of one
/// size for all. Nothing more is identifiable: in a steady state neither Iz nor i, L and K
/// separately change an output.
struct SteadyTurning {
  Eigen::Vector3d value;       ///< i L [m], i K [rad/(m/s^2)], offset [rad]
  Eigen::Matrix3d covariance;  ///< NaN where there are no more equations than unknowns
  bool with_offset = true;     ///< false: turns to one side only leave the offset open; it is 0
  /// Where an offset that is not known stays open: by how much i L and i K change for 1 rad of it.
  Eigen::Vector2d by_offset = Eigen::Vector2d::Zero();
  Eigen::Index equations = 0;
  double sd = kNone;  ///< of the angle about the line [rad]
  double freedom = kNone;
};

/// @param offset  of the steering sensor [rad]; 0: unknown, estimated if the car turns to both sides
/// @param bias_r  of the yaw rate [rad/s]
/// @return nothing when the yaw rate is not measured, or speeds and angles differ too little
std::optional<SteadyTurning> steady_turning(const VehicleRun& run, double offset = 0.0,
                                            double bias_r = 0.0);

/// Fills the answer for a steady recording: the two products, no parameter.
void report_steady(const Model& model, const SteadyTurning& found, VehicleEstimate& estimate);

/// That no parameter is determined, and whether i L contradicts the model file.
Findings check_steady(const Model& model, const SteadyTurning& found);

}  // namespace identikal
