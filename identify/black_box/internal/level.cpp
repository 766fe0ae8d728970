#include "identify/black_box/internal/level.h"

#include <algorithm>

#include <Eigen/LU>
#include <Eigen/QR>

#include "identify/black_box/internal/predictor_memory.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFollows = 1e-2;  // of a level: predictions that leave no more of it follow any

// Of c that is taken off y the innovations lose (I - C (I - A + K C)^-1 K) c once the predictor has settled.
VectorXd settled_level(const InnovationForm& model, const ScaledRecordings& recordings,
                       Index lags) {
  const Index n = model.states(), p = model.outputs();
  VectorXd sum = VectorXd::Zero(p), count = sum;
  const MatrixXd settle = MatrixXd::Identity(n, n) - model.A + model.K * model.C;
  const MatrixXd kept = MatrixXd::Identity(p, p) - model.C * settle.partialPivLu().solve(model.K);
  const Eigen::PartialPivLU<MatrixXd> factor(kept);
  if (!kept.allFinite() || !(factor.rcond() > kFollows)) return sum;
  for (std::size_t k = 0; k < recordings.y.size(); ++k) {
    const MatrixXd& y = recordings.y[k];
    const MatrixXd e = y - one_step_predictions(model, y, recordings.u[k], VectorXd::Zero(n));
    for (Index t = lags; t < e.cols(); ++t) {
      if (!e.col(t).allFinite()) continue;
      sum += e.col(t);
      count.array() += 1.0;
    }
  }
  return factor.solve(sum.cwiseQuotient(count.cwiseMax(1.0)));
}

// Of a predictor that does not settle: each recording begins at the first state that is best with that level.
VectorXd remembered_level(const InnovationForm& model, const ScaledRecordings& recordings) {
  const Index n = model.states(), p = model.outputs();
  const InnovationForm predictor = predictor_in(model, MatrixXd::Identity(p, p));
  MatrixXd kept = MatrixXd::Zero(p, p), sum = MatrixXd::Zero(p, 1);
  double rows = 0.0;
  const ScaledRecordings enough = first_rows(recordings, 5000);
  for (std::size_t k = 0; k < enough.y.size(); ++k) {
    const MatrixXd &y = enough.y[k], &u = enough.u[k];
    if (!y.allFinite()) continue;
    const auto left = [&](const MatrixXd& outputs, const MatrixXd& inputs) {
      return (outputs - simulated_outputs(predictor, driving(outputs, inputs), VectorXd::Zero(n)))
          .eval();
    };
    MatrixXd by_level(y.size(), p), by_state(y.size(), n), response = predictor.C;
    for (Index j = 0; j < p; ++j) {
      MatrixXd unit = MatrixXd::Zero(p, y.cols());
      unit.row(j).setOnes();
      by_level.col(j) = left(unit, MatrixXd::Zero(u.rows(), u.cols())).reshaped();
    }
    for (Index t = 0; t < y.cols(); ++t) {
      by_state.middleRows(p * t, p) = response;
      response = (response * predictor.A).eval();
    }
    const auto states = by_state.completeOrthogonalDecomposition();
    const auto add_beside_states = [&](MatrixXd of, MatrixXd& sums) {
      of -= by_state * states.solve(of);
      for (Index t = 0; t < y.cols(); ++t) sums += of.middleRows(p * t, p);
    };
    add_beside_states(by_level, kept);
    add_beside_states(left(y, u).reshaped(), sum);
    rows += static_cast<double>(y.cols());
  }
  const Eigen::PartialPivLU<MatrixXd> factor(kept / std::max(rows, 1.0));
  if (rows == 0.0 || !kept.allFinite() || !(factor.rcond() > kFollows)) return VectorXd::Zero(p);
  return factor.solve(sum / rows);
}

}  // namespace

VectorXd level_of(const InnovationForm& model, const ScaledRecordings& recordings, Index lags) {
  return forgets(model, lags) ? settled_level(model, recordings, lags)
                              : remembered_level(model, recordings);
}

}  // namespace identikal
