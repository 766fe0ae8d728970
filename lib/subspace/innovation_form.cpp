#include "lib/subspace/innovation_form.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "lib/filter/steady_state.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

double spectral_radius(const MatrixXd& A) {
  return A.size() == 0 ? 0.0 : A.eigenvalues().cwiseAbs().maxCoeff();
}

MatrixXd predictor_responses(const InnovationForm& model, Index lags, bool with_states) {
  const Index p = model.outputs(), m = model.inputs(), q = p + m;
  const Index at_states = (lags + 1) * q;
  MatrixXd H = MatrixXd::Zero(p, at_states + (with_states ? model.states() : 0));
  H.block(0, p, p, m) = model.D;
  MatrixXd state(model.states(), q);
  state << model.K, model.B - model.K * model.D;
  const MatrixXd A = model.A - model.K * model.C;
  MatrixXd output = model.C;
  for (Index k = 1; k <= lags; ++k) {
    H.middleCols(k * q, q).noalias() = output * state;
    output = output * A;
  }
  if (with_states) H.rightCols(model.states()) = output;
  return H;
}

MatrixXd prediction_error_covariance(const InnovationForm& model, const LaggedProducts& sums) {
  if (model.outputs() != sums.outputs || model.inputs() != sums.inputs) {
    throw std::invalid_argument(
        "prediction_error_covariance: model and sums differ in their channels");
  }
  MatrixXd error = -predictor_responses(model, sums.lags, sums.states > 0);
  error.leftCols(sums.outputs) += MatrixXd::Identity(sums.outputs, sums.outputs);
  return error * sums.gram * error.transpose() / static_cast<double>(sums.windows);
}

MatrixXd simulated_outputs(const InnovationForm& model, const Eigen::Ref<const MatrixXd>& u,
                           const VectorXd& x0) {
  MatrixXd y = model.D * u;
  const MatrixXd drive = model.B * u;
  VectorXd x = x0, next(x0.size());
  for (Index t = 0; t < u.cols(); ++t) {
    y.col(t).noalias() += model.C * x;
    next.noalias() = model.A * x;
    next += drive.col(t);
    x.swap(next);
  }
  return y;
}

MatrixXd predictor_states(const InnovationForm& model, const Eigen::Ref<const MatrixXd>& y,
                          const Eigen::Ref<const MatrixXd>& u, const VectorXd& x0) {
  MatrixXd states(model.states(), u.cols());
  const MatrixXd drive = model.B * u, direct = model.D * u;
  VectorXd x = x0, next(x0.size()), e(model.outputs());
  for (Index t = 0; t < u.cols(); ++t) {
    states.col(t) = x;
    e = y.col(t) - direct.col(t);
    e.noalias() -= model.C * x;
    for (double& each : e) {
      if (!std::isfinite(each)) each = 0.0;
    }
    next = drive.col(t);
    next.noalias() += model.A * x;
    next.noalias() += model.K * e;
    x.swap(next);
  }
  return states;
}

MatrixXd one_step_predictions(const InnovationForm& model, const Eigen::Ref<const MatrixXd>& y,
                              const Eigen::Ref<const MatrixXd>& u, const VectorXd& x0) {
  return model.C * predictor_states(model, y, u, x0) + model.D * u;
}

VectorXd initial_state(const InnovationForm& model, const Eigen::Ref<const MatrixXd>& y,
                       const Eigen::Ref<const MatrixXd>& u, Index rows) {
  const Index p = model.outputs(), n = model.states();
  rows = std::min(rows, y.cols());
  const MatrixXd left =
      y.leftCols(rows) - simulated_outputs(model, u.leftCols(rows), VectorXd::Zero(n));
  MatrixXd rows_of_x0 = MatrixXd::Zero(p * rows, n);
  VectorXd target = VectorXd::Zero(p * rows);
  MatrixXd response = model.C;
  for (Index t = 0; t < rows; ++t) {
    for (Index i = 0; i < p; ++i) {
      if (!std::isfinite(left(i, t))) continue;
      rows_of_x0.row(t * p + i) = response.row(i);
      target[t * p + i] = left(i, t);
    }
    response = response * model.A;
  }
  return rows_of_x0.completeOrthogonalDecomposition().solve(target);
}

InnovationForm with_stable_predictor(const InnovationForm& model) {
  if (spectral_radius(model.A - model.K * model.C) < 1.0) return model;
  StateSpace system;
  system.A = model.A;
  system.B = model.B;
  system.C = model.C;
  system.D = model.D;
  system.G = model.K;
  system.Q = system.R = system.S = model.sigma;
  const std::optional<SteadyState> steady = steady_state(system);
  if (!steady) return model;
  InnovationForm out = model;
  out.K = steady->K;
  out.sigma = steady->Sigma;
  return out;
}

namespace {

// The blocks of the real Schur form scaled: without eigenvectors, of which defective poles have too few.
MatrixXd schur_within(const MatrixXd& A, double radius) {
  const Eigen::RealSchur<MatrixXd> schur(A);
  MatrixXd T = schur.matrixT();
  const Index n = A.rows();
  for (Index i = 0; i < n;) {
    const Index size = i + 1 < n && T(i + 1, i) != 0.0 ? 2 : 1;
    auto block = T.block(i, i, size, size);
    const double largest = spectral_radius(block);
    if (largest > radius) block *= radius / largest;
    i += size;
  }
  return schur.matrixU() * T * schur.matrixU().transpose();
}

}  // namespace

InnovationForm with_poles_within(InnovationForm model, double radius) {
  if (spectral_radius(model.A) <= radius) return model;
  const Eigen::EigenSolver<MatrixXd> modes(model.A);
  VectorXcd poles = modes.eigenvalues();
  const MatrixXcd V = modes.eigenvectors(), inverse = V.inverse();
  constexpr double kExact = 1e-6;
  const double wrong = ((V * poles.asDiagonal() * inverse).real() - model.A).norm();
  if (!(wrong < kExact * model.A.norm())) {
    model.A = schur_within(model.A, radius);
    return model;
  }
  for (std::complex<double>& pole : poles) {
    if (std::abs(pole) > radius) pole *= radius / std::abs(pole);
  }
  model.A = (V * poles.asDiagonal() * inverse).real();
  return model;
}

}  // namespace identikal
