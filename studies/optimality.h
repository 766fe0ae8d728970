// Do the published error rates of optimality tests reproduce, and what do calibrated tests reach?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Tables 1 and 2 of Matisko (2013), chapter 3: % of right decisions about filters with the true
/// noise and with wrong noise, as published, by the published tests as we implement them from their
/// description, and by ours, which hold their 5 %.
/// The system of table 2 is printed as a picture that the text of the source does not hold: a
/// system of the same order, number of inputs and outputs, noise and tunings stands in for it.
/// Figures 1 and 2: after how many samples the sequential test decides, the published one and ours.
std::vector<Study> optimality_studies();

}  // namespace identikal
