// A recording as the package hands it over.
#pragma once

#include <optional>
#include <string>
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

}  // namespace identikal
