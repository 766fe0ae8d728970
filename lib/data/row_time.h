// When was a row recorded, in words?
#pragma once

#include <string>

#include <Eigen/Core>

#include "lib/data/dataset.h"

namespace identikal {

/// The time of a row with as many digits as tell rows apart, at least six: 262929.4 s.
///
/// Example:
///
///     Dataset drive;
///     drive.dt = 0.01;
///     drive.time.setLinSpaced(100, 0.0, 0.99);
///     std::puts(row_time(drive, 99).c_str());  // 0.99 s
///
/// @param row  0 to size() - 1
std::string row_time(const Dataset& data, Eigen::Index row);

}  // namespace identikal
