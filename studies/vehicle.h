// Does the published experiment on a car's lateral states reproduce, and what came out of its RLS?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Figures 9.1 to 9.9 of Sladká (2010), chapter 9: the states of a car in a severe lane change by
/// the source's recursive least squares and by a Kalman filter. The recording was not published;
/// here it is simulated, with a known truth. And "sladka-logarithm" (studies/logarithm.h).
std::vector<Study> vehicle_studies();

}  // namespace identikal
