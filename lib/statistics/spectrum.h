// How is the power of a sequence distributed over frequency?
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// S(omega) = sum_k Gamma(k) exp(-i omega k), so that white noise has its covariance at every
/// frequency.
struct Spectrum {
  Eigen::VectorXd omega;            ///< K: rad per sample, inside (0, pi)
  std::vector<Eigen::MatrixXcd> S;  ///< K of ny x ny, Hermitian
  Eigen::VectorXd weight;           ///< K: independent Fourier frequencies each one stands for
  int tapers = 1;                   ///< averaged: 2 tapers degrees of freedom each
};

/// Multitaper estimate with sine tapers (Riedel & Sidorenko 1995) at the Fourier frequencies. The
/// mean is removed; missing samples (NaN) count as zero, and the power is scaled by the share of
/// those present, channel by channel.
///
/// Example:
///
///     const Spectrum spectrum = multitaper(e, 5);
///     const double power = spectrum.S[0](0, 0).real();  // at spectrum.omega[0]
///
/// @param e       ny x N
/// @param tapers  averaged; each widens the resolution by 1 / N cycles per sample
/// @throws std::invalid_argument for fewer than 16 samples or no taper
Spectrum multitaper(const Eigen::Ref<const Eigen::MatrixXd>& e, int tapers);

/// The same with neighbouring frequencies averaged into at most about `most` bins, but for those
/// around the highest peaks, which stay apart. For fits whose cost grows with the frequencies.
Spectrum binned(const Spectrum& fine, Eigen::Index most);

}  // namespace identikal
