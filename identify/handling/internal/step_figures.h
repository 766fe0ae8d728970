// How does a car answer to a step of steering (ISO 7401)?
#pragma once

#include <vector>

#include "identify/estimate/handling.h"
#include "identify/handling/internal/drive_signals.h"

namespace identikal {

/// Steering that was held for three quarters of a second, went to another angle within half a
/// second, and was held there for a second and a half; within a tenth of the step.
struct SteeringStep {
  Eigen::Index first, rows;       ///< from the angle before to the end of the hold
  double before_from, before_to;  ///< [s]: the angle before
  double middle;                  ///< half of the step is done [s]
  double middle_se;               ///< [s]
  double hold_to;                 ///< [s]: how long the angle is held
  double vx;                      ///< mean while it is held [m/s]
};

/// Steps after which vx r changes by 1 m/s^2 or more; of different speeds those within a tenth of
/// the median.
std::vector<SteeringStep> steps_in(const DriveSignals& signals);

/// Means over the steps. A standard error is carried over from the samples' noise; of several steps
/// it is that of their scatter where this is larger.
struct StepFigures {
  HandlingSheet::Value ay;  ///< change of vx r from before to the end of the hold [m/s^2]
  HandlingSheet::Value response_of_r;   ///< from half of the step to 90 % of the steady value [s]
  HandlingSheet::Value response_of_ay;  ///< the same [s]
  HandlingSheet::Value peak_of_r;       ///< from half of the step to the peak [s]
  HandlingSheet::Value overshoot;       ///< of the peak over the steady value, relative to it
  HandlingSheet::Value tb;              ///< peak_of_r times the change of sideslip [s rad]
};
StepFigures step_figures(const DriveSignals& signals, const std::vector<SteeringStep>& steps);

}  // namespace identikal
