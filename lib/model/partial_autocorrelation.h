// Which numbers between -1 and 1 stand for a polynomial whose roots are all outside the unit circle?
#pragma once

#include <optional>

#include <Eigen/Core>

namespace identikal {

/// The coefficients phi of 1 - phi_1 z - ... - phi_p z^p whose partial autocorrelations are given:
///
///   phi(k, j) = phi(k-1, j) - pi_k phi(k-1, k-j),  phi(k, k) = pi_k,  phi_j = phi(p, j).
///
/// All roots lie outside the unit circle where |pi_k| < 1, and on it or outside where |pi_k| <= 1.
/// Sources: Barndorff-Nielsen and Schou (1973), J. Multivariate Analysis 3; Monahan (1984),
/// Biometrika 71.
/// @param jacobian  if not null: d phi / d pi, p x p
///
/// Example:
///
///     const Eigen::VectorXd phi = polynomial_coefficients(Eigen::Vector2d(0.9, -0.5));
///     const auto pi = partial_autocorrelations(phi);  // 0.9, -0.5
///
Eigen::VectorXd polynomial_coefficients(const Eigen::Ref<const Eigen::VectorXd>& partial,
                                        Eigen::MatrixXd* jacobian = nullptr);

/// The reverse; nothing where a root lies on the unit circle or inside.
std::optional<Eigen::VectorXd> partial_autocorrelations(
    const Eigen::Ref<const Eigen::VectorXd>& coefficients);

}  // namespace identikal
