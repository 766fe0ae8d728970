// Which estimates would be others, were a likelier model the right one?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"

namespace identikal {

struct MovedEstimate {
  std::string name;
  double instead = 0.0;  ///< SI
  double errors = 0.0;   ///< standard errors between the two
};

/// Estimates that are no sizes of the noise, and lie more than two standard errors and a twentieth
/// of themselves apart.
/// @param from, to  fitted to the same rows; `to` is the likelier
/// @return the farthest first
std::vector<MovedEstimate> moved_estimates(const Model& from, const Model& to,
                                           const NoiseEstimate& estimate);

/// "b would be 1.98 in place of 2.46 1/s (17 standard errors away)".
std::string in_words(const MovedEstimate& moved, const NoiseEstimate& estimate);

}  // namespace identikal
