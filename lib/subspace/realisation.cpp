#include "lib/subspace/realisation.h"

#include <algorithm>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Row block r: what the past, z(t-1) ... z(t-L), says of y(t+r) as far as it was predicted by then.
MatrixXd block_hankel(const Predictor& predictor, const MatrixXd& whiten) {
  const Index p = predictor.outputs(), q = p + predictor.inputs(), lags = predictor.lags();
  MatrixXd out = MatrixXd::Zero(lags * p, lags * q);
  const MatrixXd H = whiten * predictor.H;
  for (Index r = 0; r < lags; ++r) {
    out.block(r * p, 0, p, (lags - r) * q) = H.rightCols((lags - r) * q);
  }
  return out;
}

// W with W sigma W' = I.
MatrixXd whitening(MatrixXd sigma) {
  sigma.diagonal() *= 1.0 + 1e-12;
  const Eigen::LLT<MatrixXd> factor(sigma);
  if (factor.info() != Eigen::Success) {
    return sigma.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
  }
  return factor.matrixL().solve(MatrixXd::Identity(sigma.rows(), sigma.cols()));
}

// X with X P = Y, P symmetric and positive semidefinite.
MatrixXd regression(const MatrixXd& Y, MatrixXd P) {
  P.diagonal().array() += 1e-13 * P.diagonal().maxCoeff();
  return P.ldlt().solve(Y.transpose()).transpose();
}

}  // namespace

Realisation::Realisation(const LaggedProducts& sums, const Predictor& predictor) : sums_(sums) {
  const Index q = sums.channels(), past = sums.lags * q;
  if (predictor.lags() != sums.lags || predictor.outputs() != sums.outputs ||
      predictor.inputs() != sums.inputs) {
    throw std::invalid_argument("Realisation: predictor and sums differ in lags or channels");
  }
  const MatrixXd future = block_hankel(predictor, whitening(predictor.sigma));
  const MatrixXd covariance =
      sums.gram.bottomRightCorner(past, past) / static_cast<double>(sums.windows);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(future * covariance * future.transpose());
  const VectorXd variances = modes.eigenvalues().reverse().cwiseMax(0.0);
  while (most_states_ < variances.size() && variances[most_states_] > 1e-13 * variances[0])
    ++most_states_;
  singular_values_ = variances.cwiseSqrt();
  const MatrixXd U = modes.eigenvectors().rowwise().reverse().leftCols(most_states_);
  T_ = singular_values_.head(most_states_).cwiseInverse().asDiagonal() * (U.transpose() * future);
}

InnovationForm Realisation::model(Index n) const {
  if (n < 1 || n > most_states_) throw std::invalid_argument("Realisation::model: no such order");
  const Index p = sums_.outputs, m = sums_.inputs, q = p + m, size = sums_.gram.rows();
  MatrixXd now = MatrixXd::Zero(n + m, size),
           next = MatrixXd::Zero(n, size);  // [x(t); u(t)], x(t+1)
  now.topRightCorner(n, size - q) = T_.topRows(n);
  now.block(n, p, m, m).setIdentity();
  next.leftCols(size - q) = T_.topRows(n);

  const MatrixXd of_now = sums_.gram * now.transpose(), P = now * of_now;
  const MatrixXd CD = regression(of_now.topRows(p), P);
  MatrixXd error = -CD * now;
  error.leftCols(p) += MatrixXd::Identity(p, p);
  const MatrixXd of_error = sums_.gram * error.transpose();
  const MatrixXd AB = regression(next * of_now, P);
  const MatrixXd errors = error * of_error;
  InnovationForm out;
  out.A = AB.leftCols(n);
  out.B = AB.rightCols(m);
  out.C = CD.leftCols(n);
  out.D = CD.rightCols(m);
  out.K = regression(next * of_error, errors);
  out.sigma = errors / static_cast<double>(sums_.windows);
  return out;
}

}  // namespace identikal
