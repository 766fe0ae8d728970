// What does a posterior of one or two numbers look like? Exactly, on a grid that checks itself.
#pragma once

#include <functional>
#include <optional>

#include <Eigen/Core>

namespace identikal {

/// Points with weights that sum to one.
struct PosteriorGrid {
  Eigen::MatrixXd coordinates;  ///< k x n
  Eigen::VectorXd log_density;  ///< n, as the density gave it
  Eigen::VectorXd weight;       ///< n
  double log_integral = 0.0;    ///< log of the density's integral
  int evaluations = 0;
};

/// A density of one or two numbers that lie between `low` and `high`, which may be infinite.
struct LogDensity {
  std::function<double(const Eigen::VectorXd&)> at;
  Eigen::VectorXd low, high;
};

/// Lays a grid on the principal axes of the density, so that it follows a ridge, widens it until
/// what lies at its edge counts for nothing, and takes it twice, the second half a cell aside. Of
/// cells that low or high cuts, the part between them counts, at its centroid.
///
/// Example:
///
///     const auto grid = posterior_grid(density, draws);
///     if (grid) std::printf("mean %g\n", grid->coordinates.row(0).dot(grid->weight));
///
/// @param draws  k x some hundred, k = 1 or 2: draws that show where the density is
/// @return nothing when the two grids disagree: by more than 1 % of a standard deviation in a mean,
///   2 % in a standard deviation or 0.01 in the logarithm of the integral, or too few points count
std::optional<PosteriorGrid> posterior_grid(const LogDensity& density,
                                            const Eigen::MatrixXd& draws);

}  // namespace identikal
