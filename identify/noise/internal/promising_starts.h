// From where do searches over stable and invertible polynomials promise most?
#pragma once

#include <cstdint>
#include <vector>

#include "identify/noise/internal/common_scale.h"
#include "identify/noise/internal/root_coordinates.h"

namespace identikal {

struct PromisingStarts {
  std::vector<Eigen::VectorXd> z;
  int evaluations = 0;
};

/// Many polynomials scattered over all that are stable and invertible, and those at z with lines of
/// the spectrum in them, the noise of each as large as is likeliest; the best of them a few steps on;
/// of those the best that lie apart.
/// @param inside  the likelihood in the coordinates of the roots
/// @param z       where a search has ended
PromisingStarts promising_starts(const LikelihoodProblem& inside, const RootCoordinates& roots,
                                 const CommonScale& scale, const Eigen::VectorXd& z, int count,
                                 std::uint64_t seed);

}  // namespace identikal
