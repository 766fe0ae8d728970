// Where else may a search begin?
#pragma once

#include "lib/base/random.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Numbers move anywhere between two finite bounds, by their logarithm where both are above zero;
/// else variances by up to two decades either way, others by up to 30 % of themselves. Free
/// parameters alone.
ParameterSet scattered_start(ParameterSet parameters, Random& random);

}  // namespace identikal
