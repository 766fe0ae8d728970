// Which model has shaping filters between white noise and its noise inputs?
#pragma once

#include <string>
#include <vector>

#include "identify/model/model_file.h"
#include "lib/model/shaping_filter.h"

namespace identikal {

/// Where coloured noise enters. From outputs alone the two cannot be told apart in general: for
/// every model of one kind there is one of the other with the same spectrum when system and filter
/// share no pole (Matisko 2013, section 5.6).
enum class NoiseSource {
  process,      ///< (5.22): G w becomes G H(z) w
  measurement,  ///< (5.23): a coloured part is added to the white v
};

struct ShapedChannel {
  Eigen::Index channel = 0;  ///< column of G, or output
  ShapingFilter filter;      ///< of the measurement: at most n - 1 zeros
  double variance = 1.0;     ///< measurement only: of the filter's own white noise
};

/// Of a continuous-time model the discrete-time one with the same samples and the same parameters:
///
///   A = Phi, B = Gamma,  and of a density  G = I,  Q = sum over its parameters q_i of
///   q_i int_0^h e^(A s) G E_i G' e^(A' s) ds
///
/// (lib/model/discretise.h). A model that is in discrete time already, whose A, B or G hold free
/// parameters, whose density is a full matrix or whose inputs are held linearly stays as it is.
///
/// Example:
///
///     const Model sampled = sampled_model(checked(model, recordings));
Model sampled_model(const Model& model);

/// Why the model cannot take such a filter; empty when it can.
std::string shaping_fault(const Model& model, NoiseSource source);

/// The model with states [f; x], f those of the filters (lib/model/shaping_filter.h). The
/// parameters are the model's own, then of every channel the variance (measurement), a_1 ..., b_1
/// ..., free. A diagonal Q becomes one parameter per variance where coloured measurement noise is
/// added.
///
/// Example:
///
///     ShapedChannel sensor;  // its noise has a resonance
///     sensor.filter = {.a = Eigen::Vector2d{-1.6, 0.8}, .b = Eigen::VectorXd::Zero(1)};
///     const Model shaped = with_shaping_filters(model, NoiseSource::measurement, {sensor});
///     std::puts(model_text(shaped, {"coloured noise"}).c_str());
///
/// @throws std::invalid_argument where shaping_fault() is not empty
Model with_shaping_filters(const Model& model, NoiseSource source,
                           const std::vector<ShapedChannel>& channels);

/// The model as text that read_model_file() reads: matrices, free parameters with their values.
/// @param comment  lines for the head, without "# "
std::string model_text(const Model& model, const std::vector<std::string>& comment);

}  // namespace identikal
