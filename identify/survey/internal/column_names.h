// What does the name of a column say: which signal of a vehicle, in which unit?
#pragma once

#include <initializer_list>
#include <set>
#include <string>
#include <vector>

#include "identify/survey/signals.h"

namespace identikal {

/// "LatAcc_obd" has the words lat, acc, obd; "VelFR" has vel, fr; "ay_mps2" has ay, mps2.
std::vector<std::string> words_of(const std::string& name);

/// A name cut into words.
struct Words {
  std::set<std::string> set;
  std::string all;  ///< without anything between them

  Words() = default;
  explicit Words(const std::vector<std::string>& words);
  /// Whether one of these is a word of the name.
  bool any(std::initializer_list<const char*> list) const;
  /// Whether one of these stands anywhere among its letters.
  bool part(std::initializer_list<const char*> list) const;
};

/// A path's curvature, 1/R, or its radius: like a yaw rate, and none.
bool is_curvature(const Words& words);

/// A kind of signal that a name may mean; the higher the score the more likely.
struct NameGuess {
  SignalKind kind = SignalKind::r;
  double score = 0.0;
};
std::vector<NameGuess> kinds_of(const Words& words);

/// A unit as the ending of a name: "yaw_rate_rps", "speed_kmh"; empty where there is none that such
/// a signal may have.
std::string unit_in_name(const std::vector<std::string>& words, SignalKind kind);

/// The units that such a signal is recorded in, SI first.
std::vector<std::string> usual_units(SignalKind kind);

}  // namespace identikal
