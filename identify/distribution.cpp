#include "identify/distribution.h"

#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>
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

double normal_quantile(double probability) {
  return boost::math::quantile(boost::math::normal_distribution<double>(), probability);
}

double student_t_quantile(double probability, double dof) {
  return boost::math::quantile(boost::math::students_t_distribution<double>(dof), probability);
}

}  // namespace identikal
