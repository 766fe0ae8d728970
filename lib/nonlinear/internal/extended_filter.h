// The extended and the iterated filter of a model of formulas, with exact derivatives. Internal to
// lib: lib/nonlinear/filter.h says what they are.
#pragma once

#include <vector>

#include "lib/filter/gated_innovations.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

/// What lib/nonlinear/filter.h offers, arguments checked: `store` with what is to be kept of the
/// innovations and states, or null; `score_products` k x k or null; `watcher` or null.
struct FilterOutputs {
  FilterResult* store = nullptr;
  Keep keep = Keep::innovations;
  Eigen::MatrixXd* score_products = nullptr;
  const FilteredStateWatcher* watcher = nullptr;
};
Likelihood run_extended_filter(const NonlinearModel& model, ModelMemory& memory,
                               const Eigen::Ref<const Eigen::VectorXd>& p, const FilterNoise& noise,
                               const std::vector<FilterDirection>& directions,
                               const InputNodes& inputs, const Eigen::Ref<const Eigen::MatrixXd>& y,
                               const NonlinearFilterOptions& options, const FilterOutputs& outputs);

/// The same in steps, which refer to all arguments.
GatedFilter gated_extended_filter(const NonlinearModel& model, ModelMemory& memory,
                                  const Eigen::Ref<const Eigen::VectorXd>& p,
                                  const FilterNoise& noise, const InputNodes& inputs,
                                  const Eigen::Ref<const Eigen::MatrixXd>& y,
                                  const NonlinearFilterOptions& options);

}  // namespace identikal
