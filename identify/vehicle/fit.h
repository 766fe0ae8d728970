// Which cornering stiffnesses and other vehicle parameters does a recording determine?
#pragma once

#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model_file.h"
#include "identify/vehicle/search.h"
#include "lib/data/dataset.h"

namespace identikal {

struct VehicleFitOptions {
  VehicleSearchOptions search;
  /// output_error simulates; with process noise prediction_error goes on from there with a free
  /// filter gain (identify/vehicle/output_error.h), trajectory with the states of all rows as
  /// unknowns (identify/vehicle/internal/trajectory.h).
  enum class Method { output_error, prediction_error, trajectory } method = Method::output_error;
  /// What to make of lags, roll and bending tyres that the model does not have
  /// (identify/vehicle/internal/structure_study.h): as_written keeps the values and widens their
  /// errors, automatic takes the values with all of them allowed for, ignored does neither. Part of
  /// the second opinion.
  enum class Structure { as_written, automatic, ignored } structure = Structure::as_written;
  bool second_opinion = true;     ///< survey the recordings and try other forms of the model
  int bootstrap = 0;              ///< draws of the block bootstrap for the errors; 0: none
  std::vector<Dataset> hold_out;  ///< recordings, or the rest of them, to validate on
  bool pictures = false;          ///< fills RecordingFit::pictures
};

/// Fits the free parameters of the single-track vehicle to a recording by output error: minimise
/// the sum over outputs j and samples t of ((y_j(t) - yhat_j(t; theta)) / sigma_j)^2, with sigma_j
/// re-estimated until it settles (maximum likelihood for white sensor noise of unknown size). The
/// speed varies along the run; every segment of usable rows has a separate initial state, fitted
/// along. The search begins at several starts (identify/vehicle/starts.h), so that the values in
/// the model file do not decide the answer.
///
/// Standard errors come from the information matrix while the residuals are white, else from a
/// sandwich (identify/vehicle/covariance.h), with trajectory from the information with the path
/// eliminated; `covariance_kind` reports which. All numbers are in the user's units. Status:
/// rejected when the data do not determine a parameter, untrusted when a serious warning was raised
/// (flipped sign, poor fit, saturating tyres), not_converged, else ok.
///
/// `one_step` is filled by prediction_error only. Steady-state cornering (circles and slow ramps) is
/// answered with the products that it determines (identify/vehicle/internal/steady_cornering.h);
/// what lags, roll and bending tyres may add is part of the standard errors
/// (identify/vehicle/internal/structure_study.h), and fits with another structure are compared
/// (identify/vehicle/internal/structure_comparison.h).
///
/// Example:
///
///     VehicleFitOptions options;
///     options.search.robust = true;  // outliers count little
///     const auto fit = fit_vehicle(car, recordings, options);
///
/// @param model       of the form single_track
/// @param recordings  each with inputs steering angle and vx, outputs in the order of the model
/// @throws InputError for trajectory with a bootstrap or a relaxation length, for prediction_error
///   with robust noise, and when the recording or the model cannot be used at all: too few rows,
///   never above the minimum speed, no steering, only dead outputs, a missing or unknown parameter
VehicleEstimate fit_vehicle(const Model& model, const std::vector<Dataset>& recordings,
                            const VehicleFitOptions& options = {});
inline VehicleEstimate fit_vehicle(const Model& model, const Dataset& recording,
                                   const VehicleFitOptions& options = {}) {
  return fit_vehicle(model, std::vector<Dataset>{recording}, options);
}

}  // namespace identikal
