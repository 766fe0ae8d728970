// Which published figures on noise estimation can be redrawn?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Figures of Matisko (2013): 4 and 5, the likelihood of Q and R from one sample and their
/// posterior from 2000; 6, how much the gain depends on them; 14 and 15, the variance of estimates
/// of Q and R against the Cramér-Rao bounds. A further figure is a function that makes a
/// StudyReport and a line here.
std::vector<Study> figure_studies();

}  // namespace identikal
