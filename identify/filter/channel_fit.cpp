#include "identify/filter/channel_fit.h"

#include <cmath>

#include "identify/estimate/parameter_table.h"

namespace identikal {

using Eigen::Index;

ChannelFit channel_fit(const Channel& output, const Eigen::VectorXd& y, const Eigen::VectorXd& e) {
  double sum = 0.0, count = 0.0, total = 0.0, squares = 0.0;
  for (Index t = 0; t < y.size(); ++t) {
    if (std::isnan(e[t])) continue;
    sum += y[t];
    count += 1.0;
  }
  for (Index t = 0; t < y.size(); ++t) {
    if (std::isnan(e[t])) continue;
    squares += e[t] * e[t];
    total += std::pow(y[t] - sum / count, 2);
  }
  ChannelFit fit{output.name, output.unit, kNone, kNone};
  if (count > 0.0) {
    fit.rmse = std::sqrt(squares / count) / unit_scale(output.unit);
  }
  if (total > 0.0) fit.fit_percent = 100.0 * (1.0 - std::sqrt(squares / total));
  return fit;
}

}  // namespace identikal
