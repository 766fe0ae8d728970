#include "lib/statistics/clock_offset.h"

#include <algorithm>
#include <cmath>
#include <optional>
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

double mean_present(const VectorXd& x) {
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

// Both signals without their means, on one sampling grid and on coarser ones, each of half the
// samples of the one before.
struct Grids {
  std::vector<VectorXd> xs, ys;
  double step = 0.0;  // of the finest
  Index present = 0;  // samples of the signal that has less of them

  double step_of(std::size_t level) const { return std::ldexp(step, static_cast<int>(level)); }
  Correlated at(std::size_t level, Index lag) const { return correlate(xs[level], ys[level], lag); }
  // Largest lag, in samples.
  Index reach(std::size_t level, double largest) const {
    return static_cast<Index>(std::floor(largest / step_of(level)));
  }
};

// Nothing where the signals have no period of their own, or nothing in common.
std::optional<Grids> make_grids(const Eigen::Ref<const VectorXd>& t_x,
                                const Eigen::Ref<const VectorXd>& x,
                                const Eigen::Ref<const VectorXd>& t_y,
                                const Eigen::Ref<const VectorXd>& y, double largest) {
  const double period_x = own_period(t_x, x), period_y = own_period(t_y, y);
  if (!(period_x > 0.0) || !(period_y > 0.0)) return std::nullopt;
  Grids out;
  out.step = std::max(period_x, period_y);
  const double from = std::min(t_x[0], t_y[0]);
  const double to = std::max(t_x[t_x.size() - 1], t_y[t_y.size() - 1]);
  if ((to - from) / out.step > 1e7) return std::nullopt;
  const auto n = static_cast<Index>((to - from) / out.step) + 1;
  const VectorXd grid = VectorXd::LinSpaced(n, from, from + static_cast<double>(n - 1) * out.step);
  out.xs.push_back(interpolate_linearly(t_x, x, grid, kBridgedPeriods * period_x));
  out.ys.push_back(interpolate_linearly(t_y, y, grid, kBridgedPeriods * period_y));
  out.xs[0].array() -= mean_present(out.xs[0]);
  out.ys[0].array() -= mean_present(out.ys[0]);
  out.present =
      std::min((!out.xs[0].array().isNaN()).count(), (!out.ys[0].array().isNaN()).count());
  while (out.xs.back().size() > kCoarseSamples &&
         largest / (2.0 * out.step_of(out.xs.size() - 1)) > 20.0) {
    out.xs.push_back(halved(out.xs.back()));
    out.ys.push_back(halved(out.ys.back()));
  }
  return out;
}

// rho at the lags -reach .. reach of the coarsest sampling grid; NaN where too little overlaps.
std::vector<double> correlate_coarsely(const Grids& grids, Index reach) {
  const std::size_t level = grids.xs.size() - 1;
  const Index least = (grids.present >> level) / 2;
  std::vector<double> rho(2 * reach + 1, kNaN);
  for (Index lag = -reach; lag <= reach; ++lag) {
    const Correlated c = grids.at(level, lag);
    if (c.count >= std::max<Index>(3, least)) rho[lag + reach] = c.rho;
  }
  return rho;
}

// The highest peak on one side of `best` that a valley of a tenth of its height separates from it;
// `best` itself where there is none.
std::size_t other_peak(const std::vector<double>& rho, std::size_t best, int direction,
                       Relation relation) {
  const double height = merit(rho[best], relation);
  double valley = height, peak = -kInfinity;
  std::size_t at = best;
  for (std::size_t k = best; k < rho.size(); k += direction) {
    const double here = merit(rho[k], relation);
    valley = std::min(valley, here);
    if (here > peak && here > valley + 0.1 * height && std::isfinite(valley)) {
      peak = here;
      at = k;
    }
    if (k == 0 && direction < 0) break;
  }
  return at;
}

// The lag on the finest sampling grid, a few lags around what the coarser ones say.
Index refine(const Grids& grids, Index lag, double largest, Relation relation) {
  for (std::size_t level = grids.xs.size() - 1; level-- > 0;) {
    const Index limit = grids.reach(level, largest), centre = 2 * lag;
    double top = -kInfinity;
    for (Index l = std::max(-limit, centre - 3); l <= std::min(limit, centre + 3); ++l) {
      const double here = merit(grids.at(level, l).rho, relation);
      if (here > top) {
        top = here;
        lag = l;
      }
    }
  }
  return lag;
}

// Top of the parabola through three correlations, in samples from the lag in the middle.
double parabola_top(double left, double middle, double right) {
  const double bend = left - 2.0 * middle + right;
  if (!std::isfinite(bend) || !(bend < 0.0)) return 0.0;
  return std::clamp(0.5 * (left - right) / bend, -0.5, 0.5);
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
  const std::optional<Grids> grids = make_grids(t_x, x, t_y, y, largest);
  if (!grids) return out;
  const std::size_t coarsest = grids->xs.size() - 1;
  const Index reach = grids->reach(coarsest, largest);
  const std::vector<double> rho = correlate_coarsely(*grids, reach);
  std::size_t best = 0;
  for (std::size_t k = 0; k < rho.size(); ++k) {
    if (merit(rho[k], relation) > merit(rho[best], relation)) best = k;
  }
  if (std::isnan(rho[best])) return out;
  out.at_zero = rho[reach];
  for (const int direction : {-1, 1}) {
    const std::size_t k = other_peak(rho, best, direction, relation);
    if (k == best) continue;
    if (merit(rho[k], relation) > merit(out.other_correlation, relation)) {
      out.other_correlation = rho[k];
      out.other_lag = grids->step_of(coarsest) * static_cast<double>(static_cast<Index>(k) - reach);
    }
  }

  const Index lag = refine(*grids, static_cast<Index>(best) - reach, largest, relation);
  const Correlated peak = grids->at(0, lag);
  out.correlation = peak.rho;
  out.shared = static_cast<double>(peak.count) * grids->step;
  out.at_edge = std::abs(lag) >= grids->reach(0, largest);
  double shift = 0.0;
  if (!out.at_edge) {
    shift = parabola_top(merit(grids->at(0, lag - 1).rho, relation), merit(peak.rho, relation),
                         merit(grids->at(0, lag + 1).rho, relation));
  }
  out.lag = (static_cast<double>(lag) + shift) * grids->step;
  out.se = lag_error(grids->xs[0], grids->ys[0], lag, grids->step);
  return out;
}

}  // namespace identikal
