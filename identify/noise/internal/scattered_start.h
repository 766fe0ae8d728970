// Where else may a search begin?
#pragma once

#include "lib/base/random.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Variances move by up to two decades either way; other numbers by up to 30 % of themselves, or
/// anywhere between two finite bounds. Free parameters alone.
ParameterSet scattered_start(ParameterSet parameters, Random& random);

}  // namespace identikal
