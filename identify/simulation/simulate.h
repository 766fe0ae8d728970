// What would a recording of this model look like? Data with known truth.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "identify/simulation/manoeuvres.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"

namespace identikal {

/// A simulated recording as CSV text: the model's columns in the user's units, and in '#' lines
/// above them the truth of every parameter, the noise, and the seed. The file can be read back with
/// the same model.
struct Simulated {
  std::string csv;
  Eigen::Index rows = 0;
  std::vector<std::string> notes;  ///< what was driven, and how; also in the '#' lines
};

/// A record of a linear model: x(1) from the model's initial state (zero when it is diffuse), w and
/// v drawn from [Q S; S' R].
///
/// Example:
///
///     const Simulated log = simulate_linear(model, 10000, nullptr, 1);
///     std::puts(log.csv.c_str());
///
/// @param rows    length; ignored when `inputs` is given
/// @param inputs  recording that holds the model's inputs; may be null when it has none
/// @throws InputError when inputs are needed or an initial state does not exist;
/// std::invalid_argument as checked_with_inputs() (identify/model/check.h)
Simulated simulate_linear(const Model& model, Eigen::Index rows, const Dataset* inputs,
                          std::uint64_t seed);

/// The same of a nonlinear model. In continuous time the process noise enters ten times between two
/// samples, so that the truth does not share the filter's straight lines.
/// @throws InputError also when the motion diverges, or no sampling period is known
Simulated simulate_nonlinear(const Model& model, Eigen::Index rows, const Dataset* inputs,
                             std::uint64_t seed);

/// Outputs of a model that is linear, or nonlinear, at the times and inputs of a recording, as
/// simulate_linear() and simulate_nonlinear() draw them; SI, ny x N.
/// @throws InputError when an input is missing, noise is not positive semidefinite or the motion
/// diverges
Eigen::MatrixXd simulated_outputs(const Model& model, const Dataset& recording, Random& random);

/// Inputs from formulas of the time, "NAME=FORMULA" in SI, at the model's sampling period.
/// @throws InputError when an input has none, a name is unknown, or no period or length is given
Dataset signal_inputs(const Model& model, const std::vector<std::string>& signals,
                      Eigen::Index rows);

/// The vehicle through a manoeuvre (identify/simulation/manoeuvres.h) or under recorded inputs,
/// with white measurement noise: where `snr` is given, 10^(-snr/20) times the root mean square of
/// each output without noise (Sladká 2010, section 9.3.1: awgn, 'measured'), else the model file's.
/// @param inputs  recording whose steering and speed replace the manoeuvre; may be null
/// @param snr     signal-to-noise ratio [dB]
/// @throws InputError when there is neither `snr` nor an sd for an output in the model file, and as
///   drive_manoeuvre() does
Simulated simulate_vehicle(const Model& model, const ManoeuvreRequest& request,
                           const Dataset* inputs, std::optional<double> snr, std::uint64_t seed);

}  // namespace identikal
