// Where does a profile likelihood reach the end of an interval?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/scoring.h"

namespace identikal {

/// A likelihood's problem, and the place in it that profiles go out from.
struct Profiled {
  LikelihoodProblem problem;
  Eigen::VectorXd x;
  double L = 0.0;
  Eigen::MatrixXd information;  ///< the expected one at x
  Eigen::MatrixXd excess;       ///< JudgedMaximum::excess, or empty
  Eigen::Index i = 0;           ///< the coordinate that is held
};

/// How all numbers go along when coordinate i moves by one and those of `free` stay where a parabola
/// of that information is largest: one for i itself, zero for the others.
Eigen::VectorXd along_with(Eigen::Index i, const std::vector<Eigen::Index>& free,
                           const Eigen::MatrixXd& information);

/// What the root of twice the drop may miss at the end of an interval.
constexpr double kNearEnd = 3e-4;

/// Where the profile of the coordinate has fallen to
///   L(x) - max over the others = target^2 / 2,
/// or the bound where it does not fall so far, by Newton's method on the coordinate and the others at
/// once: one evaluation a step, where searching at every value takes several. The observed
/// information is the one that the maximum is known to have, and what the gradients since say about
/// it. Others that are far from their maximum move alone. Nothing where that does not come to an end
/// soon.
/// Source: Venzon and Moolgavkar (1988), "A method for computing profile-likelihood-based confidence
/// intervals", Appl. Statist. 37.
///
/// Example:
///
///     const double se = 1.0 / std::sqrt(at.information(at.i, at.i));
///     const auto lower = end_at_once(at, -1.96 * se, 1.96, true);
///     const auto upper = end_at_once(at, 1.96 * se, 1.96, true, lower ? &*lower : nullptr);
///
/// @param first   from the coordinate's value to where the end is expected
/// @param linear  the root of the drop is near to linear in the coordinate; else the drop
/// @param opposite  the other end, of the same target, if known: with it the first step is of the
///   second order
std::optional<Eigen::VectorXd> end_at_once(const Profiled& at, double first, double target,
                                           bool linear, const Eigen::VectorXd* opposite = nullptr);

}  // namespace identikal
