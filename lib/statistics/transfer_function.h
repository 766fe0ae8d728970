// How does an output answer to an input, frequency by frequency, and how sure is that?
#pragma once

#include <complex>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Output over input at one frequency.
struct TransferFunction {
  std::complex<double> value;  ///< NaN where too few lines lie around it
  double coherence = 0.0;      ///< share of the output's power around it that the input explains
  /// Standard error of the gain over the gain, and of the phase [rad].
  double relative_se = std::numeric_limits<double>::quiet_NaN();
  double freedom = 0.0;      ///< degrees of freedom of the Student's t that goes with it
  double input_power = 0.0;  ///< mean of |U|^2 of the lines around it
};

/// The local polynomial method: the lines of the discrete Fourier transform around a frequency, of
/// all records together, by least squares on
///   Y(f') = (H + H1 x + H2 x^2) U(f') + T_r + T1_r x,  x = (f' - f)/half_width,
/// where T_r is what record r has of its begin and end, which is as smooth as a response to a start.
/// Neither leakage nor the bend of H within the band is left in H. The output's noise may have any
/// colour; noise of the input makes H smaller by its share of the power.
///
/// Example:
///
///     Eigen::MatrixXd record(2, y.cols());
///     record << u.row(0), y.row(0);
///     const auto H = transfer_function({record}, 0.01, Eigen::Vector2d(0.5, 1.0), 0.15);
///     if (H[1].coherence > 0.9) std::printf("%g at 1 Hz\n", std::abs(H[1].value));
///
/// @param records      2 x N each: input, output, `step` [s] apart, without missing samples
/// @param frequencies  [Hz], below half of 1/step
/// @param half_width   of the band whose lines are taken [Hz]; of a longest record of T seconds at
///   least 6/T. A record adds where it has five lines in it
/// @throws std::invalid_argument for a record of other than 2 rows, or fewer than 16 samples
/// Source: Pintelon & Schoukens (2012), section 7.2.
std::vector<TransferFunction> transfer_function(const std::vector<Eigen::MatrixXd>& records,
                                                double step, const Eigen::VectorXd& frequencies,
                                                double half_width);

}  // namespace identikal
