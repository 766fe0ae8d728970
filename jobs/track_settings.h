// What did the verb track run with? Enough to run the same sample by sample.
#pragma once

#include <optional>

#include "identify/model/model.h"
#include "identify/noise/noise_tracker.h"
#include "identify/regression/online_regression.h"

namespace identikal {

/// Of a linear model `noise`, of a regression `regression`.
struct TrackSettings {
  Model model;  ///< as the run began, --set and the recording's period included
  std::optional<NoiseTrackOptions> noise;
  std::optional<RegressionSettings> regression;
};

}  // namespace identikal
