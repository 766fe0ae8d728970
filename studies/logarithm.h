// What do discrete least squares and a matrix logarithm make of cornering stiffnesses?
#pragma once

#include "studies/study.h"

namespace identikal {

/// "sladka-logarithm": least squares on x(t+1) = Phi x(t) + Gamma u(t), x = (vy, r), and A = log
/// Phi / step, as who would go on from (9.1) of Sladká (2010) to the car might do, beside
/// continuous equation error and output error. The recording is simulated
/// (studies/sladka_lane_change.h).
StudyReport logarithm_study(const StudyOptions& options);

}  // namespace identikal
