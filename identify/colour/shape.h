// Is the noise coloured, and which shaping filter makes it white?
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "identify/colour/shaped_model.h"
#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

struct ShapeOptions {
  int most_order = 4;                 ///< of each filter
  std::optional<NoiseSource> source;  ///< nothing: both are tried
  double hold_out = 0.3;              ///< last share of each recording, for the comparison
  std::uint64_t seed = 1;             ///< of the white model's scattered starts
  std::function<bool(const std::string& what)> progress;  ///< return false to stop
};

struct ShapeResult {
  ShapingEstimate estimate;    ///< of the model chosen
  std::optional<Model> model;  ///< with its filters and values; nothing when noise is white
  /// Of a model with coloured process noise: the one with coloured measurement noise that has the
  /// very same outputs (lib/model/equivalent_noise.h), as numbers. Nothing when filter and system
  /// share a pole.
  std::optional<Model> in_measurement;
};

/// 1. The white model is tuned (identify/noise/ml.h). Is something left? Ljung-Box of every channel's
///    innovations and the highest peak of their spectrum against its chi-square distribution,
///    together 5 %.
/// 2. For the process and for the measurement noise, for each of its channels (and all of them),
///    filters of order 1 to most_order, with one zero less or none: the spectrum of the innovations
///    under the white model's gain,
///
///      S_e = T_G H Q H* T_G* + T_V (R + H q H*) T_V*,  T_G = C (zI - F)^-1 G,
///      T_V = I - C (zI - F)^-1 K,  F = A - K C,
///
///    is fitted to theirs by Whittle's likelihood from several starts at the spectrum's peaks.
///    Seen through that gain, poles of the model on the unit circle do no harm. The coordinates are
///    reflection coefficients, so that only stable filters with stable inverses exist.
/// 3. The best by BIC go on to maximum likelihood over the innovations of the augmented model, in
///    the same coordinates; the smallest BIC wins, must beat the white model's, and must be
///    determined by the data. With a diffuse start all likelihoods are those behind the same first
///    samples.
/// 4. On the last part of each recording: errors of 1 to 16 steps' prediction and log-likelihood of
///    the filter that steps 2 and 3 choose from the first part alone, and of the white model, both
///    tuned on the first part.
/// Stopped by the caller, the result is the white model's, as not converged.
///
/// Example:
///
///     const auto shaped = shape(model, recordings);
///
/// Sources: Matisko (2013), chapter 5; Whittle (1953).
/// @throws InputError as tune_ml(), and where the model cannot take a filter
ShapeResult shape(const Model& model, const std::vector<Dataset>& recordings,
                  const ShapeOptions& options = {});

}  // namespace identikal
