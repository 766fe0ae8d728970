#include "lib/filter/partly_diffuse.h"

#include <memory>
#include <optional>
#include <utility>

#include "lib/base/constants.h"
#include "lib/filter/internal/stationary_start.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// The covariance that the start measures, and its derivatives.
struct Start {
  std::vector<Index> states;
  MatrixXd P;
  std::vector<MatrixXd> derivatives;

  MatrixXd of(const MatrixXd& M) const { return M(states, states); }

  void find(const StateSpace& m, const std::vector<StateSpace>* by) {
    const auto n = static_cast<Index>(states.size());
    const MatrixXd A = of(m.A);
    StationaryStart start;
    const MatrixXd undefined = MatrixXd::Constant(n, n, kNaN);
    const bool known = start.compute(A, of(m.G * m.Q * m.G.transpose()));
    P = known ? start.P() : undefined;
    derivatives.clear();
    if (by == nullptr) return;
    for (const StateSpace& d : *by) {
      const MatrixXd noise = d.G * m.Q * m.G.transpose(),
                     W = noise + noise.transpose() + m.G * d.Q * m.G.transpose();
      derivatives.push_back(known ? start.derivative(of(d.A), of(W)) : undefined);
    }
  }

  // Outputs that show the states; `one`: 1, or 0 in a derivative.
  void add(StateSpace& m, const MatrixXd& R, double one) const {
    const auto more = static_cast<Index>(states.size());
    const Index ny = m.outputs();
    m.C.conservativeResize(ny + more, Eigen::NoChange);
    m.C.bottomRows(more).setZero();
    for (Index i = 0; i < more; ++i) m.C(ny + i, states[static_cast<std::size_t>(i)]) = one;
    m.D.conservativeResize(ny + more, Eigen::NoChange);
    m.D.bottomRows(more).setZero();
    MatrixXd all = MatrixXd::Zero(ny + more, ny + more);
    all.topLeftCorner(ny, ny) = m.R;
    all.bottomRightCorner(more, more) = R;
    m.R = std::move(all);
    m.S.conservativeResize(Eigen::NoChange, ny + more);
    m.S.rightCols(more).setZero();
  }
};

}  // namespace

ModelAt partly_diffuse(ModelAt model, std::vector<Index> stationary) {
  const auto start = std::make_shared<Start>();
  start->states = std::move(stationary);
  return [model = std::move(model), start](Index t, StateSpace& m,
                                           std::vector<StateSpace>* derivatives) {
    model(t, m, derivatives);
    if (t == 0) start->find(m, derivatives);
    start->add(m, start->P, 1.0);
    if (derivatives == nullptr) return;
    for (std::size_t i = 0; i < derivatives->size(); ++i) {
      start->add((*derivatives)[i], start->derivatives[i], 0.0);
    }
  };
}

MatrixXd with_start(const Eigen::Ref<const MatrixXd>& y, Index states) {
  MatrixXd out = MatrixXd::Constant(y.rows() + states, y.cols(), kNaN);
  out.topRows(y.rows()) = y;
  if (y.cols() > 0) out.bottomRows(states).col(0).setZero();
  return out;
}

void take_out_start(FilterResult& result, Index states) {
  const Index ny = result.e.rows() - states;
  for (MatrixXd* rows : {&result.e, &result.e_sd, &result.standardised}) {
    *rows = rows->topRows(ny).eval();
  }
  for (MatrixXd& Sigma : result.Sigma) Sigma = Sigma.topLeftCorner(ny, ny).eval();
}

}  // namespace identikal
