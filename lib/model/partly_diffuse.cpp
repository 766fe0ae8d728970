#include "lib/model/partly_diffuse.h"

#include "lib/base/constants.h"
#include "lib/internal/stationary_start.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

void set_partly_diffuse_start(const LinearModel& of, StateSpace& m,
                              std::vector<StateSpace>* derivatives) {
  const std::vector<Index>& states = of.stationary;
  const auto part = [&](const MatrixXd& M) { return MatrixXd(M(states, states)); };
  const Index n = m.states(), count = static_cast<Index>(states.size());
  StationaryStart start;
  const bool found = count > 0 && start.compute(part(m.A), part(m.G * m.Q * m.G.transpose()));
  const MatrixXd undefined = MatrixXd::Constant(count, count, kNaN);
  m.x0.setZero(n);
  m.P0 = Eigen::VectorXd::Constant(n, kInfinity).asDiagonal();
  m.P0(states, states) = found ? start.P() : undefined;
  for (const LinearModel::StartOfState& each : of.known) {
    m.x0[each.state] = each.mean;
    m.P0(each.state, each.state) = each.sd * each.sd;
  }
  if (derivatives == nullptr) return;
  for (StateSpace& d : *derivatives) {
    const MatrixXd noise = d.G * m.Q * m.G.transpose(),
                   W = noise + noise.transpose() + m.G * d.Q * m.G.transpose();
    d.x0.setZero(n);
    d.P0.setZero(n, n);
    d.P0(states, states) = found ? start.derivative(part(d.A), part(W)) : undefined;
  }
}

}  // namespace identikal
