// By how much does one clock lag another? Two signals that follow one another, on clocks that were
// not set together.
#pragma once

#include <Eigen/Core>

#include "lib/base/constants.h"

namespace identikal {

/// y(t + lag) goes with x(t): a positive lag says that y comes late.
struct ClockOffset {
  double lag = kNaN;          ///< [s]; NaN where nothing could be compared
  double se = kNaN;           ///< [s], standard error of the lag, for coloured errors
  double correlation = kNaN;  ///< of x(t) and y(t + lag), signed
  double at_zero = kNaN;      ///< the same without shift
  double other_lag = kNaN;    ///< [s] of the next best peak; NaN where there is none
  double other_correlation = kNaN;
  bool at_edge = false;  ///< the best lag is the largest tried: the true one may lie beyond
  double shared = 0.0;   ///< [s] of time in which both have samples, at the best lag
};

/// Which sign the relation has.
enum class Relation { either, same_sign, opposite_sign };

/// Global search for the lag at which the normalised cross-correlation
///   rho(l) = sum (x(t) - mx) (y(t+l) - my) / sqrt(sum (x(t) - mx)^2 sum (y(t+l) - my)^2)
/// is largest (in size, or with the sign requested), means and sums over the samples that overlap
/// at l. Both signals are put onto one sampling grid, that of the slower of the two, by linear
/// interpolation across gaps of at most kBridgedPeriods of their own periods; every lag of the
/// sampling grid up to `largest` is tried, on a coarser one first where the record is long, and a
/// parabola through the highest three refines the best. Lags at which less than half of the samples
/// overlap do not count.
///
/// The standard error is that of least squares, y(t + l) = c + g x(t) + e: variance of the summed
/// scores g x'(t) e(t) with their autocovariances (Newey & West 1987) over (sum g^2 x'^2)^2; under
/// noise with a memory of ten samples it is 13 % below the scatter (tests/lib). The other peak is
/// the highest local maximum that a valley of at least a tenth of the best correlation parts from
/// the best: close to it in height, the lag is ambiguous.
///
/// Example:
///
///     const ClockOffset late = clock_offset(time, y.row(0), time, y.row(1), 5.0);  // up to 5 s
///     std::printf("%.3f +- %.3f s\n", late.lag, late.se);
///
/// @param t_x, x   Nx increasing times [s] and values, NaN = missing; any unit
/// @param t_y, y   Ny
/// @param largest  [s], positive
/// @throws std::invalid_argument when sizes differ or `largest` is not positive and finite
ClockOffset clock_offset(const Eigen::Ref<const Eigen::VectorXd>& t_x,
                         const Eigen::Ref<const Eigen::VectorXd>& x,
                         const Eigen::Ref<const Eigen::VectorXd>& t_y,
                         const Eigen::Ref<const Eigen::VectorXd>& y, double largest,
                         Relation relation = Relation::either);

}  // namespace identikal
