#include "lib/filter/internal/nominal_innovations.h"

#include <algorithm>
#include <utility>

#include <Eigen/QR>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// x behind the last sample; e receives the innovations.
VectorXd filter(const StateSpace& m, const MatrixXd& gain, const MatrixXd& y, const MatrixXd& u,
                Index begin, VectorXd x, Eigen::Ref<MatrixXd> e) {
  VectorXd next(x.size());
  for (Index t = 0; t < e.cols(); ++t) {
    e.col(t) = y.col(begin + t);
    e.col(t).noalias() -= m.C * x;
    if (u.rows() > 0) e.col(t).noalias() -= m.D * u.col(begin + t);
    next.noalias() = m.A * x;
    next.noalias() += gain * e.col(t);
    if (u.rows() > 0) next.noalias() += m.B * u.col(begin + t);
    x.swap(next);
  }
  return x;
}

// Where the first innovations are least.
VectorXd fitting_start(const StateSpace& m, const MatrixXd& gain, const MatrixXd& y,
                       const MatrixXd& u, Index begin, Index count) {
  const Index n = m.states(), ny = m.outputs();
  MatrixXd e(ny, count), seen(ny * count, n), power = MatrixXd::Identity(n, n);
  filter(m, gain, y, u, begin, VectorXd::Zero(n), e);
  const MatrixXd F = m.A - gain * m.C;
  for (Index t = 0; t < count; ++t) {
    seen.middleRows(t * ny, ny) = m.C * power;
    power = (F * power).eval();
  }
  return seen.completeOrthogonalDecomposition().solve(e.reshaped());
}

}  // namespace

NominalInnovations nominal_innovations(const StateSpace& model, const MatrixXd& gain, Index memory,
                                       const MatrixXd& y, const MatrixXd& u, Index begin,
                                       Index length) {
  constexpr Index kEnough = 200;  // samples say where the state was
  const VectorXd start = fitting_start(
      model, gain, y, u, begin, std::min({length, memory, std::max(kEnough, 4 * model.states())}));
  MatrixXd e(y.rows(), length);
  VectorXd end = filter(model, gain, y, u, begin, start, e);
  StateSpace ran;
  ran.A = model.A, ran.B = model.B, ran.C = model.C, ran.D = model.D;
  return {std::move(ran), gain, start, std::move(end), SegmentAutocovariances(e)};
}

bool serves(const NominalInnovations& nominal, const StateSpace& model) {
  return nominal.model.A == model.A && nominal.model.B == model.B && nominal.model.C == model.C &&
         nominal.model.D == model.D;
}

}  // namespace identikal
