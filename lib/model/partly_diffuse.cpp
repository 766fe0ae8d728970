#include "lib/model/partly_diffuse.h"

#include <algorithm>

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

namespace {

// Of states 0 ... n-1, whether they start diffuse.
std::vector<bool> diffuse_states(const LinearModel& model) {
  const auto n = static_cast<std::size_t>(model.A.constant.rows());
  if (model.initial == InitialState::diffuse) return std::vector<bool>(n, true);
  const bool partly = model.initial == InitialState::partly_diffuse;
  std::vector<bool> out(n, partly);
  for (const Index state : model.stationary) out[static_cast<std::size_t>(state)] = false;
  for (const auto& each : model.known) out[static_cast<std::size_t>(each.state)] = false;
  return out;
}

}  // namespace

bool diffuse_states_move_as_known(const LinearModel& model, const ParameterSet& parameters) {
  const std::vector<bool> diffuse = diffuse_states(model);
  const auto counts = [&](int column) { return diffuse[static_cast<std::size_t>(column)]; };
  const auto is_free = [&](int p) { return !parameters[p].fixed; };
  for (const ParametrisedMatrix* matrix : {&model.A, &model.C}) {
    if (matrix->block >= 0 && is_free(matrix->block)) return false;
    for (const ParametrisedMatrix::Entry& e : matrix->entries) {
      if (counts(e.col) && is_free(e.parameter)) return false;
    }
    for (const ParametrisedMatrix::Formula& f : matrix->formulas) {
      if (counts(f.col) && std::any_of(f.parameters.begin(), f.parameters.end(), is_free)) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace identikal
