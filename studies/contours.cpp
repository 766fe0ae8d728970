#include "studies/contours.h"

#include <stdexcept>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::VectorXd;

struct Corner {
  Vector2d at;
  double value;
};
using Cell = std::array<Corner, 4>;  // in turn around it

void add_triangle(const std::array<Corner, 3>& triangle, double level, Contour& out) {
  std::vector<Vector2d> inside, crossings;
  for (std::size_t k = 0; k < 3; ++k) {
    const Corner &a = triangle[k], &b = triangle[(k + 1) % 3];
    if (a.value >= level) inside.push_back(a.at);
    if ((a.value >= level) == (b.value >= level)) continue;
    const Vector2d crossing = a.at + (level - a.value) / (b.value - a.value) * (b.at - a.at);
    inside.push_back(crossing);
    crossings.push_back(crossing);
  }
  if (inside.size() > 2) out.above.push_back(inside);
  if (crossings.size() == 2) out.line.push_back({crossings[0], crossings[1]});
}

void add_cell(const Cell& cell, double level, Contour& out) {
  Corner centre{Vector2d::Zero(), 0.0};
  for (const Corner& corner : cell) {
    centre.at += 0.25 * corner.at;
    centre.value += 0.25 * corner.value;
  }
  for (std::size_t k = 0; k < 4; ++k) {
    add_triangle({cell[k], cell[(k + 1) % 4], centre}, level, out);
  }
}

// Cells from `first` to before `last` that lie above the level altogether.
void add_run(const VectorXd& x, double y0, double y1, Index first, Index last, Contour& out) {
  if (last == first) return;
  const double x0 = x[first], x1 = x[last];
  out.above.push_back({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}});
}

}  // namespace

Contour contour(const VectorXd& x, const VectorXd& y, const Eigen::MatrixXd& value, double level) {
  if (x.size() < 2 || y.size() < 2 || value.rows() != x.size() || value.cols() != y.size()) {
    throw std::invalid_argument("contour: sizes of a map disagree");
  }
  Contour out;
  for (Index j = 0; j + 1 < y.size(); ++j) {
    Index run = 0;  // where cells above the level begin
    for (Index i = 0; i + 1 < x.size(); ++i) {
      const auto corners = value.block<2, 2>(i, j);
      if (corners.allFinite() && corners.minCoeff() >= level) continue;
      add_run(x, y[j], y[j + 1], run, i, out);
      run = i + 1;
      if (!corners.allFinite() || corners.maxCoeff() < level) continue;
      add_cell({{{{x[i], y[j]}, corners(0, 0)},
                 {{x[i + 1], y[j]}, corners(1, 0)},
                 {{x[i + 1], y[j + 1]}, corners(1, 1)},
                 {{x[i], y[j + 1]}, corners(0, 1)}}},
               level, out);
    }
    add_run(x, y[j], y[j + 1], run, x.size() - 1, out);
  }
  return out;
}

}  // namespace identikal
