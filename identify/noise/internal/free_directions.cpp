#include "identify/noise/internal/free_directions.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "lib/model/partial_autocorrelation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd matrix_of(const VectorXd& lower, Index n) {
  MatrixXd out(n, n);
  Index k = 0;
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) out(i, j) = out(j, i) = lower[k++];
  }
  return out;
}

// What of a covariance is not zero: columns in the units of its deviations.
MatrixXd factor_of(const MatrixXd& value, const VectorXd& gradient, const MatrixXd& information) {
  constexpr double kNegligible = 1e-4;  // of log-likelihood
  const VectorXd sd = value.diagonal().cwiseMax(0.0).cwiseSqrt();
  const VectorXd by = (sd.array() > 0.0).select(sd.cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(by.asDiagonal() * value * by.asDiagonal());
  MatrixXd out(value.rows(), value.rows());
  Index rank = 0;
  for (Index k = 0; k < value.rows(); ++k) {
    const double size = axes.eigenvalues()[k];
    if (!(size > 0.0)) continue;
    const VectorXd column = std::sqrt(size) * sd.cwiseProduct(axes.eigenvectors().col(k));
    const VectorXd lost = lower_triangle(column * column.transpose());
    const double drop = std::abs(gradient.dot(lost)) + 0.5 * lost.dot(information * lost);
    if (drop > kNegligible) out.col(rank++) = column;
  }
  return out.leftCols(rank);
}

// Directions of F that change F F': all but F times a skew matrix.
std::vector<MatrixXd> moves_of(const MatrixXd& F) {
  const Index n = F.rows(), r = F.cols(), turns = r * (r - 1) / 2;
  std::vector<MatrixXd> out;
  if (r == 0) return out;
  MatrixXd turned(n * r, turns);
  Index k = 0;
  for (Index i = 0; i < r; ++i) {
    for (Index j = 0; j < i; ++j) {
      MatrixXd move = MatrixXd::Zero(n, r);
      move.col(j) = F.col(i);
      move.col(i) = -F.col(j);
      turned.col(k++) = move.reshaped();
    }
  }
  MatrixXd all = MatrixXd::Identity(n * r, n * r);
  if (turns > 0) all = Eigen::HouseholderQR<MatrixXd>(turned).householderQ();
  for (Index j = turns; j < n * r; ++j) out.push_back(all.col(j).reshaped(n, r));
  return out;
}

// Directions of the partial autocorrelations that are not held, and that the coefficients follow:
// behind one of 1 or -1 the lower ones come in pairs.
MatrixXd moves_of(const RootsOnCircle& polynomial) {
  constexpr double kFollows = 1e-6;
  MatrixXd by;
  polynomial_coefficients(polynomial.partial, &by);
  for (Index k = 0; k < by.cols(); ++k) {
    if (polynomial.held[static_cast<std::size_t>(k)]) by.col(k).setZero();
  }
  const Eigen::JacobiSVD<MatrixXd> axes(by, Eigen::ComputeFullV);
  const Index rank = (axes.singularValues().array() > kFollows).count();
  return axes.matrixV().leftCols(rank);
}

}  // namespace

FreeDirections::FreeDirections(const VectorXd& entries, const std::vector<bool>& at_bound,
                               const std::vector<CovarianceEntries>& covariances,
                               const std::vector<RootsOnCircle>& polynomials,
                               const VectorXd& gradient, const MatrixXd& information)
    : at_(entries) {
  std::vector<bool> together(static_cast<std::size_t>(entries.size()), false);
  for (const CovarianceEntries& each : covariances) {
    for (const Index i : each.entries) together[i] = true;
  }
  for (const RootsOnCircle& each : polynomials) {
    for (const Index i : each.entries) together[i] = true;
  }
  for (Index i = 0; i < entries.size(); ++i) {
    if (!together[i] && !at_bound[i]) numbers_.push_back(i);
  }
  size_ = static_cast<Index>(numbers_.size());
  for (const RootsOnCircle& each : polynomials) {
    Polynomial polynomial{each, size_, moves_of(each)};
    size_ += polynomial.moves.cols();
    polynomials_.push_back(std::move(polynomial));
  }
  for (const CovarianceEntries& each : covariances) {
    const MatrixXd value = matrix_of(entries(each.entries), each.size);
    Factor factor{each, size_, {}, {}};
    factor.start =
        factor_of(value, gradient(each.entries), information(each.entries, each.entries));
    // In the units of the deviations, so that all moves are of a size.
    const VectorXd sd = value.diagonal().cwiseMax(0.0).cwiseSqrt();
    const VectorXd by = (sd.array() > 0.0).select(sd.cwiseInverse(), 0.0);
    const VectorXd unit = (sd.array() > 0.0).select(sd, sd.maxCoeff());
    for (MatrixXd& move : moves_of(by.asDiagonal() * factor.start)) {
      factor.moves.push_back(unit.asDiagonal() * move);
    }
    size_ += static_cast<Index>(factor.moves.size());
    factors_.push_back(std::move(factor));
  }
}

MatrixXd FreeDirections::factor_at(const Factor& factor, const VectorXd& t) const {
  MatrixXd F = factor.start;
  for (std::size_t j = 0; j < factor.moves.size(); ++j) {
    F += t[factor.first + static_cast<Index>(j)] * factor.moves[j];
  }
  return F;
}

VectorXd FreeDirections::partial_at(const Polynomial& polynomial, const VectorXd& t) const {
  return polynomial.of.partial +
         polynomial.moves * t.segment(polynomial.first, polynomial.moves.cols());
}

VectorXd FreeDirections::entries(const VectorXd& t) const {
  VectorXd out = at_;
  for (std::size_t j = 0; j < numbers_.size(); ++j) out[numbers_[j]] += t[static_cast<Index>(j)];
  for (const Factor& factor : factors_) {
    const MatrixXd F = factor_at(factor, t);
    out(factor.of.entries) = lower_triangle(F * F.transpose());
  }
  for (const Polynomial& polynomial : polynomials_) {
    out(polynomial.of.entries) =
        polynomial.of.sign.cwiseProduct(polynomial_coefficients(partial_at(polynomial, t)));
  }
  return out;
}

MatrixXd FreeDirections::jacobian(const VectorXd& t) const {
  MatrixXd out = MatrixXd::Zero(at_.size(), size_);
  for (std::size_t j = 0; j < numbers_.size(); ++j) out(numbers_[j], static_cast<Index>(j)) = 1.0;
  for (const Factor& factor : factors_) {
    const MatrixXd F = factor_at(factor, t);
    for (std::size_t j = 0; j < factor.moves.size(); ++j) {
      const MatrixXd half = factor.moves[j] * F.transpose();
      out(factor.of.entries, factor.first + static_cast<Index>(j)) =
          lower_triangle(half + half.transpose());
    }
  }
  for (const Polynomial& polynomial : polynomials_) {
    MatrixXd by_partial;
    polynomial_coefficients(partial_at(polynomial, t), &by_partial);
    const MatrixXd by = polynomial.of.sign.asDiagonal() * by_partial * polynomial.moves;
    for (Index j = 0; j < by.cols(); ++j) {
      out(polynomial.of.entries, polynomial.first + j) = by.col(j);
    }
  }
  return out;
}

std::vector<CovarianceEntries> FreeDirections::singular() const {
  std::vector<CovarianceEntries> out;
  for (const Factor& factor : factors_) {
    if (factor.start.cols() < factor.of.size) out.push_back(factor.of);
  }
  return out;
}

Index FreeDirections::number(Index j) const {
  return j < static_cast<Index>(numbers_.size()) ? numbers_[j] : -1;
}

}  // namespace identikal
