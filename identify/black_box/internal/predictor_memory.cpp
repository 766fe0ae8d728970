#include "identify/black_box/internal/predictor_memory.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double memory_of(const InnovationForm& model) {
  const double radius = spectral_radius(model.A - model.K * model.C);
  if (!(radius < 1.0)) return std::numeric_limits<double>::infinity();
  return radius > 0.0 ? std::log(1e-6) / std::log(radius) : 0.0;
}

bool forgets(const InnovationForm& model, Index lags) {
  return memory_of(model) < static_cast<double>(lags);
}

InnovationForm predictor_in(const InnovationForm& model, const MatrixXd& W) {
  InnovationForm out = model;
  out.A = model.A - model.K * model.C;
  out.B.resize(model.states(), model.inputs() + model.outputs());
  out.B << model.B - model.K * model.D, model.K;
  out.C = W * model.C;
  out.D = MatrixXd::Zero(model.outputs(), out.B.cols());
  out.D.leftCols(model.inputs()) = W * model.D;
  return out;
}

MatrixXd driving(const MatrixXd& y, const MatrixXd& u) {
  MatrixXd out(u.rows() + y.rows(), y.cols());
  out << u, y;
  return out;
}

VectorXd state_before_predictions(const InnovationForm& model, const MatrixXd& y, const MatrixXd& u,
                                  Index rows) {
  const MatrixXd as_is = MatrixXd::Identity(model.outputs(), model.outputs());
  return initial_state(predictor_in(model, as_is), y, driving(y, u), rows);
}

VectorXd first_state(const InnovationForm& model, const MatrixXd& y, const MatrixXd& u,
                     Index lags) {
  constexpr double kMostRows = 5000.0;
  if (forgets(model, lags) || !y.allFinite()) return VectorXd::Zero(model.states());
  const auto rows = static_cast<Index>(std::min(memory_of(model), kMostRows));
  return state_before_predictions(model, y, u, rows);
}

}  // namespace identikal
