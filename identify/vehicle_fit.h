// Which cornering stiffnesses and other vehicle parameters does a recording determine?
#pragma once

#include <vector>

#include "identify/estimate.h"
#include "identify/model_file.h"
#include "lib/dataset.h"

namespace identikal {

struct VehicleFitOptions {
  int starts = 5;                ///< starts tried besides the equation-error one
  unsigned long long seed = 1;   ///< of the scattered starts
  bool (*progress)(int iteration, double objective) = nullptr;
};

/// Fits the free parameters of the single-track vehicle to a recording by output error:
/// minimise sum over outputs j and samples t of ((y_j(t) - yhat_j(t; theta)) / sigma_j)^2, with sigma_j re-estimated until it
/// settles (maximum likelihood for white sensor noise of unknown size). Start: continuous equation error. The
/// speed varies along the run; every stretch of usable rows has its own initial state.
/// @throws InputError when the recording cannot be used at all (too few rows, never above the minimum speed, no steering).
Estimate fit_vehicle(const ModelFile& model, const Dataset& data, const VehicleFitOptions& options = {});

}  // namespace identikal
