#include "lib/model/internal/doses.h"

#include "lib/model/internal/rates.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

void add_doses(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs, Index k,
               Eigen::Ref<Eigen::VectorXd> x) {
  write_point(model, m.doses, x.data(), inputs.at_sample.col(k).data(), inputs.time[k]);
  evaluate_jacobian(model.doses, m.doses, span_of(m.dose), span_of(m.dose_jacobian));
  x += m.dose;
}

void chain_doses(const NonlinearModel& model, const ModelMemory& m, Jacobian& jacobian,
                 Derivatives order, Gramians* gramians) {
  const Index nx = model.states;
  const auto d_p = m.dose_jacobian.rightCols(model.columns);
  const auto add = [&](MatrixXd& by) {
    by.rightCols(model.columns) += by.leftCols(nx).lazyProduct(d_p);
  };
  jacobian.wrt_p += jacobian.wrt_x.lazyProduct(d_p);
  if (model.doses_move_with_state) {
    jacobian.wrt_x += (jacobian.wrt_x * m.dose_jacobian.leftCols(nx)).eval();
  }
  if (order == Derivatives::first) return;
  add(jacobian.wrt_x_jacobian);
  if (gramians != nullptr) add(gramians->jacobian);
}

}  // namespace identikal
