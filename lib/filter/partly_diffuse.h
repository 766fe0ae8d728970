// How does a filter start where nothing is known of some states, and the others are in their steady
// state, or known by mean and standard deviation?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/model/linear_model.h"

namespace identikal {

/// States that do not start diffuse, 0-based.
struct PartStart {
  std::vector<Eigen::Index> stationary;
  std::vector<LinearModel::StartOfState> known;
  Eigen::Index size() const { return static_cast<Eigen::Index>(stationary.size() + known.size()); }
};

/// A model for InitialState::diffuse whose states `stationary`, 0-based, start from N(0, P),
///
///   P = A_ss P A_ss' + (G Q G')_ss,
///
/// all the same, where the others do not move them; and the states `known` from N(mean, sd^2) each. It
/// has as many outputs more, x_s + v with cov v = P, that are measured as zero, or the mean, before
/// the first sample: with a diffuse x_s that is the start asked for, and what it adds to the
/// log-likelihood is exactly zero.
///
/// Example:
///
///     const ModelAt always = [&](Eigen::Index, StateSpace& at, auto*) { at = model; };
///     const PartStart part{.stationary = {2}, .known = {{.state = 3, .mean = 1.0, .sd = 0.1}}};
///     FilterResult filter = kalman_filter(partly_diffuse(always, part), InitialState::diffuse,
///                                         with_start(y, part), u);
///     take_out_start(filter, part);
///
/// An unstable A_ss has no such start, and the filter ends as indefinite.
/// Source: the augmented start of de Jong (1991), lib/filter/kalman.h.
ModelAt partly_diffuse(ModelAt model, PartStart part);

/// The recording with the measured start.
Eigen::MatrixXd with_start(const Eigen::Ref<const Eigen::MatrixXd>& y, const PartStart& part);

/// The result without the outputs that were added.
void take_out_start(FilterResult& result, const PartStart& part);

}  // namespace identikal
