// What would a recording of this model look like? Data with known truth.
#pragma once

#include <cstdint>
#include <string>

#include "identify/model_file.h"
#include "lib/dataset.h"

namespace identikal {

/// A simulated recording as CSV text: the model's columns in the user's units, and in '#' lines
/// above them the truth of every parameter, the noise, and the seed. The file can be read back with
/// the same model.
struct Simulated {
  std::string csv;
  Eigen::Index rows = 0;
};

/// A record of a linear model: x(1) from the model's initial state (zero when it is diffuse), w and
/// v drawn from [Q S; S' R].
/// @param rows    length; ignored when `inputs` is given
/// @param inputs  recording that holds the model's inputs; may be null when it has none
/// @throws InputError when inputs are needed, an initial state does not exist, or noise is not
/// positive semidefinite
Simulated simulate_linear(const ModelFile& model, Eigen::Index rows, const Dataset* inputs,
                          std::uint64_t seed);

/// How the built-in manoeuvre is driven.
struct ManoeuvreSettings {
  double speed = 60.0 / 3.6;  ///< [m/s]
  double rate = 100.0;        ///< [Hz]
  double duration = 7.0;      ///< [s]
};

/// The vehicle through the open-loop severe lane change (lib/manoeuvre.h), with the measurement
/// noise of the model file. `inputs`, when not null, replaces the manoeuvre by a recording's
/// steering and speed.
/// @throws InputError when the model gives no sd for an output (noise: {measurement: {sd: ...}})
Simulated simulate_vehicle(const ModelFile& model, const ManoeuvreSettings& settings,
                           const Dataset* inputs, std::uint64_t seed);

}  // namespace identikal
