// Which standard manoeuvres can be simulated by name, and how is a car driven through one?
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/vehicle/motion.h"

namespace identikal {

/// A number of a manoeuvre that the user may change.
struct ManoeuvreSetting {
  std::string name;
  std::string unit;  ///< of `value`; "" for a plain number
  double value;      ///< unless the user gives another
  std::string meaning;
  bool positive = true;  ///< has to be > 0
};

/// A standard manoeuvre.
struct Manoeuvre {
  std::string name;
  std::string standard;  ///< that defines it
  std::string summary;
  double speed;     ///< where it begins, unless the user gives another [km/h]
  double duration;  ///< of the recording, unless the user gives another [s]
  std::vector<ManoeuvreSetting> settings;
};

/// All of them, the default first.
const std::vector<Manoeuvre>& manoeuvres();

/// The manoeuvre of that name; the first for "".
/// @throws InputError with the names, and the nearest, for any other
const Manoeuvre& find_manoeuvre(const std::string& name);

/// The setting of that name.
/// @throws InputError with the names, and the nearest, for any other
const ManoeuvreSetting& find_setting(const Manoeuvre& manoeuvre, const std::string& name);

/// Every manoeuvre with its standard, its settings and their defaults, a line or two each.
std::string manoeuvre_help();

/// A manoeuvre as the user wants it, SI.
struct ManoeuvreRequest {
  std::string name;                        ///< "": the first
  std::optional<double> speed;             ///< [m/s]
  std::optional<double> duration;          ///< [s]
  double rate = 100.0;                     ///< [Hz]
  std::map<std::string, double> settings;  ///< those that differ, by name
};

/// What was driven, SI, row by row.
struct DrivenRecord {
  Eigen::VectorXd time, steering, vx;
  std::vector<Motion> motion;
  std::vector<std::string> notes;  ///< the manoeuvre in words; how each gate was passed
};

/// Drives the car. Lateral accelerations of the standards become steering angles by the steady gain
/// of the linear car. Steering is what the car's sensor would measure; where that sits at the road
/// wheels, the steering wheel of severe-lane-change is taken to have the ratio 21 of the car of
/// Sladká (2010).
///
/// Example:
///
///     VehicleParameters<double> p = neutral_vehicle();
///     p[kMass] = 1446, p[kA] = 0.99, p[kB] = 1.53, p[kYawInertia] = 2319, p[kCf] = p[kCr] = 88e3;
///     ManoeuvreRequest weave;
///     weave.name = "weave", weave.speed = 80.0 / 3.6;
///     const DrivenRecord drive = drive_manoeuvre(weave, TyreCurve::linear, p, true);
///
/// @throws InputError for an unknown name or setting, a value that must be positive and is not, a
///   speed, rate or duration that describes no recording of 2 to 1e8 rows, and a driver before a
///   car whose steering is delayed or whose forces relax
DrivenRecord drive_manoeuvre(const ManoeuvreRequest& request, TyreCurve curve,
                             const VehicleParameters<double>& p, bool steering_at_road_wheel);

/// The car under recorded inputs, from rest in the lateral direction or steady: time [s],
/// steering-wheel angle [rad] and vx [m/s], N each.
DrivenRecord drive_inputs(TyreCurve curve, const VehicleParameters<double>& p,
                          const Eigen::VectorXd& time, const Eigen::VectorXd& steering,
                          const Eigen::VectorXd& vx, bool from_steady_state = false);

}  // namespace identikal
