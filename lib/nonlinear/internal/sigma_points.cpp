#include "lib/nonlinear/internal/sigma_points.h"

#include <algorithm>
#include <cmath>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of a variance; below it a covariance counts as semidefinite.
constexpr double kLeastPivot = 1e-14;
constexpr double kNegative = 1e-9;  // of a variance; a pivot further below zero is no rounding

void set_derivatives(SigmaPoints& s, const PointWeights& weights) {
  const Index rows = s.values.rows(), n = s.A.cols();
  const auto at = [rows](Stack& stack, Index column) {
    return stack.middleRows(rows * column, rows);
  };
  s.dmean.setZero();
  for (Index j = 0; j < n; ++j) {
    at(s.dA, j) = (at(s.dvalues, 1 + j) - at(s.dvalues, 1 + n + j)) / (2.0 * weights.reach);
    at(s.ddeviation, j) =
        0.5 * (at(s.dvalues, 1 + j) + at(s.dvalues, 1 + n + j)) - at(s.dvalues, 0);
    s.dmean += 2.0 * weights.outer * at(s.ddeviation, j);
  }
  for (Index j = 0; j < n; ++j) at(s.ddeviation, j) -= s.dmean;
  at(s.ddeviation, n) = -s.dmean;
  s.dmean += at(s.dvalues, 0);
  for (Index b = 0; b < rows; ++b) {
    for (Index a = 0; a <= b; ++a) {
      auto&& row = s.drest.row(a + rows * b);
      row.setZero();
      for (Index j = 0; j <= n; ++j) {
        const double weight = j < n ? 2.0 * weights.outer : weights.middle;
        row += (weight * s.deviation(a, j)) * s.ddeviation.row(b + rows * j) +
               (weight * s.deviation(b, j)) * s.ddeviation.row(a + rows * j);
      }
      if (a != b) s.drest.row(b + rows * a) = row;
    }
  }
}

}  // namespace

PointWeights point_weights(const UnscentedWeights& w, Index n) {
  const double square = w.alpha * w.alpha * (static_cast<double>(n) + w.kappa);
  return {std::sqrt(square), 0.5 / square,
          (square - static_cast<double>(n)) / square + 1.0 - w.alpha * w.alpha + w.beta};
}

FilterStatus set_covariance_factor(const MatrixXd& P, const Stack& dP, MatrixXd& L, Stack& dL) {
  const Index n = P.rows();
  for (Index j = 0; j < n; ++j) {
    const double scale = P(j, j);
    double pivot = scale;
    for (Index l = 0; l < j; ++l) pivot -= L(j, l) * L(j, l);
    if (!std::isfinite(pivot)) return FilterStatus::not_finite;
    if (pivot < -kNegative * std::abs(scale)) return FilterStatus::indefinite;
    if (scale == 0.0) {
      for (Index i = j; i < n; ++i) {
        if (P(i, j) != 0.0 || !dP.row(i + n * j).isZero(0.0)) return FilterStatus::indefinite;
        L(i, j) = 0.0;
        dL.row(i + n * j).setZero();
      }
      continue;
    }
    L(j, j) = std::sqrt(std::max(pivot, kLeastPivot * scale));
    for (Index i = j + 1; i < n; ++i) {
      double sum = P(i, j);
      for (Index l = 0; l < j; ++l) sum -= L(i, l) * L(j, l);
      L(i, j) = sum / L(j, j);
    }
    if (dP.cols() == 0) continue;
    for (Index i = j; i < n; ++i) {
      auto&& row = dL.row(i + n * j);
      row = dP.row(i + n * j);
      for (Index l = 0; l < j; ++l) {
        row -= L(j, l) * dL.row(i + n * l) + L(i, l) * dL.row(j + n * l);
      }
      if (i == j) {
        row *= 0.5 / L(j, j);
      } else {
        row -= L(i, j) * dL.row(j + n * j);
        row *= 1.0 / L(j, j);
      }
    }
  }
  return FilterStatus::ok;
}

SigmaPoints make_sigma_points(Index rows, Index n, Index k) {
  SigmaPoints out;
  out.values.setZero(rows, 2 * n + 1);
  out.dvalues.setZero(rows * (2 * n + 1), k);
  out.mean.setZero(rows);
  out.dmean.setZero(rows, k);
  out.A.setZero(rows, n);
  out.dA.setZero(rows * n, k);
  out.rest.setZero(rows, rows);
  out.drest.setZero(rows * rows, k);
  out.deviation.setZero(rows, n + 1);
  out.ddeviation.setZero(rows * (n + 1), k);
  return out;
}

void set_point(Index q, const PointWeights& weights, const VectorXd& x, const Stack& dx,
               const MatrixXd& L, const Stack& dL, VectorXd& point, Stack& dpoint) {
  const bool derived = dx.cols() > 0;
  point = x;
  if (derived) dpoint = dx;
  if (q == 0) return;
  const Index n = x.size(), j = (q - 1) % n;
  const double way = q <= n ? weights.reach : -weights.reach;
  point += way * L.col(j);
  if (derived) dpoint += way * dL.middleRows(n * j, n);
}

void set_moments(SigmaPoints& s, const PointWeights& weights) {
  const Index rows = s.values.rows(), n = s.A.cols();
  // Deviations from the middle point first: sum_j (g+ + g- - 2 g0) / 2.
  s.mean.setZero();
  for (Index j = 0; j < n; ++j) {
    s.A.col(j) = (s.values.col(1 + j) - s.values.col(1 + n + j)) / (2.0 * weights.reach);
    s.deviation.col(j) = 0.5 * (s.values.col(1 + j) + s.values.col(1 + n + j)) - s.values.col(0);
    s.mean += 2.0 * weights.outer * s.deviation.col(j);
  }
  for (Index j = 0; j < n; ++j) s.deviation.col(j) -= s.mean;
  s.deviation.col(n) = -s.mean;
  s.mean += s.values.col(0);
  for (Index b = 0; b < rows; ++b) {
    for (Index a = 0; a <= b; ++a) {
      double sum = weights.middle * s.deviation(a, n) * s.deviation(b, n);
      for (Index j = 0; j < n; ++j) {
        sum += 2.0 * weights.outer * s.deviation(a, j) * s.deviation(b, j);
      }
      s.rest(a, b) = s.rest(b, a) = sum;
    }
  }
  if (s.dvalues.cols() > 0) set_derivatives(s, weights);
}

}  // namespace identikal
