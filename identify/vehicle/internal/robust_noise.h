// What does an error cost when outliers are to be expected, and how large is the noise then?
#pragma once

#include <Eigen/Core>

namespace identikal {

inline constexpr double kStudentFreedom = 4.0;  ///< of robust noise

/// What a residual r of noise with scale 1 costs: rho(s), s = r^2, so that its density is
/// proportional to exp(-rho/2). Normal: rho = s. Robust: rho = (nu + 1) log(1 + s/nu), Student's t
/// with nu = 4 (Lange, Little & Taylor 1989): the larger a residual, the smaller its weight.
struct NoiseCost {
  double rho;     ///< of s
  double weight;  ///< d rho / d s
};
NoiseCost noise_cost(bool robust, double r);

/// Expected information of such a sample about its mean: 1, robust (nu + 1)/(nu + 3).
double noise_information(bool robust);

/// log of the integral of exp(-rho(r^2)/2) over r.
double log_norm_of_noise(bool robust);

/// The scale that makes these errors the most likely of robust noise: sd^2 = mean of weight(e/sd)
/// e^2.
double most_likely_scale(const Eigen::VectorXd& e);

/// What errors of one output weigh where their size is judged: 1; with the robust cost min(1, (3
/// s/e)^2), s = 1.483 median |e|: an outlier counts as 3 s, and normal noise keeps its size.
Eigen::VectorXd error_weights(bool robust, const Eigen::VectorXd& e);

}  // namespace identikal
