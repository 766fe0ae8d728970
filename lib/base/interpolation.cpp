#include "lib/base/interpolation.h"

#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "lib/base/constants.h"
#include "lib/base/median.h"
#include "lib/base/message.h"

namespace identikal {
namespace {

/// Slope at an end point: three-point formula, cut back where it would leave the data's shape.
double end_slope(double h0, double h1, double d0, double d1) {
  const double slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
  if (slope * d0 <= 0.0) return 0.0;
  if (d0 * d1 <= 0.0 && std::abs(slope) > 3.0 * std::abs(d0)) return 3.0 * d0;
  return slope;
}

/// Slope at an interior point: weighted harmonic mean of the chords on both sides, zero at a
/// turning point.
double interior_slope(double h0, double h1, double d0, double d1) {
  if (d0 * d1 <= 0.0) return 0.0;
  const double w0 = 2.0 * h1 + h0, w1 = h1 + 2.0 * h0;
  return (w0 + w1) / (w0 / d0 + w1 / d1);
}

}  // namespace

Pchip::Pchip(const Eigen::VectorXd& x, const Eigen::VectorXd& y)
    : x_(x), y_(y), slope_(Eigen::VectorXd::Zero(x.size())) {
  const Eigen::Index n = x.size();
  if (n == 0 || y.size() != n) {
    throw std::invalid_argument(message({"Pchip: ", n, " abscissae and ", y.size(), " ordinates"}));
  }
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    if (!(x[k] < x[k + 1])) {
      throw std::invalid_argument(message({"Pchip: abscissae must increase, but x[", k,
                                           "] = ", x[k], " and x[", k + 1, "] = ", x[k + 1]}));
    }
  }
  if (n == 1) return;
  const Eigen::VectorXd h = x.tail(n - 1) - x.head(n - 1);
  const Eigen::VectorXd d = (y.tail(n - 1) - y.head(n - 1)).cwiseQuotient(h);
  if (n == 2) {
    slope_.setConstant(d[0]);
    return;
  }
  slope_[0] = end_slope(h[0], h[1], d[0], d[1]);
  slope_[n - 1] = end_slope(h[n - 2], h[n - 3], d[n - 2], d[n - 3]);
  for (Eigen::Index k = 1; k + 1 < n; ++k) {
    slope_[k] = interior_slope(h[k - 1], h[k], d[k - 1], d[k]);
  }
}

Pchip::Cubic Pchip::cubic(Eigen::Index k, double at) const {
  const double h = x_[k + 1] - x_[k];
  const double chord = (y_[k + 1] - y_[k]) / h;
  return {h, (at - x_[k]) / h, 3.0 * chord - 2.0 * slope_[k] - slope_[k + 1],
          slope_[k] + slope_[k + 1] - 2.0 * chord};
}

double Pchip::in_interval(Eigen::Index k, double at) const {
  if (x_.size() == 1) return y_[0];
  const Cubic c = cubic(k, at);
  return y_[k] + c.s * c.h * (slope_[k] + c.s * (c.c2 + c.s * c.c3));
}

double Pchip::slope_in_interval(Eigen::Index k, double at) const {
  if (x_.size() == 1) return 0.0;
  const Cubic c = cubic(k, at);
  return slope_[k] + c.s * (2.0 * c.c2 + c.s * 3.0 * c.c3);
}

Eigen::VectorXd interpolate_linearly(const Eigen::Ref<const Eigen::VectorXd>& t,
                                     const Eigen::Ref<const Eigen::VectorXd>& x,
                                     const Eigen::Ref<const Eigen::VectorXd>& at, double widest) {
  if (t.size() != x.size()) {
    throw std::invalid_argument(
        message({"interpolate_linearly: ", t.size(), " times and ", x.size(), " values"}));
  }
  Eigen::VectorXd out = Eigen::VectorXd::Constant(at.size(), kNaN);
  Eigen::Index left = -1, right = 0;  // samples on both sides of the time requested
  for (Eigen::Index k = 0; k < at.size(); ++k) {
    for (; right < t.size() && (std::isnan(x[right]) || t[right] < at[k]); ++right) {
      if (!std::isnan(x[right])) left = right;
    }
    if (right == t.size()) break;
    if (t[right] == at[k]) {
      out[k] = x[right];
    } else if (left >= 0 && t[right] - t[left] <= widest) {
      out[k] = x[left] + (x[right] - x[left]) * (at[k] - t[left]) / (t[right] - t[left]);
    }
  }
  return out;
}

double own_period(const Eigen::Ref<const Eigen::VectorXd>& t,
                  const Eigen::Ref<const Eigen::VectorXd>& x) {
  std::vector<double> steps;
  Eigen::Index last = -1;
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    if (std::isnan(x[i])) continue;
    if (last >= 0) steps.push_back(t[i] - t[last]);
    last = i;
  }
  return steps.empty() ? kNaN : median(std::move(steps));
}

}  // namespace identikal
