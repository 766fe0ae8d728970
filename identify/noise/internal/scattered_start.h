// Where else may a search begin?
#pragma once

#include "lib/base/random.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Numbers move anywhere between two finite bounds, by their logarithm where both are above zero;
/// else variances by up to two decades either way, others by up to 30 % of themselves. Free
/// parameters alone.
ParameterSet scattered_start(ParameterSet parameters, Random& random);

/// By a factor that is log-normal about 1, sd 1 of its logarithm, where a number moves by its
/// logarithm; else by up to 30 % of itself. Within the bounds; free scalars alone.
ParameterSet start_nearby(ParameterSet parameters, Random& random);

}  // namespace identikal
