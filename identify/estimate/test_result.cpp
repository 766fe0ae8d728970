#include "identify/estimate/test_result.h"

#include <algorithm>
#include <utility>

#include "identify/estimate/distribution.h"

namespace identikal {

TestResult test_result(std::string id, std::string channel, double value,
                       std::array<double, 2> interval, double p, double level) {
  TestResult out = reported_figure(std::move(id), std::move(channel), value, p >= level);
  out.interval = interval;
  out.p = p;
  return out;
}

TestResult reported_figure(std::string id, std::string channel, double value, bool pass) {
  TestResult out;
  out.id = std::move(id);
  out.channel = std::move(channel);
  out.value = value;
  out.pass = pass;
  return out;
}

TestResult chi_square_test(std::string id, std::string channel, const ChiSquareStatistic& q,
                           double level) {
  std::array<double, 2> interval{kNone, kNone};
  if (q.dof > 0.0) interval = {0.0, chi_square_quantile(1.0 - level, q.dof)};
  return test_result(std::move(id), std::move(channel), q.value, interval,
                     chi_square_upper_tail(q.value, q.dof), level);
}

TestResult f_test(std::string id, std::string channel, const FStatistic& f, double level) {
  std::array<double, 2> interval{kNone, kNone};
  if (f.dof > 0.0) interval = {0.0, f_quantile(1.0 - level, f.dof, f.dof_rest)};
  return test_result(std::move(id), std::move(channel), f.value, interval,
                     f_upper_tail(f.value, f.dof, f.dof_rest), level);
}

TestResult nis_test(const ChiSquareStatistic& nis, double level) {
  const double upper = chi_square_upper_tail(nis.value, nis.dof);
  TestResult out = test_result("nis", "", nis.value / nis.dof,
                               {chi_square_quantile(0.5 * level, nis.dof) / nis.dof,
                                chi_square_quantile(1.0 - 0.5 * level, nis.dof) / nis.dof},
                               std::min(1.0, 2.0 * std::min(upper, 1.0 - upper)), level);
  out.pass = out.value >= out.interval[0] && out.value <= out.interval[1];
  return out;
}

TestResult ljung_box_test(const std::string& channel, const ChiSquareStatistic& q, double level) {
  return chi_square_test("ljung_box", channel, q, level);
}

TestResult input_test(const std::string& channel, const FStatistic& f, double level) {
  return f_test("input_correlation", channel, f, level);
}

}  // namespace identikal
