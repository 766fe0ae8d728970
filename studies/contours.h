// Where does a function on a grid exceed a level?
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Polygons that cover where the function is at least `level`, without overlap and all turned the
/// same way, and the pieces of the line where it crosses it.
struct Contour {
  std::vector<std::vector<Eigen::Vector2d>> above;
  std::vector<std::array<Eigen::Vector2d, 2>> line;
};

/// value(i, j) at (x(i), y(j)), linear in the four triangles between the corners of a cell and the
/// mean of them at its centre. Cells with a corner that is not finite are left out.
/// @param x  n >= 2, rising or falling, as y, m >= 2
/// @param value  n x m
/// @throws std::invalid_argument when sizes disagree
Contour contour(const Eigen::VectorXd& x, const Eigen::VectorXd& y, const Eigen::MatrixXd& value,
                double level);

}  // namespace identikal
