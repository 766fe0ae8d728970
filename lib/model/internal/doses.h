// What is added to the state at a sample?
#pragma once

#include "lib/model/nonlinear_model.h"

namespace identikal {

inline bool has_doses(const NonlinearModel& model) { return model.doses.values > 0; }

/// x + d(x, u(k), p, t(k)); d and its derivatives stay in the memory.
void add_doses(const NonlinearModel& model, ModelMemory& m, const InputNodes& inputs,
               Eigen::Index k, Eigen::Ref<Eigen::VectorXd> x);

/// The motion's derivatives by the state before its dose, from those by the state behind it: V(x + d, p)
/// moves with p by V_x d_p as well, and with x by V_x (I + d_x).
void chain_doses(const NonlinearModel& model, const ModelMemory& m, Jacobian& jacobian,
                 Derivatives order, Gramians* gramians);

}  // namespace identikal
