// Drives of cars whose parameters are known, with the faults that test equipment and model files
// have.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/vehicle/secondary_effects.h"

namespace identikal {

enum class DriveFault {
  late_steering,  ///< the angle is logged 20 to 300 ms before the wheels have it
  late_output,    ///< one output, 20 to 300 ms
  sign,           ///< of one channel
  gain,           ///< of one output, 0.85 to 1.15
  ratio,          ///< of the steering, in the model file, by up to 15 %
  swapped_axles,  ///< a and b in the model file
  lever_arm,      ///< the sensor of vy or ay sits up to 2 m before or behind
  turned_sensor,  ///< the sensor of vy is turned by 1 to 5 degrees
  low_pass,       ///< in one sensor, 1 to 5 Hz
  held_samples,   ///< the angle comes at 5 to 10 Hz
  spikes,         ///< of one output
  speed_scale,    ///< 0.9 to 1.1
  other_tyres,    ///< in the second half: 15 to 40 % softer in front or behind
  heavier,        ///< in the second half: by 10 to 25 %
  bank,           ///< of the road, 1 to 4 degrees
  kinds
};

std::string to_string(DriveFault fault);

/// What is wrong with a drive. Sizes are drawn for every kind; those of `kinds` count.
struct DriveFaults {
  std::vector<DriveFault> kinds;
  double delay = 0.0;                  ///< of the steering, or of an output [s]
  double gain = 1.0, ratio = 1.0;      ///< over what is right
  double arm = 0.0;                    ///< [m]
  double turn = 0.0;                   ///< [rad]
  double corner = 0.0;                 ///< [Hz]
  double speed = 1.0;                  ///< over what is right
  double softer = 1.0, heavier = 1.0;  ///< over what it was
  double bank = 0.0;                   ///< [rad]
  bool front = false;                  ///< which axle; of a sign the steering's
  int hold = 1;                        ///< samples
  int channel = 0;                     ///< of the outputs
  bool has(DriveFault fault) const {
    return std::find(kinds.begin(), kinds.end(), fault) != kinds.end();
  }
};

/// What a test engineer has, and what the car is.
struct VehicleDrive {
  Model model;  ///< Cf, Cr, Iz, offset of the steering and biases free
  Dataset recording;
  std::vector<double> truth;  ///< Cf, Cr [N/rad], Iz [kg m^2]
  SingleTrack<> car;          ///< it was driven with, in the first half
  SecondaryEffects effects{};
  Eigen::VectorXd steering;  ///< as the wheels had it, before any sensor [rad]
  double speed = 0.0;        ///< [m/s]
  DriveFaults faults;
  std::string words;  ///< car, manoeuvre, channels, faults with their sizes
};

/// Drawn at random: a car from 1:10 to 18 t, under- or oversteering, its relaxation, roll and
/// steering lag; sweep, steps, slalom or daily driving up to 4 m/s^2; r and ay, r and vy, or all
/// three, with the noise, steps and offsets of usual sensors. The same for the same seed.
/// @param faults  how many, 0 to 2, each of another kind
VehicleDrive draw_vehicle_drive(std::uint64_t seed, int faults);

}  // namespace identikal
