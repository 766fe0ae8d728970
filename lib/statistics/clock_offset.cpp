#include "lib/statistics/clock_offset.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "lib/base/interpolation.h"
#include "lib/statistics/long_run_covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kCoarseSamples = 6000;  // beyond, a coarser sampling grid is searched first

// rho at one lag, in samples: y[i + lag] beside x[i].
struct Correlated {
  double rho = kNaN;
  Index count = 0;
};

Correlated correlate(const VectorXd& x, const VectorXd& y, Index lag) {
  const Index first = std::max<Index>(0, -lag), last = std::min(x.size(), y.size() - lag);
  double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
  for (Index i = first; i < last; ++i) {
    const double a = x[i], b = y[i + lag];
    if (std::isnan(a) || std::isnan(b)) continue;
    n += 1.0;
    sx += a;
    sy += b;
    sxx += a * a;
    syy += b * b;
    sxy += a * b;
  }
  Correlated out{kNaN, static_cast<Index>(n)};
  if (n < 3.0) return out;
  const double vx = sxx - sx * sx / n, vy = syy - sy * sy / n;
  if (vx > 1e-12 * sxx && vy > 1e-12 * syy) out.rho = (sxy - sx * sy / n) / std::sqrt(vx * vy);
  return out;
}

// Every second sample is the mean of two: a coarser sampling grid without aliases.
VectorXd halved(const VectorXd& x) {
  VectorXd out(x.size() / 2);
  for (Index i = 0; i < out.size(); ++i) out[i] = 0.5 * (x[2 * i] + x[2 * i + 1]);
  return out;
}

// How well a correlation answers the question.
double merit(double rho, Relation relation) {
  if (std::isnan(rho)) return -kInfinity;
  switch (relation) {
    case Relation::same_sign:
      return rho;
    case Relation::opposite_sign:
      return -rho;
    case Relation::either:
      break;
  }
  return std::abs(rho);
}

double centred(const VectorXd& x) {
  double sum = 0.0, n = 0.0;
  for (const double v : x) {
    if (std::isnan(v)) continue;
    sum += v;
    n += 1.0;
  }
  return n > 0.0 ? sum / n : 0.0;
}

double lag_error(const VectorXd& x, const VectorXd& y, Index lag, double step) {
  const Index first = std::max<Index>(1, -lag), last = std::min(x.size() - 1, y.size() - lag);
  std::vector<double> a, b, slope;
  for (Index i = first; i < last; ++i) {
    const double d = (x[i + 1] - x[i - 1]) / (2.0 * step);
    if (std::isnan(x[i]) || std::isnan(y[i + lag]) || std::isnan(d)) continue;
    a.push_back(x[i]);
    b.push_back(y[i + lag]);
    slope.push_back(d);
  }
  const auto n = static_cast<Index>(a.size());
  if (n < 8) return kNaN;
  const Eigen::Map<VectorXd> u(a.data(), n), v(b.data(), n), d(slope.data(), n);
  const VectorXd uc = u.array() - u.mean(), vc = v.array() - v.mean();
  const double g = uc.dot(vc) / uc.squaredNorm();
  const VectorXd e = vc - g * uc;
  Eigen::MatrixXd scores = (g * d.array() * e.array()).transpose();
  scores.array() -= scores.mean();
  const double information = g * g * d.squaredNorm();
  const Index bandwidth = andrews_bandwidth(scores, std::max<Index>(1, n / 10));
  return std::sqrt(std::max(0.0, long_run_covariance(scores, bandwidth)(0, 0))) / information;
}

}  // namespace

ClockOffset clock_offset(const Eigen::Ref<const VectorXd>& t_x, const Eigen::Ref<const VectorXd>& x,
                         const Eigen::Ref<const VectorXd>& t_y, const Eigen::Ref<const VectorXd>& y,
                         double largest, Relation relation) {
  if (t_x.size() != x.size() || t_y.size() != y.size() || !(largest > 0.0) ||
      !std::isfinite(largest)) {
    throw std::invalid_argument("clock_offset: sizes differ, or the largest lag is not positive");
  }
  ClockOffset out;
  const double period_x = own_period(t_x, x), period_y = own_period(t_y, y);
  if (!(period_x > 0.0) || !(period_y > 0.0)) return out;
  double step = std::max(period_x, period_y);
  const double from = std::min(t_x[0], t_y[0]);
  const double to = std::max(t_x[t_x.size() - 1], t_y[t_y.size() - 1]);
  if ((to - from) / step > 1e7) return out;
  const auto n = static_cast<Index>((to - from) / step) + 1;
  const VectorXd grid = VectorXd::LinSpaced(n, from, from + static_cast<double>(n - 1) * step);
  std::vector<VectorXd> xs{interpolate_linearly(t_x, x, grid, kBridgedPeriods * period_x)};
  std::vector<VectorXd> ys{interpolate_linearly(t_y, y, grid, kBridgedPeriods * period_y)};
  xs[0].array() -= centred(xs[0]);
  ys[0].array() -= centred(ys[0]);
  const Index present =
      std::min((!xs[0].array().isNaN()).count(), (!ys[0].array().isNaN()).count());
  while (xs.back().size() > kCoarseSamples && largest / (2.0 * step) > 20.0) {
    xs.push_back(halved(xs.back()));
    ys.push_back(halved(ys.back()));
    step *= 2.0;
  }

  // All lags on the coarsest sampling grid.
  const auto reach = static_cast<Index>(std::floor(largest / step));
  const Index least = (present >> (xs.size() - 1)) / 2;
  std::vector<double> rho(static_cast<std::size_t>(2 * reach + 1), kNaN);
  std::size_t best = 0;
  for (std::size_t k = 0; k < rho.size(); ++k) {
    const Correlated c = correlate(xs.back(), ys.back(), static_cast<Index>(k) - reach);
    if (c.count >= std::max<Index>(3, least)) rho[k] = c.rho;
    if (merit(rho[k], relation) > merit(rho[best], relation)) best = k;
  }
  if (std::isnan(rho[best])) return out;
  out.at_zero = rho[static_cast<std::size_t>(reach)];
  const double height = merit(rho[best], relation);
  const auto other = [&](int direction) {
    double valley = height, peak = -kInfinity;
    std::size_t at = best;
    for (std::size_t k = best; k < rho.size(); k += static_cast<std::size_t>(direction)) {
      const double here = merit(rho[k], relation);
      valley = std::min(valley, here);
      if (here > peak && here > valley + 0.1 * height && std::isfinite(valley)) {
        peak = here;
        at = k;
      }
      if (k == 0 && direction < 0) break;
    }
    return at;
  };
  for (const int direction : {-1, 1}) {
    const std::size_t k = other(direction);
    if (k == best) continue;
    if (merit(rho[k], relation) > merit(out.other_correlation, relation)) {
      out.other_correlation = rho[k];
      out.other_lag = step * static_cast<double>(static_cast<Index>(k) - reach);
    }
  }

  // Down to the finest sampling grid, a few lags around what the coarser one says.
  Index lag = static_cast<Index>(best) - reach;
  Index limit = reach;
  for (std::size_t level = xs.size() - 1; level-- > 0;) {
    step /= 2.0;
    limit = static_cast<Index>(std::floor(largest / step));
    const Index centre = 2 * lag;
    double top = -kInfinity;
    for (Index l = std::max(-limit, centre - 3); l <= std::min(limit, centre + 3); ++l) {
      const double here = merit(correlate(xs[level], ys[level], l).rho, relation);
      if (here > top) {
        top = here;
        lag = l;
      }
    }
  }
  const Correlated peak = correlate(xs[0], ys[0], lag);
  out.correlation = peak.rho;
  out.shared = static_cast<double>(peak.count) * step;
  out.at_edge = std::abs(lag) >= limit;
  double shift = 0.0;
  const double left = merit(correlate(xs[0], ys[0], lag - 1).rho, relation);
  const double right = merit(correlate(xs[0], ys[0], lag + 1).rho, relation);
  const double middle = merit(peak.rho, relation), bend = left - 2.0 * middle + right;
  if (!out.at_edge && std::isfinite(bend) && bend < 0.0) {
    shift = std::clamp(0.5 * (left - right) / bend, -0.5, 0.5);
  }
  out.lag = (static_cast<double>(lag) + shift) * step;
  out.se = lag_error(xs[0], ys[0], lag, step);
  return out;
}

}  // namespace identikal
