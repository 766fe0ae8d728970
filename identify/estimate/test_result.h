// How does a statistic become a test that a result reports?
#pragma once

#include <array>
#include <string>

#include "identify/estimate/recording_fit.h"
#include "lib/statistics/whiteness.h"

namespace identikal {

/// A test that passes where p is at least `level`; it takes no part in a verdict.
/// @param interval  where it passes
TestResult test_result(std::string id, std::string channel, double value,
                       std::array<double, 2> interval, double p, double level);

/// A figure that stands among the tests: of no distribution, and `pass` is the caller's to say.
TestResult reported_figure(std::string id, std::string channel, double value, bool pass);

/// Of a statistic with a distribution, which fails where it is large; `dof` > 0, or no interval.
///
/// Example:
///
///     const TestResult white = chi_square_test("ljung_box", "r", {.value = 31, .dof = 20}, 0.05);
///     std::printf("p = %g, %s\n", white.p, white.pass ? "white" : "coloured");
TestResult chi_square_test(std::string id, std::string channel, const ChiSquareStatistic& q,
                           double level);
TestResult f_test(std::string id, std::string channel, const FStatistic& f, double level);

/// Mean normalised innovation squared, two-sided: chi-square with `nis.dof` > 0 degrees of freedom
/// over them.
TestResult nis_test(const ChiSquareStatistic& nis, double level);

/// ljung_box() of one channel (lib/statistics/whiteness.h).
TestResult ljung_box_test(const std::string& channel, const ChiSquareStatistic& q, double level);

/// input_correlation() of one channel (lib/statistics/input_correlation.h).
TestResult input_test(const std::string& channel, const FStatistic& f, double level);

}  // namespace identikal
