// How does a filter start where nothing is known of some states, and the others are in their steady
// state?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"

namespace identikal {

/// A model for InitialState::diffuse whose states `stationary`, 0-based, start from N(0, P),
///
///   P = A_ss P A_ss' + (G Q G')_ss,
///
/// all the same; the others do not move them. It has as many outputs more, x_s + v with cov v = P,
/// that are measured as zero before the first sample: with a diffuse x_s that is the start asked
/// for, and what it adds to the log-likelihood is exactly zero.
///
/// Example:
///
///     const ModelAt always = [&](Eigen::Index, StateSpace& at, auto*) { at = model; };
///     const ModelAt started = partly_diffuse(always, {2, 3});
///     FilterResult filter = kalman_filter(started, InitialState::diffuse, with_start(y, 2), u);
///     take_out_start(filter, 2);
///
/// An unstable A_ss has no such start, and the filter ends as indefinite.
/// Source: the augmented start of de Jong (1991), lib/filter/kalman.h.
ModelAt partly_diffuse(ModelAt model, std::vector<Eigen::Index> stationary);

/// The recording with the measured start. @param states  how many of them are stationary
Eigen::MatrixXd with_start(const Eigen::Ref<const Eigen::MatrixXd>& y, Eigen::Index states);

/// The result without the outputs that were added.
void take_out_start(FilterResult& result, Eigen::Index states);

}  // namespace identikal
