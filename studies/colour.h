// Which published experiments on coloured noise can be rerun?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Matisko (2013), chapter 5: table 11, prediction with and without a shaping filter; tables 12 and
/// 13, what a shaping filter at the wrong noise costs the state estimates; figure 12, predictions of
/// table 11; figure 13, the filters of tables 12 and 13 over frequency.
std::vector<Study> colour_studies();

}  // namespace identikal
