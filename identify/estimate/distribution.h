// Probabilities and quantiles of the distributions that tests and intervals use.
#pragma once

namespace identikal {

/// P(X > value) for a chi-square X. @param dof > 0; NaN for a NaN value.
///
/// Example:
///
///     const double p = chi_square_upper_tail(31.4, 20.0);  // 0.05
///     const double half_width = normal_quantile(0.975);    // 1.96
double chi_square_upper_tail(double value, double dof);
/// x with P(X <= x) = probability, 0 < probability < 1.
double chi_square_quantile(double probability, double dof);
/// P(X > value) for an F-distributed X. @param dof, dof_rest > 0; NaN for a NaN value.
double f_upper_tail(double value, double dof, double dof_rest);
double f_quantile(double probability, double dof, double dof_rest);
/// P(|X| > |value|) for a standard normal X; NaN for NaN.
double normal_two_sided(double value);
double normal_quantile(double probability);
double student_t_quantile(double probability, double dof);

}  // namespace identikal
