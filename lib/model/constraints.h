// What has to hold between parameters, and how does a search for a maximum keep to it?
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/formula/expression.h"
#include "lib/formula/tape.h"

namespace identikal {

/// g_i(p) = 0 of equalities, g_i(p) <= 0 of all others; p are the parameters by their positions.
struct Constraints {
  Tape functions;  ///< g and its Jacobian by all parameters
  std::vector<bool> equality;
  std::vector<std::string> text;  ///< as they were written

  bool empty() const { return equality.empty(); }
  Eigen::Index equalities() const;  ///< by how many there are fewer unknowns
  Eigen::Index size() const { return static_cast<Eigen::Index>(equality.size()); }
};

/// Of formulas that are to be 0, or not above it.
/// @param g           a formula whose symbols are the positions of parameters
/// @param parameters  how many there are
///
/// Example:
///
///     Constraints sum;  // p1 + p2 = 2.6
///     const std::vector<std::string> names{"p1", "p2"};
///     std::vector<Expression> g{parse_expression("p1 + p2 - 2.6", names)};
///     sum = make_constraints(g, {true}, {"p1 + p2 = 2.6"}, 2);
///     const ConstraintValues at = constraint_values(sum, Eigen::Vector2d(1.2, 1.3));  // g: -0.1
Constraints make_constraints(std::span<const Expression> g, std::vector<bool> equality,
                             std::vector<std::string> text, int parameters);

struct ConstraintValues {
  Eigen::VectorXd g;
  Eigen::MatrixXd slopes;  ///< a row each: by the parameters
};
ConstraintValues constraint_values(const Constraints& constraints, const Eigen::VectorXd& p);

/// The method of multipliers: from a function L the search for its maximum takes
///
///   1/2 sum_i (r_i^2 - l_i^2/w_i),   r_i = (l_i + w_i g_i) / sqrt(w_i),
///
/// of inequalities with r_i = 0 where it would be negative, and between searches l_i = sqrt(w_i) r_i.
/// Where that settles the maximum of L under the constraints is found, and l are their Lagrange
/// multipliers: by how much L would rise if g_i were allowed one more. An added term is a squared
/// residual, so that least squares and scoring remain what they are.
/// Source: Hestenes (1969), Powell (1969); inequalities: Rockafellar (1973), "The multiplier method of
/// Hestenes and Powell applied to convex programming".
struct Multipliers {
  Eigen::VectorXd l, w;
  /// Variance of each g by the information that the constraints were weighed by; NaN where L alone
  /// does not determine it. l^2 times it tests the constraint: chi square of one degree of freedom
  /// where it is true (Aitchison & Silvey 1958).
  Eigen::VectorXd variance;

  /// Weights by which each constraint counts so much more than what L says along it that nothing
  /// else decides there.
  /// @param slopes       of g by the coordinates of a search
  /// @param information  of L by the same; a coordinate without any does not count
  void weigh(const Eigen::MatrixXd& slopes, const Eigen::MatrixXd& information);
};

/// Residuals of a search, and their slopes by the parameters (or what `values` has them by).
struct ConstraintResiduals {
  Eigen::VectorXd r;
  Eigen::MatrixXd slopes;
  double constant = 0.0;  ///< 1/2 sum l^2/w
};
ConstraintResiduals constraint_residuals(const Constraints& constraints,
                                         const Multipliers& multipliers,
                                         const ConstraintValues& values);

/// After a search: sets the multipliers for the next one.
/// @param scale  per constraint: what g may still be off, above 0
/// @return is there need of one? Not where all hold to `scale`.
bool update_multipliers(const Constraints& constraints, const Eigen::VectorXd& g,
                        const Eigen::VectorXd& scale, Multipliers& multipliers);

/// Per constraint: a ten-millionth of what the standard errors of coordinates move g by, and not below
/// its rounding.
/// @param values       with slopes by the parameters p
/// @param slopes       per constraint, by the k coordinates that are searched in
/// @param information  k x k, of these
/// @throws std::invalid_argument when shapes disagree
Eigen::VectorXd constraint_tolerances(const ConstraintValues& values, const Eigen::VectorXd& p,
                                      const Eigen::MatrixXd& slopes,
                                      const Eigen::MatrixXd& information);

}  // namespace identikal
