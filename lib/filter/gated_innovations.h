// Which innovations does a filter leave when samples far off are taken out as they are met?
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// The innovations of kalman_filter() (lib/filter/kalman.h) behind a gate: a sample of which an output
/// is refused is filtered again without it, before the next one is predicted. Where an output is
/// refused too often in a row the filter has lost it: all of the row is taken back, and the gate
/// stays open to its end.
/// Source: Bar-Shalom, Li, Kirubarajan (2001), "Estimation with applications to tracking and
/// navigation", 2.3 (validation gate).
///
/// Example:
///
///     const auto far = [](Eigen::Index t, const FilterResult& so_far) {
///       return std::abs(so_far.standardised(0, t)) > 6.0 ? 0 : -1;
///     };
///     const auto kept = gated_innovations(model, InitialState::diffuse, y, u, 50, far);
///
/// @param y    ny x N, NaN = missing; receives NaN where an output was refused
/// @param u    nu x N, or empty for a model without inputs
/// @param most_in_a_row  of the samples that an output has
/// @param far  the output of sample t that is to go, or -1: asked from the first proper innovation
///   on, and again of the sample without it; e and standardised are known up to t, log_likelihood is not
/// @throws std::invalid_argument when shapes disagree
FilterResult gated_innovations(
    const StateSpace& model, InitialState initial, Eigen::MatrixXd& y, const Eigen::MatrixXd& u,
    Eigen::Index most_in_a_row,
    const std::function<int(Eigen::Index t, const FilterResult& so_far)>& far);

/// A filter that goes on in steps, and back. What the functions refer to has to stay.
struct GatedFilter {
  FilterStatus at_start = FilterStatus::ok;
  /// Samples t .. end - 1, 0-based, of y as it is now: advances t, and leaves their columns of e, e_sd
  /// and standardised, NaN where an output is missing.
  std::function<FilterStatus(FilterResult& out, Eigen::Index& t, Eigen::Index end)> go_to;
  /// All that it knows before the next sample; back to what it knew before another.
  std::function<std::vector<double>()> state;
  std::function<void(const std::vector<double>&)> go_back_to;
  std::function<bool()> is_diffuse;  ///< before the first proper innovation; null: never
};

/// The same of any filter that runs over y, of a model with that many states. Other arguments as
/// above.
FilterResult gated_innovations(
    const GatedFilter& filter, Eigen::Index states, Eigen::MatrixXd& y, Eigen::Index most_in_a_row,
    const std::function<int(Eigen::Index t, const FilterResult& so_far)>& far);

}  // namespace identikal
