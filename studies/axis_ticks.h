// Which numbers stand at an axis?
#pragma once

#include <string>
#include <vector>

namespace identikal {

struct AxisTicks {
  struct Labelled {
    double at;
    std::string label;
  };
  std::vector<Labelled> major;
  std::vector<double> minor;  ///< between them, without a label
};

/// Multiples of 1, 2 or 5 times a power of ten in [low, high], all written with the same digits,
/// and from 1e5 on and below 1e-3 as multiples of the same power of ten.
/// @param most  so many steps from a labelled one to the next or fewer, at least 1
/// @throws std::invalid_argument unless low < high, both finite, and most > 0
AxisTicks linear_ticks(double low, double high, int most);

/// Powers of ten in [low, high] with 2 to 9 times each as minor ones; in less than two decades 1, 2
/// and 5 times each are labelled too.
/// @throws std::invalid_argument unless 0 < low < high, both finite, and most > 0
AxisTicks logarithmic_ticks(double low, double high, int most);

}  // namespace identikal
