// What is a function that is known by its values at knots: between them, and how rough is it?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// A cubic spline through values at knots, straight outside of them; at the second and the last but
/// one knot the third derivative does not jump. z: what it runs over, in mean distances of knots
/// from the first one.
struct SplineCurve {
  std::string name;
  std::vector<int> values;    ///< positions of the parameters that are its values at the knots
  std::vector<double> knots;  ///< z, rising; the first is 0
  std::string axis;           ///< what it runs over, as it was written
  std::string axis_unit;      ///< of what it runs over; empty: none
  double origin = 0.0, distance = 1.0;  ///< axis = origin + distance z, in axis_unit
  bool smooth = false;  ///< as smooth as recordings ask for: its roughness counts against it
};

/// Coefficients of 1, z, z^2, z^3 and of max(0, z - z_k)^3 of the inner knots but the outermost two
/// between the first knot and the last, by the values at the knots; a row each.
Eigen::MatrixXd spline_coefficients(const std::vector<double>& knots);

/// Weights of the values at the knots in the curve at z; `slope`: in its slope there.
/// @return one each; their product with the values is the curve
///
/// Example:
///
///     const std::vector<double> knots{0, 1, 2, 3};
///     const Eigen::VectorXd weights = spline_weights(knots, 1.5);
///     std::printf("%g\n", weights.dot(Eigen::Vector4d(0, 1, 4, 9)));  // 2.25
///
/// @param knots  at least 3, rising
/// Source: de Boor (1978), "A practical guide to splines", chapter IV.
Eigen::VectorXd spline_weights(const std::vector<double>& knots, double z, bool slope = false);

/// R with f' R f = the integral of the squared second derivative between the knots; its null space
/// are the straight lines, rank knots - 2.
/// Source: Green and Silverman (1994), "Nonparametric regression and generalized linear models",
/// section 2.1.
Eigen::MatrixXd spline_roughness(const std::vector<double>& knots);

}  // namespace identikal
