// What stands on the engineer's sheet of a vehicle?
#pragma once

#include <array>
#include <string>
#include <vector>

#include "identify/estimate/none.h"

namespace identikal {

/// The handling of a vehicle, from a log and from a model side by side (identify/handling/sheet.h).
struct HandlingSheet {
  /// Of one of the two. What does not exist is kNone, and `why` says so in a sentence.
  struct Value {
    double value = kNone;
    double se = kNone;
    std::array<double, 2> ci95{kNone, kNone};
    std::string why;  ///< empty: value and error are there
  };
  struct Figure {
    std::string name;
    std::string unit;  ///< of all numbers
    Value log, model;
  };
  /// What one standard asks for.
  struct Section {
    std::string standard;  ///< "ISO 4138"
    std::string title;     ///< "steady-state circular driving"
    std::vector<Figure> figures;
    std::vector<std::string> remarks;  ///< sentences on what the figures rest on
  };
  std::vector<Section> sections;

  /// A bin of the characteristic curve, ISO 4138.
  struct CurvePoint {
    double ay = kNone;                   ///< vx r, mean of the bin [m/s^2]
    double seconds = kNone;              ///< of quasi-steady turning in it
    double speed = kNone;                ///< mean [m/s]
    Value angle_log, angle_model;        ///< of the steering, as it is measured [deg]
    Value yaw_gain_log, yaw_gain_model;  ///< yaw rate over that angle [1/s]
    Value sideslip_log, sideslip_model;  ///< of the centre of gravity [deg]
  };
  std::vector<CurvePoint> curve;  ///< rising in ay

  /// A frequency of an output's response to the steering angle, ISO 7401.
  struct ResponsePoint {
    double frequency = kNone;      ///< [Hz]
    double coherence = kNone;      ///< of the log, 0 to 1
    Value gain_log, gain_model;    ///< in the response's unit
    Value phase_log, phase_model;  ///< [deg], negative: the output is late
  };
  struct Response {
    std::string output;  ///< "r", "ay" or "beta"
    std::string unit;    ///< of the gain
    std::vector<ResponsePoint> points;
  };
  std::vector<Response> responses;

  std::string steering;              ///< "steering wheel" or "road wheel": whose angle it is
  double speed = kNone;              ///< that the model's response is at [m/s]
  std::vector<std::string> remarks;  ///< sentences on log and model as a whole
};

}  // namespace identikal
