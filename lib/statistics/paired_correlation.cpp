#include "lib/statistics/paired_correlation.h"

#include <cmath>

namespace identikal {

PairedCorrelation paired_correlation(const Eigen::Ref<const Eigen::VectorXd>& x,
                                     const Eigen::Ref<const Eigen::VectorXd>& y) {
  constexpr double kRounding = 1e-12;  // of the sum of squares
  double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    n += 1;
    sx += x[i];
    sy += y[i];
    sxx += x[i] * x[i];
    syy += y[i] * y[i];
    sxy += x[i] * y[i];
  }
  PairedCorrelation out;
  out.count = static_cast<Eigen::Index>(n);
  if (out.count < 2) return out;
  const double vx = sxx - sx * sx / n, vy = syy - sy * sy / n;
  if (!(vx > kRounding * sxx && vy > kRounding * syy)) return out;
  out.correlation = (sxy - sx * sy / n) / std::sqrt(vx * vy);
  out.slope = std::sqrt(vy / vx);
  return out;
}

}  // namespace identikal
