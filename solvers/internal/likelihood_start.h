// Does a start belong to the problem that is to be solved from it?
#pragma once

#include <stdexcept>
#include <string>

#include "solvers/scoring.h"

namespace identikal {

/// @param solver  by which the message begins
/// @throws std::invalid_argument when shapes disagree or the start lies outside the box
inline void check_start(const LikelihoodProblem& problem, const Eigen::VectorXd& start,
                        const std::string& solver) {
  if (problem.lower.size() != start.size() || problem.upper.size() != start.size()) {
    throw std::invalid_argument(solver + ": start and bounds differ in size");
  }
  if ((start.array() < problem.lower.array()).any() ||
      (start.array() > problem.upper.array()).any()) {
    throw std::invalid_argument(solver + ": the start lies outside the bounds");
  }
}

}  // namespace identikal
