// Are verdicts on noise right? Counted over recordings whose noise is known.
#pragma once

#include <cstdint>
#include <string>

#include "tests/campaigns/noise_problem.h"

namespace identikal {

/// A value is wrong that lies more than 2.6 of its standard errors and more than 5 % off.
struct NoiseVerdicts {
  int ok_right = 0, ok_wrong = 0, refused_right = 0, refused_wrong = 0;
  int intervals = 0, covered = 0;  ///< 95 % intervals of results with status ok
  /// Refused, and ok once the changes that the findings name were made.
  int cured_right = 0, cured_wrong = 0;

  int recordings() const { return ok_right + ok_wrong + refused_right + refused_wrong; }
};

/// Tunes the recordings of draw_noise_problem(seed + i, faults), i = 0 .. count - 1.
NoiseVerdicts judge_noise_problems(std::uint64_t seed, int count, int faults);

/// One line, with the shares that matter.
std::string in_words(const std::string& name, const NoiseVerdicts& verdicts);

}  // namespace identikal
