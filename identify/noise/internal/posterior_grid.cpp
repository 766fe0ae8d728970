#include "identify/noise/internal/posterior_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Spread {
  VectorXd mean;
  MatrixXd covariance;
};

Spread spread_of(const MatrixXd& points, const VectorXd& weight) {
  Spread out;
  out.mean = points * weight;
  const MatrixXd centred = points.colwise() - out.mean;
  out.covariance = centred * weight.asDiagonal() * centred.transpose();
  return out;
}

// A box of k edges, the columns of `half` from its centre to its sides.
struct GridBox {
  VectorXd centre;
  MatrixXd half;
};

// About these moments, along the principal axes, this many standard deviations wide.
GridBox box_about(const Spread& m, double widths) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(m.covariance);
  const VectorXd sd = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return {m.mean, widths * axes.eigenvectors() * sd.asDiagonal()};
}

// A cell, or what is left of it between the bounds.
struct Cell {
  VectorXd centroid;
  double area = 0.0;
};

Cell segment_between(double from, double to, double low, double high) {
  const double a = std::clamp(std::min(from, to), low, high);
  const double b = std::clamp(std::max(from, to), low, high);
  return {VectorXd::Constant(1, 0.5 * (a + b)), b - a};
}

using Polygon = std::vector<Eigen::Vector2d>;

// What of it lies on the side of `bound` that sign points to, along one axis (Sutherland & Hodgman
// 1974).
Polygon cut(const Polygon& polygon, Index axis, double bound, double sign) {
  if (!std::isfinite(bound)) return polygon;
  Polygon out;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double from = sign * (a[axis] - bound), to = sign * (b[axis] - bound);
    if (from >= 0.0) out.push_back(a);
    if ((from < 0.0) != (to < 0.0)) out.push_back(a + from / (from - to) * (b - a));
  }
  return out;
}

Cell polygon_between(Polygon polygon, const VectorXd& low, const VectorXd& high) {
  for (Index axis = 0; axis < 2; ++axis) {
    polygon = cut(polygon, axis, low[axis], 1.0);
    polygon = cut(polygon, axis, high[axis], -1.0);
  }
  Cell out{VectorXd::Zero(2), 0.0};
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {  // a fan of triangles
    const Eigen::Vector2d u = polygon[i] - polygon[0], v = polygon[i + 1] - polygon[0];
    const double area = 0.5 * std::abs(u[0] * v[1] - u[1] * v[0]);
    out.area += area;
    out.centroid += area * (polygon[0] + (u + v) / 3.0);
  }
  if (out.area > 0.0) out.centroid /= out.area;
  return out;
}

// Cell number `cell` along each edge of `side` of them, shifted by a part of one.
Cell cell_of(const LogDensity& density, const GridBox& box, const Eigen::Array2i& cell, Index side,
             double shift) {
  const Index k = box.centre.size();
  const double pitch = 2.0 / static_cast<double>(side);
  const auto corner = [&](double along, double across) {
    VectorXd at(k);
    at[0] = pitch * (cell[0] + shift + along) - 1.0;
    if (k == 2) at[1] = pitch * (cell[1] + shift + across) - 1.0;
    return VectorXd(box.centre + box.half * at);
  };
  if (k == 1) {
    return segment_between(corner(0, 0)[0], corner(1, 0)[0], density.low[0], density.high[0]);
  }
  return polygon_between({corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)}, density.low,
                         density.high);
}

// `side` cells along each edge, shifted by a part of a cell along all of them.
PosteriorGrid lay(const LogDensity& density, const GridBox& box, Index side, double shift) {
  const Index k = box.centre.size(), count = k == 1 ? side : side * side;
  PosteriorGrid out;
  out.coordinates.resize(k, count);
  out.log_density = VectorXd::Constant(count, -kInfinity);
  VectorXd area(count);
  for (Index p = 0; p < count; ++p) {
    const Eigen::Array2i number(static_cast<int>(p % side), static_cast<int>(p / side));
    const Cell cell = cell_of(density, box, number, side, shift);
    area[p] = cell.area;
    out.coordinates.col(p) = cell.area > 0.0 ? cell.centroid : box.centre;
    if (!(cell.area > 0.0)) continue;
    out.log_density[p] = density.at(cell.centroid);
    ++out.evaluations;
  }
  const double highest = out.log_density.maxCoeff();
  if (!(highest > -kInfinity)) return out;
  out.weight = (out.log_density.array() - highest).exp() * area.array();
  out.log_integral = highest + std::log(out.weight.sum());
  out.weight /= out.weight.sum();
  return out;
}

// By how much each half edge has to grow: where a side of the box carries weight.
VectorXd growth(const PosteriorGrid& grid, Index side) {
  constexpr double kNothing = 1e-7;
  const Index k = grid.coordinates.rows();
  VectorXd at_edge = VectorXd::Zero(k);
  for (Index p = 0; p < grid.weight.size(); ++p) {
    for (Index i = 0; i < k; ++i) {
      const Index cell = i == 0 ? p % side : p / side;
      if (cell == 0 || cell == side - 1) at_edge[i] += grid.weight[p];
    }
  }
  return (at_edge.array() > kNothing).select(VectorXd::Constant(k, 1.5), VectorXd::Ones(k));
}

// The box that holds all of the density and little else.
std::optional<GridBox> find_box(const LogDensity& density, const MatrixXd& draws,
                                int& evaluations) {
  constexpr Index kSide = 48;
  constexpr int kRounds = 30;
  const auto n = static_cast<double>(draws.cols());
  Spread m = spread_of(draws, VectorXd::Constant(draws.cols(), 1.0 / n));
  GridBox box = box_about(m, 6.0);
  int axes_turned = 0;
  for (int round = 0; round < kRounds; ++round) {
    const PosteriorGrid grid = lay(density, box, kSide, 0.0);
    evaluations += grid.evaluations;
    if (grid.weight.size() == 0) return std::nullopt;
    const VectorXd more = growth(grid, kSide);
    if (more.maxCoeff() > 1.0) {
      box.half = box.half * more.asDiagonal();
      continue;
    }
    if (axes_turned == 2) return box;
    // Next on the axes of what was found, instead of those of the draws.
    m = spread_of(grid.coordinates, grid.weight);
    box = box_about(m, 5.5);
    ++axes_turned;
  }
  return std::nullopt;
}

bool agree(const PosteriorGrid& a, const PosteriorGrid& b) {
  constexpr double kMean = 0.01, kDeviation = 0.02, kIntegral = 0.01, kFewest = 100.0;
  const Spread one = spread_of(a.coordinates, a.weight), two = spread_of(b.coordinates, b.weight);
  const VectorXd sd = one.covariance.diagonal().cwiseSqrt();
  const VectorXd other = two.covariance.diagonal().cwiseSqrt();
  return ((one.mean - two.mean).array().abs() <= kMean * sd.array()).all() &&
         ((sd - other).array().abs() <= kDeviation * sd.array()).all() &&
         std::abs(a.log_integral - b.log_integral) <= kIntegral &&
         1.0 / a.weight.squaredNorm() >= kFewest && 1.0 / b.weight.squaredNorm() >= kFewest;
}

// Both as one, the points of each as its integral weighs.
PosteriorGrid joined(const PosteriorGrid& a, const PosteriorGrid& b) {
  const Index n = a.weight.size(), m = b.weight.size();
  PosteriorGrid out;
  out.coordinates.resize(a.coordinates.rows(), n + m);
  out.coordinates << a.coordinates, b.coordinates;
  out.log_density.resize(n + m);
  out.log_density << a.log_density, b.log_density;
  const double share = 1.0 / (1.0 + std::exp(b.log_integral - a.log_integral));
  out.weight.resize(n + m);
  out.weight << share * a.weight, (1.0 - share) * b.weight;
  out.log_integral =
      a.log_integral + std::log(0.5 + 0.5 * std::exp(b.log_integral - a.log_integral));
  return out;
}

}  // namespace

std::optional<PosteriorGrid> posterior_grid(const LogDensity& density, const MatrixXd& draws) {
  int evaluations = 0;
  const std::optional<GridBox> box = find_box(density, draws, evaluations);
  if (!box) return std::nullopt;
  const bool line = draws.rows() == 1;
  for (const Index side : line ? std::array{1000, 4000} : std::array{120, 240}) {
    const PosteriorGrid one = lay(density, *box, side, -0.25);
    const PosteriorGrid two = lay(density, *box, side, 0.25);
    if (one.weight.size() == 0 || two.weight.size() == 0) return std::nullopt;
    evaluations += one.evaluations + two.evaluations;
    if (!agree(one, two)) continue;
    PosteriorGrid out = joined(one, two);
    out.evaluations = evaluations;
    return out;
  }
  return std::nullopt;
}

}  // namespace identikal
