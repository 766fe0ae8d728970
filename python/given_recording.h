// A recording as the package hands it over.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "python/result.h"

namespace identikal {

/// Arrays of float64, row by row, or none.
struct GivenRecording {
  std::optional<Doubles> time, y, u;
  double step = 0.0;
  std::vector<std::string> names;
  std::vector<std::optional<std::string>> units;
  std::vector<const char*> name_pointers, unit_pointers;

  /// Pointers into this. @throws InputError for lengths that differ
  ik_recording view();
};

/// @param item  (time, y, u, step, names, units); @throws InputError for what is no such array
GivenRecording given_recording(const pybind11::handle& item);

/// What a verb is run on, as Python gave it. @pre the interpreter is held while it is made and when it goes
class GivenData {
 public:
  /// @param samples  a list of (time, y, u, step, names, units)
  /// @param files    paths
  /// @throws InputError for what is no such array, and for lengths that differ
  GivenData(const pybind11::handle& samples, std::vector<std::string> files);
  /// @param models    text and path of each, one of them empty
  /// @param previous  results; both outlive what comes out
  Arguments arguments(const std::vector<std::pair<std::string, std::string>>& models,
                      const std::vector<const ik_result*>& previous) const;

 private:
  std::vector<GivenRecording> recordings_;
  std::vector<ik_recording> views_;
  std::vector<std::string> files_;
};

}  // namespace identikal
