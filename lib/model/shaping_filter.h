// What linear filter makes coloured noise out of white?
#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// v(t) = H(z) w(t), H(z) = (1 + b_1 z^-1 + ... + b_m z^-m) / (1 + a_1 z^-1 + ... + a_n z^-n), m <=
/// n. Every rational spectrum has such a factor, with poles and zeros inside the unit circle; what
/// is left is the variance of w. Matisko (2013), (5.20), is n = 2, m = 1.
///
/// Example:
///
///     ShapingFilter road{.a = Eigen::Vector2d{-1.6, 0.8}, .b = Eigen::VectorXd::Zero(1)};
///     const double gain = std::abs(response(road, 0.4));       // at 0.4 rad per sample
///     const double resonance = modes(road.a).front().frequency;  // [rad] per sample
struct ShapingFilter {
  Eigen::VectorXd a, b;
  Eigen::Index order() const { return a.size(); }
};

/// f(t+1) = A f + g w, v = c f + w: the observer form, linear in the coefficients, with
/// A = [-a, shift], g = b - a, c = [1 0 ... 0].
struct ShapingState {
  Eigen::MatrixXd A;     ///< n x n
  Eigen::VectorXd g;     ///< n
  Eigen::RowVectorXd c;  ///< n
};
ShapingState shaping_state(const ShapingFilter& filter);

/// The polynomial 1 + p_1 z^-1 + ... whose reflection coefficients are tanh(zeta): every zeta is a
/// polynomial with all zeros inside the unit circle, and every such polynomial has its zeta
/// (Barndorff-Nielsen & Schou 1973). @param jacobian  when not null, receives dp / dzeta
Eigen::VectorXd stable_polynomial(const Eigen::VectorXd& zeta, Eigen::MatrixXd* jacobian = nullptr);

/// The inverse. @return nothing defined (NaN) unless all zeros are inside the unit circle
Eigen::VectorXd stable_coordinates(const Eigen::VectorXd& p);

/// H at z = exp(i omega), omega in rad per sample. @param derivatives  when not null, receives
/// dH / d(a_1 .. a_n, b_1 .. b_m)
std::complex<double> response(const ShapingFilter& filter, double omega,
                              Eigen::VectorXcd* derivatives = nullptr);

/// A pole or zero, or a conjugate pair of them.
struct Mode {
  double frequency = 0.0;  ///< rad per sample, 0 to pi
  double radius = 0.0;
};
/// Poles of 1 / (1 + p_1 z^-1 + ...), one of each pair, the slowest to fade first.
std::vector<Mode> modes(const Eigen::VectorXd& p);

}  // namespace identikal
