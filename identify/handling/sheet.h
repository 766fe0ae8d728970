// Which figures do engineers know a vehicle's handling by, from its log and from its model?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/vehicle/single_track.h"

namespace identikal {

/// A car with what is known of its errors.
struct KnownVehicle {
  VehicleParameters<double> p;
  TyreCurve curve = TyreCurve::linear;
  std::vector<VehicleParameter> uncertain;  ///< those with a standard error
  Eigen::MatrixXd covariance;               ///< of them, SI
  double freedom = kNone;                   ///< of the Student's t that goes with it; kNone: normal
  std::vector<VehicleParameter> open;       ///< estimated, but without a standard error
  std::vector<std::string> at_bound;        ///< names of those that are taken as known there
  bool estimated = false;                   ///< false: a model file's values, without errors
  std::vector<DrivenRange> driven;          ///< what it was fitted to; may be empty
  std::vector<DerivedValue> derived;        ///< of the fit, with their errors
};

/// The car of a model file.
///
/// Example:
///
///     HandlingSheet sheet = handling_sheet(known_vehicle(car), car, recordings);
///     for (const auto& figure : sheet.sections[0].figures) std::puts(figure.name.c_str());
///
/// @throws InputError as vehicle_unknowns()
KnownVehicle known_vehicle(const Model& model);

/// The car of a result of fit, with the covariance that its standard errors and their correlation
/// make; what the structure leaves open is part of them.
/// @param model  estimated_model() of the result
KnownVehicle known_vehicle(const Model& model, const StoredEstimate& result);

struct HandlingOptions {
  /// Of the response to steering [m/s]; kNone: that of the segment of the log in which the steering
  /// moves most, without a log 80 km/h.
  double speed = kNone;
};

/// The sheet: ISO 4138, steady-state circular driving; ISO 7401, transient response to steering;
/// ISO 3888, double lane change.
///
///   log    K, compliances and the characteristic curve by regression over seconds of quasi-steady
///          turning (identify/handling/internal/steady_turns.h), the frequency response by the
///          local polynomial method (lib/statistics/transfer_function.h), figures of steps and lane
///          changes that are found in it, by parabolas through their samples
///   model  closed forms; where the log holds a step or a lane change, the same figures of its
///          simulation along the log
///
/// Errors of the model are carried over from the covariance by differences in every parameter
/// (delta method). What the log does not hold is left blank, with the reason.
///
/// Example:
///
///     const HandlingSheet sheet = handling_sheet(known_vehicle(car), car, recordings);
///     for (const auto& point : sheet.curve) std::printf("%g m/s^2\n", point.ay);
///
/// @param model       its mapping of the channels is used, its parameters are not
/// @param recordings  may be empty: then the log's side is blank
/// @throws InputError when a recording holds nothing usable
HandlingSheet handling_sheet(const KnownVehicle& car, const Model& model,
                             const std::vector<Dataset>& recordings,
                             const HandlingOptions& options = {});

/// What is wrong with the log before anything is made of it: signs, as check_signs() of
/// identify/vehicle/checks.h finds them, and what usable_run() has left out.
Findings check_log(const KnownVehicle& car, const Model& model,
                   const std::vector<Dataset>& recordings);

}  // namespace identikal
