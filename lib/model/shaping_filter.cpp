#include "lib/model/shaping_filter.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"
#include "lib/model/partial_autocorrelation.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ShapingState shaping_state(const ShapingFilter& filter) {
  const Index n = filter.order();
  ShapingState out;
  out.A = MatrixXd::Zero(n, n);
  out.A.col(0) = -filter.a;
  for (Index i = 0; i + 1 < n; ++i) out.A(i, i + 1) = 1.0;
  out.g = -filter.a;
  out.g.head(filter.b.size()) += filter.b;
  out.c = Eigen::RowVectorXd::Unit(n, 0);
  return out;
}

VectorXd stable_polynomial(const VectorXd& zeta, MatrixXd* jacobian) {
  const VectorXd reflection = zeta.array().tanh();
  const VectorXd phi = polynomial_coefficients(-reflection, jacobian);
  if (jacobian != nullptr) *jacobian *= (1.0 - reflection.array().square()).matrix().asDiagonal();
  return -phi;
}

VectorXd stable_coordinates(const VectorXd& p) {
  const std::optional<VectorXd> partial = partial_autocorrelations(-p);
  if (!partial) return VectorXd::Constant(p.size(), kNaN);
  return (-partial->array()).atanh();
}

std::complex<double> response(const ShapingFilter& filter, double omega,
                              Eigen::VectorXcd* derivatives) {
  const Index n = filter.a.size(), m = filter.b.size();
  const std::complex<double> step = std::polar(1.0, -omega);
  std::complex<double> numerator = 1.0, denominator = 1.0, power = 1.0;
  for (Index i = 0; i < n; ++i) {
    power *= step;
    denominator += filter.a[i] * power;
    if (i < m) numerator += filter.b[i] * power;
  }
  const std::complex<double> H = numerator / denominator;
  if (derivatives != nullptr) {
    derivatives->resize(n + m);
    power = 1.0;
    for (Index i = 0; i < n; ++i) {
      power *= step;
      (*derivatives)[i] = -H * power / denominator;
      if (i < m) (*derivatives)[n + i] = power / denominator;
    }
  }
  return H;
}

std::vector<Mode> modes(const VectorXd& p) {
  std::vector<Mode> out;
  if (p.size() == 0) return out;
  const Eigen::VectorXcd poles = shaping_state({p, VectorXd(0)}).A.eigenvalues();
  for (const std::complex<double>& pole : poles) {
    if (pole.imag() < 0.0) continue;
    out.push_back({std::abs(std::arg(pole)), std::abs(pole)});
  }
  std::sort(out.begin(), out.end(),
            [](const Mode& x, const Mode& y) { return x.radius > y.radius; });
  return out;
}

}  // namespace identikal
