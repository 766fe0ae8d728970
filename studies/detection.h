// Does coloured noise show in autocorrelation and spectrum as published?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Figures 7 to 11 of Matisko (2013), sections 5.3 to 5.5: (5.17) with white noise and with noise
/// through (5.21), 8200 samples. 7 and 8: the outputs' autocorrelation alongside the nearest one of
/// the system's own modes; 9 and 10: their spectrum alongside the base functions; 11: the same with
/// those of the filter.
std::vector<Study> detection_studies();

}  // namespace identikal
