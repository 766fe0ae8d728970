#include "identify/estimate/distribution.h"

#include <algorithm>
#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace identikal {

double chi_square_upper_tail(double value, double dof) {
  if (std::isnan(value) || !(dof > 0.0)) return std::nan("");
  if (value <= 0.0) return 1.0;
  return boost::math::cdf(
      boost::math::complement(boost::math::chi_squared_distribution<double>(dof), value));
}

double chi_square_quantile(double probability, double dof) {
  return boost::math::quantile(boost::math::chi_squared_distribution<double>(dof), probability);
}

double f_upper_tail(double value, double dof, double dof_rest) {
  if (std::isnan(value) || !(dof > 0.0) || !(dof_rest > 0.0)) return std::nan("");
  return boost::math::cdf(boost::math::complement(
      boost::math::fisher_f_distribution<double>(dof, dof_rest), std::max(0.0, value)));
}

double f_quantile(double probability, double dof, double dof_rest) {
  return boost::math::quantile(boost::math::fisher_f_distribution<double>(dof, dof_rest),
                               probability);
}

double normal_two_sided(double value) { return std::erfc(std::abs(value) / std::sqrt(2.0)); }

double normal_quantile(double probability) {
  return boost::math::quantile(boost::math::normal_distribution<double>(), probability);
}

double student_t_quantile(double probability, double dof) {
  return boost::math::quantile(boost::math::students_t_distribution<double>(dof), probability);
}

}  // namespace identikal
