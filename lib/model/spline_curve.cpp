#include "lib/model/spline_curve.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// 1, z, z^2, z^3, and max(0, z - z_k)^3 of the inner knots but the outermost two: as many as there
// are knots, so that every cubic is among the curves ("not a knot"). Or their derivatives.
VectorXd basis(const std::vector<double>& knots, double z, int derivative) {
  const std::size_t n = knots.size();
  VectorXd out(static_cast<Index>(n));
  for (std::size_t k = 0; k < n; ++k) {
    const int power = k < 4 ? static_cast<int>(k) : 3;
    const double from = k < 4 ? z : std::max(0.0, z - knots[k - 2]);
    double factor = 1.0;
    for (int d = 0; d < derivative; ++d) factor *= power - d;
    out[static_cast<Index>(k)] = factor == 0.0 ? 0.0 : factor * std::pow(from, power - derivative);
  }
  return out;
}

}  // namespace

MatrixXd spline_coefficients(const std::vector<double>& knots) {
  const auto n = static_cast<Index>(knots.size());
  MatrixXd at_knots(n, n);
  for (Index i = 0; i < n; ++i)
    at_knots.row(i) = basis(knots, knots[static_cast<std::size_t>(i)], 0).transpose();
  return at_knots.fullPivLu().inverse();
}

VectorXd spline_weights(const std::vector<double>& knots, double z, bool slope) {
  const MatrixXd M = spline_coefficients(knots);
  const double inside = std::clamp(z, knots.front(), knots.back());
  const VectorXd of_slope = M.transpose() * basis(knots, inside, 1);
  if (slope) return of_slope;
  return M.transpose() * basis(knots, inside, 0) + (z - inside) * of_slope;
}

MatrixXd spline_roughness(const std::vector<double>& knots) {
  const MatrixXd M = spline_coefficients(knots);
  const auto n = static_cast<Index>(knots.size());
  MatrixXd second(n,
                  n);  // rows: second derivative at the knots by the values, straight between them
  for (Index i = 0; i < n; ++i)
    second.row(i) =
        (M.transpose() * basis(knots, knots[static_cast<std::size_t>(i)], 2)).transpose();
  MatrixXd out = MatrixXd::Zero(n, n);
  for (Index i = 0; i + 1 < n; ++i) {
    const double third =
        (knots[static_cast<std::size_t>(i) + 1] - knots[static_cast<std::size_t>(i)]) / 3.0;
    const auto a = second.row(i), b = second.row(i + 1);
    out += third *
           (a.transpose() * a + b.transpose() * b + 0.5 * (a.transpose() * b + b.transpose() * a));
  }
  return 0.5 * (out + out.transpose());
}

}  // namespace identikal
