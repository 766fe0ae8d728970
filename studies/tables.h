// Which published tables of noise estimates can be rerun?
#pragma once

#include <vector>

#include "studies/study.h"

namespace identikal {

/// Tables 3 to 10 of Matisko (2013), chapter 4, on recordings of our own: for every line mean and
/// standard deviation of the estimates as published, by the published method as we implement it
/// from its description, by maximum likelihood, and the Cramér-Rao bound from outputs alone, which
/// the standard deviation of an unbiased method cannot go below.
std::vector<Study> table_studies();

}  // namespace identikal
