// Which innovations does a filter leave when samples of a recording are taken out, again and again?
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// The innovations of kalman_filter() (lib/filter/kalman.h) of one recording whose outputs change:
/// after the first time it is gone through only where a change is felt, to 1e-8 standard deviations
/// of the state.
///
/// Example:
///
///     RevisedInnovations innovations(model, InitialState::diffuse, u);
///     const double before = innovations.of(y).standardised(0, 17);
///     Eigen::MatrixXd without = y;
///     without(0, 17) = std::nan("");
///     const double after = innovations.of(without, {17}).standardised(0, 18);
class RevisedInnovations {
 public:
  /// @param u  nu x N, or empty for a model without inputs
  /// @throws std::invalid_argument when shapes disagree
  RevisedInnovations(const StateSpace& model, InitialState initial, const Eigen::MatrixXd& u);
  ~RevisedInnovations();
  RevisedInnovations(RevisedInnovations&&) noexcept;
  RevisedInnovations& operator=(RevisedInnovations&&) noexcept;

  /// Innovations (units of y), their standard deviations and status; log_likelihood is not kept up
  /// to date. Valid until the next call. After a status other than ok all of it is filtered again.
  /// @param y        ny x N, NaN = missing
  /// @param changed  ascending: the samples where y differs from the last time; empty, and at the
  ///   first call: all of them
  const FilterResult& of(const Eigen::MatrixXd& y, const std::vector<Eigen::Index>& changed = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace identikal
