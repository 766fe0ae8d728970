// Which outputs does a recording have when? Internal to the filter.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Which outputs of a recording are there when: samples begin .. end - 1 have channels[pattern].
struct Presence {
  struct Part {
    Eigen::Index begin, end;
    std::size_t pattern;
  };
  std::vector<std::vector<int>> channels;
  std::vector<Part> parts;
};

/// @param y  ny x N, NaN = missing
Presence find_presence(const Eigen::MatrixXd& y);

}  // namespace identikal
