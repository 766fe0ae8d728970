#include "identify/estimate/distribution.h"

#include <algorithm>
#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace identikal {
namespace {

// In double throughout: long double costs twice the time for digits that nobody reads, and is not
// what it says under valgrind, where the tables of boost then end the program as it is loaded.
using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
using ChiSquare = boost::math::chi_squared_distribution<double, Policy>;
using FisherF = boost::math::fisher_f_distribution<double, Policy>;
using Normal = boost::math::normal_distribution<double, Policy>;
using StudentT = boost::math::students_t_distribution<double, Policy>;

}  // namespace

double chi_square_upper_tail(double value, double dof) {
  if (std::isnan(value) || !(dof > 0.0)) return std::nan("");
  if (value <= 0.0) return 1.0;
  if (std::isinf(value)) return 0.0;
  // There boost's series begins with a gamma function that overflows; less than 1e-128 is missing.
  if (dof > 100.0 && value < 1e-3 * dof) return 1.0;
  return boost::math::cdf(boost::math::complement(ChiSquare(dof), value));
}

double chi_square_quantile(double probability, double dof) {
  return boost::math::quantile(ChiSquare(dof), probability);
}

double f_upper_tail(double value, double dof, double dof_rest) {
  if (std::isnan(value) || !(dof > 0.0) || !(dof_rest > 0.0)) return std::nan("");
  if (std::isinf(value)) return value > 0.0 ? 0.0 : 1.0;
  return boost::math::cdf(boost::math::complement(FisherF(dof, dof_rest), std::max(0.0, value)));
}

double f_quantile(double probability, double dof, double dof_rest) {
  return boost::math::quantile(FisherF(dof, dof_rest), probability);
}

double normal_two_sided(double value) { return std::erfc(std::abs(value) / std::sqrt(2.0)); }

double normal_quantile(double probability) { return boost::math::quantile(Normal(), probability); }

double student_t_quantile(double probability, double dof) {
  return boost::math::quantile(StudentT(dof), probability);
}

}  // namespace identikal
