#include "lib/filter/partly_diffuse.h"

#include <memory>
#include <utility>

#include "lib/base/constants.h"
#include "lib/filter/internal/stationary_start.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// The covariance that the start measures, and its derivatives.
struct Start {
  PartStart part;
  MatrixXd P;
  std::vector<MatrixXd> derivatives;

  // All of them, the stationary ones first.
  MatrixXd of_all(const MatrixXd& stationary, double one) const {
    MatrixXd out = MatrixXd::Zero(part.size(), part.size());
    Index at = stationary.rows();
    out.topLeftCorner(at, at) = stationary;
    for (const auto& each : part.known) out(at, at) = one * each.sd * each.sd, ++at;
    return out;
  }

  void find(const StateSpace& m, const std::vector<StateSpace>* by) {
    const std::vector<Index>& states = part.stationary;
    const auto of = [&](const MatrixXd& M) { return MatrixXd(M(states, states)); };
    const auto n = static_cast<Index>(states.size());
    StationaryStart start;
    const MatrixXd undefined = MatrixXd::Constant(n, n, kNaN);
    const bool found = n > 0 && start.compute(of(m.A), of(m.G * m.Q * m.G.transpose()));
    P = of_all(found ? start.P() : undefined, 1.0);
    derivatives.clear();
    if (by == nullptr) return;
    for (const StateSpace& d : *by) {
      const MatrixXd noise = d.G * m.Q * m.G.transpose(),
                     W = noise + noise.transpose() + m.G * d.Q * m.G.transpose();
      derivatives.push_back(of_all(found ? start.derivative(of(d.A), of(W)) : undefined, 0.0));
    }
  }

  // Outputs that show the states; `one`: 1, or 0 in a derivative.
  void add(StateSpace& m, const MatrixXd& R, double one) const {
    const Index more = part.size(), ny = m.outputs();
    m.C.conservativeResize(ny + more, Eigen::NoChange);
    m.C.bottomRows(more).setZero();
    Index at = ny;
    for (const Index state : part.stationary) m.C(at++, state) = one;
    for (const auto& each : part.known) m.C(at++, each.state) = one;
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

ModelAt partly_diffuse(ModelAt model, PartStart part) {
  const auto start = std::make_shared<Start>();
  start->part = std::move(part);
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

MatrixXd with_start(const Eigen::Ref<const MatrixXd>& y, const PartStart& part) {
  MatrixXd out = MatrixXd::Constant(y.rows() + part.size(), y.cols(), kNaN);
  out.topRows(y.rows()) = y;
  if (y.cols() == 0) return out;
  Index at = y.rows();
  for (std::size_t i = 0; i < part.stationary.size(); ++i) out(at++, 0) = 0.0;
  for (const auto& each : part.known) out(at++, 0) = each.mean;
  return out;
}

void take_out_start(FilterResult& result, const PartStart& part) {
  const Index ny = result.e.rows() - part.size();
  for (MatrixXd* rows : {&result.e, &result.e_sd, &result.standardised}) {
    *rows = rows->topRows(ny).eval();
  }
  for (MatrixXd& Sigma : result.Sigma) Sigma = Sigma.topLeftCorner(ny, ny).eval();
}

}  // namespace identikal
