#include "lib/regression/least_squares.h"

#include <stdexcept>

#include <Eigen/QR>

#include "lib/base/constants.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearLeastSquares weighted_least_squares(const Eigen::Ref<const MatrixXd>& X,
                                          const Eigen::Ref<const MatrixXd>& Y,
                                          const Eigen::Ref<const VectorXd>& weights) {
  const Index N = X.rows(), d = X.cols();
  if (Y.rows() != N || weights.size() != N || N < 1 || d < 1) {
    throw std::invalid_argument("least squares: regressors, outputs and weights differ in length");
  }
  if (!X.allFinite() || !Y.allFinite() || !weights.allFinite() || (weights.array() < 0.0).any()) {
    throw std::invalid_argument("least squares: an entry is not finite, or a weight negative");
  }
  const VectorXd root = weights.cwiseSqrt();
  MatrixXd A = root.asDiagonal() * X;
  VectorXd scale = A.colwise().norm();
  for (Index i = 0; i < d; ++i) {
    if (scale[i] == 0.0) scale[i] = 1.0;
  }
  A = A * scale.cwiseInverse().asDiagonal();
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> qr(A);

  LinearLeastSquares out;
  out.rank = qr.rank();
  const VectorXd per_scale = scale.cwiseInverse();
  out.theta = per_scale.asDiagonal() * qr.solve(root.asDiagonal() * Y);
  out.residuals = Y - X * out.theta;
  // A+ = Z' [T^-1 0; 0 0] Q', so that (A'A)+ = A+ A+' needs the leading rows of Z alone.
  MatrixXd part = MatrixXd::Zero(d, out.rank);
  part.topRows(out.rank) = qr.matrixT()
                               .topLeftCorner(out.rank, out.rank)
                               .triangularView<Eigen::Upper>()
                               .solve(MatrixXd::Identity(out.rank, out.rank));
  MatrixXd Z = MatrixXd::Identity(d, d);
  if (out.rank < d) Z = qr.matrixZ();
  const MatrixXd back = qr.colsPermutation() * MatrixXd(Z.transpose());
  const MatrixXd root_of_P = per_scale.asDiagonal() * (back * part);
  out.P = root_of_P * root_of_P.transpose();
  out.open = per_scale.asDiagonal() * back.rightCols(d - out.rank);
  out.open.colwise().normalize();
  out.noise_variance = N > out.rank
                           ? VectorXd((root.asDiagonal() * out.residuals).colwise().squaredNorm() /
                                      static_cast<double>(N - out.rank))
                           : VectorXd::Constant(Y.cols(), kNaN);
  return out;
}

LinearLeastSquares least_squares(const Eigen::Ref<const MatrixXd>& X,
                                 const Eigen::Ref<const MatrixXd>& Y) {
  return weighted_least_squares(X, Y, VectorXd::Ones(X.rows()));
}

MatrixXd standard_errors(const LinearLeastSquares& fit) {
  constexpr double kMoved = 1e-8;  // of a direction of length 1
  MatrixXd out = fit.P.diagonal().cwiseSqrt() * fit.noise_variance.cwiseSqrt().transpose();
  for (Index i = 0; i < out.rows(); ++i) {
    if (fit.open.cols() > 0 && fit.open.row(i).cwiseAbs().maxCoeff() > kMoved) {
      out.row(i).setConstant(kNaN);
    }
  }
  return out;
}

}  // namespace identikal
