// How does a figure look? Curves, bars and maps on axes, drawn as SVG.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace identikal {

struct Axis {
  std::string label;
  double low = 0.0, high = 1.0;
  bool logarithmic = false;
};

/// Points (x, y), joined in their order. Each curve of a panel gets a colour and a marker of its
/// own, so that they are told apart in print too.
struct Curve {
  enum class Form { marked, solid, dashed, points };
  std::string name;  ///< in the legend; empty: not there
  Eigen::VectorXd x, y;
  Form form = Form::solid;
};

/// A histogram: a bar of that height from each edge to the next.
struct Bars {
  std::string name;
  Eigen::VectorXd edges;   ///< n + 1, rising
  Eigen::VectorXd height;  ///< n
};

/// A function of x and y, shaded between levels.
struct Map {
  std::string label;           ///< of the colour bar
  Eigen::VectorXd x, y;        ///< rising; equally spaced, on a logarithmic axis in the logarithm
  Eigen::MatrixXd value;       ///< value(i, j) at x(i), y(j)
  std::vector<double> levels;  ///< rising
};

struct Panel {
  std::string title;
  Axis x, y;
  std::optional<Map> map;
  std::vector<Bars> bars;
  std::vector<Curve> curves;
};

/// Panels side by side.
struct Figure {
  std::vector<Panel> panels;
};

/// The figure as SVG 1.1 on a white background, 500 x 400 points a panel. The same bytes for the
/// same figure. What lies outside the axes, and on a logarithmic axis what is not positive, is left
/// out. The legend takes the corner with the fewest points.
/// @throws std::invalid_argument when sizes disagree or an axis has no extent
std::string svg(const Figure& figure);

}  // namespace identikal
