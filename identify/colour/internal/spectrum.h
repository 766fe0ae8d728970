// Which shaping filter fits the spectrum of the innovations?
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "identify/colour/shaped_model.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/model/shaping_filter.h"
#include "lib/statistics/spectrum.h"
#include "solvers/scoring.h"

namespace identikal {

/// Where filters stand, and of which order they are.
struct ShapingStructure {
  NoiseSource source = NoiseSource::process;
  std::vector<Eigen::Index> channels;  ///< columns of G, or outputs; a filter each
  Eigen::Index order = 1;              ///< poles of each filter
  bool with_zeros = false;             ///< order - 1 of them, or none

  Eigen::Index zeros() const { return with_zeros ? order - 1 : 0; }
  /// Is the variance in front of the filter a parameter of its own?
  bool own_variance() const { return source == NoiseSource::measurement; }
  /// Unknowns of each filter: its own variance, poles, zeros.
  Eigen::Index unknowns() const { return (own_variance() ? 1 : 0) + order + zeros(); }
};

/// Of |zeta| (lib/model/shaping_filter.h) in every search: a pole within 1e-6 of the unit circle.
inline constexpr double kFarthestZeta = 8.0;

/// The innovations of the model without filters, tuned: their spectrum, and what noise does to
/// them,
///
///   S_e = T_G Q T_G* + T_V R T_V* + T_G S T_V* + T_V S' T_G*,
///   T_G = C (zI - F)^-1 G,  T_V = I - C (zI - F)^-1 K,  F = A - K C,  z = exp(i omega).
///
/// Poles of the model on the unit circle have no part in it.
struct InnovationSpectrum {
  Spectrum measured;                       ///< ny x ny, binned
  std::vector<Eigen::MatrixXcd> T_G, T_V;  ///< per frequency: ny x nw, ny x ny
  Eigen::MatrixXd Q, R, S;
  Eigen::Index samples = 0;  ///< measured values, of all outputs
};

/// @param white  discrete time; its parameters are at the values it was tuned to
/// @throws InputError where its filter has no steady state; std::invalid_argument for a recording
///   shorter than a spectrum (lib/statistics/spectrum.h)
InnovationSpectrum innovation_spectrum(const Model& white, const Dataset& recording);

/// The model with variances raised that it was tuned to next to nothing: searches in their
/// logarithms would never leave zero. @param spectrum  receives the raised Q and R too
Model with_raised_variances(Model white, InnovationSpectrum& spectrum);

/// Whittle's (1953) likelihood, -sum_k n_k (log det S_e + tr S_e^-1 measured), with H Q H* for Q or
/// R + H q H* for R; gradient and Fisher information exact. Coordinates: logarithms of factors of
/// the variances in Q (nw), in R (ny); then of every filter the logarithm of its own variance, zeta
/// of its poles, zeta of its zeros. Refers to `spectrum`.
LikelihoodProblem spectral_problem(const InnovationSpectrum& spectrum,
                                   const ShapingStructure& structure);

/// A fit of the spectrum.
struct SpectralSolution {
  ShapingStructure structure;
  Eigen::VectorXd scale_Q, scale_R;     ///< nw, ny: factors of the variances
  std::vector<ShapedChannel> channels;  ///< with their filters and own variances
  double log_likelihood = -std::numeric_limits<double>::infinity();
  double bic = std::numeric_limits<double>::infinity();
};

/// The best of several starts: pole pairs at the two highest peaks, real poles, and what a lower
/// order has found with one pole more.
/// @param lower  nullptr: nothing known of a lower order
SpectralSolution fit_spectrum(const InnovationSpectrum& spectrum, const ShapingStructure& structure,
                              const SpectralSolution* lower);

}  // namespace identikal
