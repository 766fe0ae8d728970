// Have the errors of a prediction become larger, asked again with every new one?
#pragma once

#include <array>

#include <Eigen/Core>

namespace identikal {

/// Errors against others of 2, 4 and 16 times their variance.
inline constexpr std::array<double, 3> kGrowth{2.0, 4.0, 16.0};

/// The test's state. Read log_alarm and age; the rest is its memory.
struct ErrorGrowth {
  double samples_per_false_alarm = 1e4;
  Eigen::Index settle = 0;  ///< errors after a start or an alarm that are not looked at

  double log_alarm = 0.0;  ///< log of the statistic; -infinity while nothing is tested
  Eigen::Index age = 0;    ///< how many errors ago the growth began, as far as one knows

  Eigen::Index settling = 0;  ///< errors still to be passed over
  double squares = 0.0;       ///< of all errors looked at
  Eigen::Index errors = 0;
  std::array<double, kGrowth.size()> log_statistic{}, cumulative{}, squares_since{};
  std::array<Eigen::Index, kGrowth.size()> since{};
};

/// @param samples_per_false_alarm  A > 1
/// @param settle                   >= 0
/// @throws std::invalid_argument for values out of range
ErrorGrowth start_error_growth(double samples_per_false_alarm, Eigen::Index settle);

/// Takes an error, normalised so that all should have one variance, which need not be known.
///
/// Example:
///
///     ErrorGrowth test = start_error_growth(1e4, 30);
///     for (Eigen::Index t = 0; t < e.cols(); ++t) {
///       if (update(test, e(0, t))) std::printf("larger since sample %td\n", t - test.age);
///     }
///
/// @return true: they have grown. The test then passes over `settle` errors and begins again; the
///   errors since the growth count no longer towards the variance
///
/// Shiryaev and Roberts' statistic, averaged over the alternatives r of kGrowth:
///   S_r(t) = (1 + S_r(t-1)) q_r(t) / q_1(t),   alarm when mean_r S_r >= A,
/// where q_1 is Student's t, the predictive density of the next of normal errors of one unknown
/// variance, and q_r the same with r times its squared scale. While the errors are independent and
/// normal, S - t is a martingale of mean 0, whatever their variance: at least A errors pass between
/// false alarms in the mean, and P(an alarm among the first n) <= n / A.
/// The first 20 errors after the settling only tell the variance.
/// Source: Sladká (2010), 6.1.3, asks for such a detector and names none. Pollak (1985), Ann.
/// Statist. 13, for the statistic; recursive residuals are such errors: Brown, Durbin & Evans
/// (1975), J. R. Statist. Soc. B 37.
bool update(ErrorGrowth& test, double error);

}  // namespace identikal
