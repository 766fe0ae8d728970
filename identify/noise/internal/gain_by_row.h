// By how much does one model predict held-out rows better than another?
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Per row: the mean of differences of log-densities, and its standard error from the scatter of
/// blocks of rows, ten a recording, as rows close together gain together.
struct GainByRow {
  double mean = std::numeric_limits<double>::quiet_NaN();
  double se = std::numeric_limits<double>::quiet_NaN();  ///< NaN: fewer than two blocks
};

/// @param gains  per recording: a difference for each row
inline GainByRow gain_by_row(const std::vector<Eigen::VectorXd>& gains) {
  constexpr Eigen::Index kBlocks = 10;
  std::vector<double> blocks;
  double sum = 0.0, rows = 0.0;
  for (const Eigen::VectorXd& gain : gains) {
    sum += gain.sum();
    rows += static_cast<double>(gain.size());
    const Eigen::Index length = std::max<Eigen::Index>(1, gain.size() / kBlocks);
    for (Eigen::Index at = 0; at + length <= gain.size(); at += length) {
      blocks.push_back(gain.segment(at, length).mean());
    }
  }
  GainByRow out;
  out.mean = sum / rows;
  if (blocks.size() < 2) return out;
  double squares = 0.0;
  for (const double block : blocks) squares += (block - out.mean) * (block - out.mean);
  const auto count = static_cast<double>(blocks.size());
  out.se = std::sqrt(squares / (count - 1.0) / count);
  return out;
}

}  // namespace identikal
