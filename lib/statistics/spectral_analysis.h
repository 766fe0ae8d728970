// How do outputs answer to inputs at every frequency, without a model? Spectral analysis and the empirical transfer function.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// y = G(e^(i omega)) u + v at K frequencies.
struct SpectralResponse {
  Eigen::VectorXd omega;            ///< K: rad per sample, above 0, up to pi
  std::vector<Eigen::MatrixXcd> G;  ///< p x m each; not a number where inputs have no power
  /// Standard errors of real and imaginary part, each; of |G| the same, of arg G [rad] se/|G|.
  std::vector<Eigen::MatrixXd> se;
  std::vector<Eigen::MatrixXcd> noise;     ///< p x p: spectrum of v; white noise has its covariance
  std::vector<Eigen::VectorXd> coherence;  ///< p: share of the output's power that inputs explain
};

/// Blackman and Tukey's estimate, G = S_yu S_u^-1 with Parzen's window over `lags` covariances, so that no spectrum is
/// negative; var G = (sum w^2 / N) S_v S_u^-1 (Ljung 1999, section 6.4). Products with a missing sample are left out.
///
/// Example:
///
///     const Eigen::VectorXd omega = Eigen::VectorXd::LinSpaced(50, 0.05, 3.1);
///     const SpectralResponse response = spectral_analysis({y}, {u}, 40, omega);
///     std::printf("%g +- %g\n", std::abs(response.G[0](0, 0)), response.se[0](0, 0));
///
/// @param y     of every recording p x N, deviations from their mean, NaN = missing
/// @param u     of every recording m x N, the same
/// @param lags  width of the window: more of them resolve more and scatter more; from 1, below the longest recording
/// @throws std::invalid_argument for no recording or input, other numbers of rows or channels, lags or omega out of range
SpectralResponse spectral_analysis(const std::vector<Eigen::MatrixXd>& y,
                                   const std::vector<Eigen::MatrixXd>& u, Eigen::Index lags,
                                   const Eigen::VectorXd& omega);

/// Ljung's empirical transfer function estimate Y/U at the Fourier frequencies of one recording of one input and output:
/// the mean is right, and the scatter does not fall with N, but for periodic inputs (Ljung 1999, section 6.3). Its errors
/// follow from the noise spectrum that spectral_analysis() finds with `lags`.
/// @param y,u  N samples without gap, at least 16
/// @throws std::invalid_argument for other sizes, gaps, or lags out of range
SpectralResponse empirical_transfer_function(const Eigen::VectorXd& y, const Eigen::VectorXd& u,
                                             Eigen::Index lags);

}  // namespace identikal
