// Which noise may be zero where a search has ended, and where else may the likelihood have a maximum?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/scoring.h"

namespace identikal {

/// A place and what the likelihood is there.
struct LikelihoodPoint {
  Eigen::VectorXd x;
  double L = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
};
/// Nothing where the likelihood is not defined.
std::optional<LikelihoodPoint> point_at(const LikelihoodProblem& problem, const Eigen::VectorXd& x);

/// A variance that is zero, or that its own error does not tell from it.
bool may_be_zero(const LikelihoodProblem& problem, const LikelihoodPoint& at, Eigen::Index i);

/// For each variance that may be zero, and where there are several for all of them together, the place where it
/// is so large that samples tell it well and all else is as it was found: the likelihood may have a
/// maximum there too, which scattered starts meet by luck alone.
/// @param samples  of the recordings
std::vector<Eigen::VectorXd> variances_raised(const LikelihoodProblem& problem,
                                              const std::optional<LikelihoodPoint>& found,
                                              double samples, bool together);

/// A standard deviation s that ended at zero has no slope there, dL/ds = 2 s dL/ds^2, whether the
/// likelihood rises from there or not, and no search by slopes leaves it.
/// @param from  where the search began, which says of what size s may be
/// @return the end with such entries where they make it likelier; nothing where none does
std::optional<Eigen::VectorXd> off_zero(const LikelihoodProblem& problem,
                                        const Eigen::VectorXd& from, const Eigen::VectorXd& end);

}  // namespace identikal
