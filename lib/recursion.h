// The filter recursion with the shortcuts that it may take. Internal to lib.
#pragma once

#include <vector>

#include "lib/kalman.h"
#include "lib/stretch.h"

namespace identikal {

struct Shortcuts {
  bool constant_gain = true;        ///< once settled
  StretchKernel* kernel = nullptr;  ///< prepared for this model and its derivatives; or none
  std::vector<Stretch>* stretches = nullptr;  ///< of this recording, in time order
  Eigen::Index jumped = 0;                    ///< out: samples that the kernel served
  Eigen::MatrixXd* score_products = nullptr;  ///< k x k, or none: receives sum_t s_t s_t'
  bool cancelled = false;                     ///< out: a stretch was refused by the kernel
  bool late = false;                          ///< out: a diffuse start came after its first sample
};

/// check_shapes() of the model and its derivatives, x0 and P0 included where the start is given.
void check_shapes(const StateSpace& model, InitialState initial,
                  const std::vector<StateSpace>& derivatives);

/// log_likelihood() of lib/kalman.h, handing gapless stretches that are longer than the filter's
/// memory to the kernel.
Likelihood run_recursion(const StateSpace& model, InitialState initial,
                         const Eigen::Ref<const Eigen::MatrixXd>& y,
                         const Eigen::Ref<const Eigen::MatrixXd>& u,
                         const std::vector<StateSpace>& derivatives, Shortcuts& shortcuts);

}  // namespace identikal
