// Do two results say the same?
#pragma once

#include "identify/estimate/results.h"

namespace identikal {

/// Whether two results are equal in all that result.json holds of them, to the last digit: NaN
/// equals NaN, matrices of different shapes differ. Series and pictures do not count.
///
/// Example:
///
///     NoiseEstimate first, second;  // of two runs
///     const bool reproduced = same(sections_of(first), sections_of(second));
bool same(const ResultSections& a, const ResultSections& b);

}  // namespace identikal
