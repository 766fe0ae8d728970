#include "identify/vehicle/internal/initial_states.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kUndetermined = 1e-12;  // eigenvalue of the information scaled to unit diagonal

/// Behind the last residual of the segment.
Index end_of(const VehicleProblem& problem, const VehicleRun::Segment& segment, Index from) {
  const auto behind =
      std::lower_bound(problem.row.begin() + from, problem.row.end(), segment.first + segment.rows);
  return behind - problem.row.begin();
}

/// The inverse on what is determined, zero elsewhere.
Matrix2d inverse_of(const Matrix2d& information) {
  Vector2d scale;
  for (Index i = 0; i < 2; ++i) {
    scale[i] = information(i, i) > 0.0 ? 1.0 / std::sqrt(information(i, i)) : 0.0;
  }
  const Matrix2d unit = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix2d> eigen(unit);
  Vector2d inverse;
  for (Index i = 0; i < 2; ++i) {
    const double value = eigen.eigenvalues()[i];
    inverse[i] = value > kUndetermined ? 1.0 / value : 0.0;
  }
  return scale.asDiagonal() * eigen.eigenvectors() * inverse.asDiagonal() *
         eigen.eigenvectors().transpose() * scale.asDiagonal();
}

}  // namespace

SegmentedEquations::SegmentedEquations(const VehicleProblem& problem) {
  const Index shared = problem.parameters() + problem.gains();
  information.setZero(shared, shared);
  gradient.setZero(shared);
  const Segment none{Matrix2d::Zero(), Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, shared),
                     Vector2d::Zero()};
  segments.assign(problem.run->segments.size(), none);
}

void add_rows(const VehicleProblem& problem, const LeastSquares::RowMatrix& J, const VectorXd& e,
              const VectorXd& root, double factor, SegmentedEquations& to) {
  constexpr Index kBlock = 128;  // rows that stay in the processor's first cache
  const Index shared = to.gradient.size(), columns = shared + 2;
  LeastSquares::RowMatrix weighted(kBlock, columns);
  VectorXd weighted_e(kBlock);
  Index first = 0;
  for (std::size_t s = 0; s < to.segments.size(); ++s) {
    VectorXd g = VectorXd::Zero(columns);
    MatrixXd H = MatrixXd::Zero(columns, columns);
    for (const Index end = end_of(problem, problem.run->segments[s], first); first < end;) {
      const Index rows = std::min(kBlock, end - first);
      const auto w = root.segment(first, rows);
      weighted.topRows(rows) = w.asDiagonal() * J.middleRows(first, rows);
      weighted_e.head(rows) = w.cwiseProduct(e.segment(first, rows));
      const auto block = weighted.topRows(rows);
      g.noalias() += block.transpose() * weighted_e.head(rows);
      H.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
      first += rows;
    }
    H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
    SegmentedEquations::Segment& segment = to.segments[s];
    to.information += factor * H.topLeftCorner(shared, shared);
    to.gradient += factor * g.head(shared);
    segment.information += factor * H.bottomRightCorner<2, 2>();
    segment.cross += factor * H.bottomLeftCorner(2, shared);
    segment.gradient += factor * g.tail<2>();
  }
}

EliminatedStates eliminate_states(const SegmentedEquations& equations) {
  const auto segments = static_cast<Index>(equations.segments.size());
  EliminatedStates out{equations.information, equations.gradient, VectorXd(2 * segments),
                       MatrixXd(2 * segments, equations.gradient.size())};
  for (Index s = 0; s < segments; ++s) {
    const SegmentedEquations::Segment& segment = equations.segments[s];
    const Matrix2d inverse = inverse_of(segment.information);
    const Vector2d step = -inverse * segment.gradient;
    out.states.segment<2>(2 * s) = step;
    out.by_shared.middleRows<2>(2 * s).noalias() = -inverse * segment.cross;
    out.information.noalias() += segment.cross.transpose() * out.by_shared.middleRows<2>(2 * s);
    out.gradient.noalias() += segment.cross.transpose() * step;
    out.gain -= 0.5 * segment.gradient.dot(step);
  }
  return out;
}

Eigen::MatrixX2d project_out_states(const VehicleProblem& problem, const Eigen::MatrixX2d& states,
                                    MatrixXd& X) {
  Eigen::MatrixX2d out = Eigen::MatrixX2d::Zero(states.rows(), 2);
  Index first = 0;
  for (const VehicleRun::Segment& segment : problem.run->segments) {
    const Index rows = end_of(problem, segment, first) - first;
    if (rows == 0) continue;
    Eigen::MatrixX2d scaled = states.middleRows(first, rows);
    for (Index i = 0; i < 2; ++i) {
      const double norm = scaled.col(i).norm();
      if (norm > 0.0) scaled.col(i) /= norm;
    }
    Eigen::ColPivHouseholderQR<Eigen::MatrixX2d> qr(scaled);
    qr.setThreshold(1e-9);
    const MatrixXd basis = qr.householderQ() * MatrixXd::Identity(rows, qr.rank());
    out.middleRows(first, rows).leftCols(qr.rank()) = basis;
    X.middleRows(first, rows) -= basis * (basis.transpose() * X.middleRows(first, rows));
    first += rows;
  }
  return out;
}

}  // namespace identikal
