// Which cornering stiffnesses and other vehicle parameters does a recording determine?
#pragma once

#include <functional>

#include "identify/estimate.h"
#include "identify/model_file.h"
#include "lib/dataset.h"

namespace identikal {

struct VehicleFitOptions {
  int starts = 5;               ///< starts tried besides the equation-error one
  unsigned long long seed = 1;  ///< of the scattered starts
  std::function<bool(int iteration, double objective)> progress;  ///< return false to stop
};

/// Fits the free parameters of the single-track vehicle to a recording by output error: minimise
/// the sum over outputs j and samples t of ((y_j(t) - yhat_j(t; theta)) / sigma_j)^2, with sigma_j
/// re-estimated until it settles (maximum likelihood for white sensor noise of unknown size). The
/// speed varies along the run; every stretch of usable rows has an initial state of its own, fitted
/// along. The search begins at several starts (identify/vehicle_starts.h), so that the values in
/// the model file do not decide the answer.
///
/// Standard errors come from the information matrix while the residuals are white, else from a
/// sandwich (identify/vehicle_covariance.h); `covariance_kind` says which. All numbers are in the
/// user's units. Status: answer_no when the data leave a parameter open, untrusted when a serious
/// warning was raised (flipped sign, poor fit, saturating tyres), not_converged, else ok.
/// `one_step` stays empty: output error simulates.
/// @param model  of the form single_track; @param data  inputs steering angle and vx, outputs in
/// the
///   order of the model
/// @throws InputError, in words, when the recording or the model cannot be used at all: too few
/// rows,
///   never above the minimum speed, no steering, only dead outputs, a missing or unknown parameter
Estimate fit_vehicle(const ModelFile& model, const Dataset& data,
                     const VehicleFitOptions& options = {});

}  // namespace identikal
