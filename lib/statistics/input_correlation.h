// Do the inputs still say something about these innovations?
#pragma once

#include <Eigen/Core>

#include "lib/statistics/whiteness.h"

namespace identikal {

/// Regression of one channel's innovations on the inputs of the same time and up to `lags` samples
/// earlier, inputs about their means: F of all coefficients together, which is exactly F
/// distributed when innovations are white, Gaussian and know all of the inputs. Rows with anything
/// missing are left out; what no input says (a constant one, two that are equal) leaves the rank.
///
/// Example:
///
///     const FStatistic f = input_correlation(e.row(0), u, 10);  // and identify's f_upper_tail()
///
/// @param e     N, NaN = missing     @param u  nu x N, NaN = missing
/// @param lags  >= 0
/// @throws std::invalid_argument when lengths differ or lags < 0
/// @return NaN when e is zero, all inputs are constant, or rows are too few
FStatistic input_correlation(const Eigen::Ref<const Eigen::VectorXd>& e,
                             const Eigen::Ref<const Eigen::MatrixXd>& u, int lags);

}  // namespace identikal
