// How large is the measurement noise of a sample, where its size is not the model's alone? Internal to
// lib: lib/nonlinear/filter.h is what others use.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lib/internal/direction_stack.h"
#include "lib/nonlinear/filter.h"
#include "lib/nonlinear/internal/chain.h"

namespace identikal {

/// R of a sample: R_ab s_a s_b with the scales of NonlinearFilterOptions, and its derivatives by the
/// directions. Keeps references to its arguments but for p.
class ScaledNoise {
 public:
  ScaledNoise(const NonlinearFilterOptions& options, const Eigen::Ref<const Eigen::VectorXd>& p,
              const FilterNoise& noise, const std::vector<FilterDirection>& directions);

  /// Does R differ from sample to sample?
  bool moves() const { return options_.noise_scale.size() > 0 || chain_.has_value(); }

  /// @param t, u, time  the sample, 0-based, its inputs and its time
  /// @param x, dx       state before it, and derivatives by the directions
  /// @param R, dR       written; dR by entries, column by column
  /// @return indefinite where a scale is not above 0
  FilterStatus set(Eigen::Index t, const Eigen::VectorXd& x, const Stack& dx,
                   const Eigen::Ref<const Eigen::VectorXd>& u, double time, Eigen::MatrixXd& R,
                   Stack& dR);

 private:
  bool multiply_by_formulas(const Eigen::VectorXd& x, const Stack& dx,
                            const Eigen::Ref<const Eigen::VectorXd>& u, double time);

  const NonlinearFilterOptions& options_;
  const FilterNoise& noise_;
  const std::vector<FilterDirection>& directions_;
  std::optional<Chain> chain_;  // of formulas; none: there are none
  ModelMemory memory_;
  Jacobian slopes_;
  Eigen::VectorXd scale_;  // of the sample
  Stack dscale_;
};

}  // namespace identikal
