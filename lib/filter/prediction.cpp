#include "lib/filter/prediction.h"

#include <algorithm>
#include <cmath>

#include "lib/filter/kalman.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

PredictionErrors prediction_errors(const StateSpace& model, InitialState initial,
                                   const Eigen::Ref<const MatrixXd>& y,
                                   const Eigen::Ref<const MatrixXd>& u,
                                   const std::vector<int>& horizons, Index from) {
  const Index N = y.cols();
  PredictionErrors out;
  out.squares = MatrixXd::Zero(model.outputs(), static_cast<Index>(horizons.size()));
  out.count = out.squares;
  const FilterResult filter = kalman_filter(model, initial, y, u);
  if (filter.status != FilterStatus::ok) return out;
  for (Index t = std::max(filter.first_proper, from); t < N; ++t) {
    VectorXd x = filter.x_pred.col(t);
    Index now = t;
    for (std::size_t h = 0; h < horizons.size(); ++h) {
      const Index then = t + horizons[h] - 1;
      if (then >= N) break;
      for (; now < then; ++now) x = (model.A * x + model.B * u.col(now)).eval();
      const VectorXd e = y.col(then) - model.C * x - model.D * u.col(then);
      for (Index i = 0; i < e.size(); ++i) {
        if (std::isnan(e[i])) continue;
        out.squares(i, static_cast<Index>(h)) += e[i] * e[i];
        out.count(i, static_cast<Index>(h)) += 1.0;
      }
    }
  }
  return out;
}

}  // namespace identikal
