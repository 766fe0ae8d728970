// Is anything but white noise in a filter's innovations, and where in frequency?
#pragma once

#include <array>

#include <Eigen/Core>

#include "identify/estimate/results.h"

namespace identikal {

/// Spectra of standardised innovations, one channel each: 1 where they are white.
struct InnovationSpectra {
  Eigen::VectorXd omega;                     ///< rad per sample
  Eigen::MatrixXd level;                     ///< channels x frequencies
  std::array<double, 2> band{kNone, kNone};  ///< holds 95 % of a white sequence's values
};

/// The first sample with an innovation: a diffuse filter has none before.
Eigen::Index first_innovation(const Eigen::MatrixXd& standardised);

/// @param standardised  channels x N
/// @param first         sample to begin with; spectra from the same one have the same frequencies
/// @return empty for fewer than 64 samples
InnovationSpectra innovation_spectra(const Eigen::MatrixXd& standardised, Eigen::Index first);

struct InnovationWhiteness {
  double p = 1.0;       ///< of all tests together (Bonferroni)
  double peak = kNone;  ///< rad per sample
  double peak_p = 1.0;  ///< that white noise has one as high
};

/// Ljung-Box of every channel, and the highest peak of the spectrum of all channels against its
/// chi-square distribution.
InnovationWhiteness innovation_whiteness(const FilterEstimate& estimate);

}  // namespace identikal
