// What are mean and covariance of a function of a Gaussian variable, told from its values at a few
// points? Internal to lib: lib/nonlinear/filter.h is what others use.
#pragma once

#include <Eigen/Core>

#include "lib/internal/direction_stack.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

/// UnscentedWeights for n states: how far out the points lie, in columns of L, and what they count
/// in a covariance; an outer one counts as much in a mean.
struct PointWeights {
  double reach, outer, middle;
};
PointWeights point_weights(const UnscentedWeights& weights, Eigen::Index n);

/// L of P = L L' and its derivatives. A variance of zero has a column of zeros, one that the others
/// determine a column as small as rounding.
/// @param dP, dL  k directions; none: both stay as they are
/// @return indefinite: P is, by more than rounding, or a derivative is by a variance of zero, as
///   points that coincide do not determine how they would part
FilterStatus set_covariance_factor(const Eigen::MatrixXd& P, const Stack& dP, Eigen::MatrixXd& L,
                                   Stack& dL);

/// A function's values g at the points x, x + c L_1, .., x + c L_n, x - c L_1, .. and what follows:
/// its covariance is A A' + rest, and that with x is L A', where A has the columns
/// (g(x + c L_j) - g(x - c L_j)) / (2 c) and rest is what a linear function does not have. In that
/// form nothing cancels, and the covariance after a measurement is a sum of squares.
struct SigmaPoints {
  Eigen::MatrixXd values;  ///< rows x (2 n + 1), written by the user, as are their derivatives
  Stack dvalues;
  Eigen::VectorXd mean;
  Eigen::MatrixXd A, rest;
  Stack dmean, dA, drest;
  Eigen::MatrixXd deviation;  ///< of the means of opposite points, last of the middle one
  Stack ddeviation;
};
/// For functions of n states with `rows` values, and k directions.
SigmaPoints make_sigma_points(Eigen::Index rows, Eigen::Index n, Eigen::Index k);

/// Point q, 0-based: point = x + way L_j, and its derivatives when there are directions.
void set_point(Eigen::Index q, const PointWeights& weights, const Eigen::VectorXd& x,
               const Stack& dx, const Eigen::MatrixXd& L, const Stack& dL, Eigen::VectorXd& point,
               Stack& dpoint);

/// Mean, A and rest from the values.
void set_moments(SigmaPoints& points, const PointWeights& weights);

}  // namespace identikal
