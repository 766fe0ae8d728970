#include "lib/model/internal/affine_motion.h"

#include <cmath>

#include "lib/internal/fixed_steps.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// This length of an interval, in as many steps; null where no more can be kept.
AffineStep* step_of_length(ModelMemory& m, const InputNodes& inputs, Index k) {
  const double interval = inputs.time[k + 1] - inputs.time[k];
  const double rounding = interval_rounding(inputs.time);
  const int steps = inputs.steps[static_cast<std::size_t>(k)];
  for (AffineStep& each : m.affine) {
    if (each.steps == steps && std::abs(each.interval - interval) <= rounding) return &each;
  }
  if (m.affine.size() < kMostRepeated) m.affine.push_back({interval, steps, {}, {}, {}, {}});
  return nullptr;
}

// The same interval with inputs that go straight from one column to the other.
InputNodes alone(const AffineStep& step, Index inputs) {
  const VectorXd time = Eigen::Vector2d(0.0, step.interval);
  return input_nodes(time, MatrixXd::Zero(inputs, 2), InputPath::linear,
                     std::vector<int>{step.steps});
}

void set_inputs(InputNodes& nodes, Index input, double begin, double end) {
  nodes.u.row(input) = Eigen::RowVectorXd::LinSpaced(nodes.u.cols(), begin, end);
}

// What zero leads to, and every entry of v that is one.
void make(const NonlinearModel& model, ModelMemory& m, AffineStep& out, bool with_slopes) {
  const Index nx = model.states, nu = model.inputs, np = model.columns;
  const Index nv = nx + 2 * nu;
  InputNodes nodes = alone(out, nu);
  Jacobian slopes;
  const auto follow = [&](VectorXd x) {
    follow_fixed_steps(model, m, nodes, 0, x, with_slopes ? &slopes : nullptr);
    return x;
  };
  out.at_zero = follow(VectorXd::Zero(nx));
  out.map.resize(nx, nv);
  if (with_slopes) {
    out.slope_at_zero = slopes.wrt_p;
    out.slopes.resize(nx, np * nv);
  }
  for (Index j = 0; j < nv; ++j) {
    VectorXd x = VectorXd::Zero(nx);
    const Index input = j < nx ? -1 : (j - nx) % nu;
    if (input < 0) {
      x[j] = 1.0;
    } else {
      set_inputs(nodes, input, j < nx + nu ? 1.0 : 0.0, j < nx + nu ? 0.0 : 1.0);
    }
    out.map.col(j) = follow(x) - out.at_zero;
    if (with_slopes) out.slopes.middleCols(np * j, np) = slopes.wrt_p - out.slope_at_zero;
    if (input >= 0) set_inputs(nodes, input, 0.0, 0.0);
  }
}

}  // namespace

bool repeat_affine_motion(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
                          Index k, Eigen::Ref<VectorXd> x, Jacobian* jacobian) {
  if (!model.affine || !inputs.straight) return false;
  AffineStep* const step = step_of_length(m, inputs, k);
  if (step == nullptr) return false;
  const bool with_slopes = jacobian != nullptr;
  if (step->map.size() == 0 || (with_slopes && step->slope_at_zero.rows() == 0)) {
    make(model, m, *step, with_slopes);
  }
  const Index nx = model.states, nu = model.inputs, np = model.columns;
  const Index first = inputs.first[static_cast<std::size_t>(k)];
  m.v.resize(nx + 2 * nu);
  m.v.head(nx) = x;
  m.v.segment(nx, nu) = inputs.u.col(first);
  m.v.tail(nu) = inputs.u.col(first + 2 * step->steps);
  x = step->at_zero;
  x.noalias() += step->map.lazyProduct(m.v);
  if (!with_slopes) return true;
  jacobian->wrt_x = step->map.leftCols(nx);
  jacobian->wrt_p = step->slope_at_zero;
  for (Index j = 0; j < m.v.size(); ++j) {
    jacobian->wrt_p += m.v[j] * step->slopes.middleCols(np * j, np);
  }
  return true;
}

}  // namespace identikal
