// How does a filter start where nothing is known of some states, and the others are in their steady
// state, or known by mean and standard deviation?
#pragma once

#include <vector>

#include "lib/model/linear_model.h"

namespace identikal {

/// Sets x0 and P0 of a discrete-time model to the start InitialState::partly_diffuse of `of`: the
/// states `of.stationary` start from N(0, P),
///
///   P = A_ss P A_ss' + (G Q G')_ss,
///
/// where the others do not move them; the states `of.known` from N(mean, sd^2) each, and of the rest
/// nothing is known, which P0 says by an infinite variance. An unstable A_ss has no such start: its
/// part of P0 is NaN, and a filter ends as unstable.
///
/// Example:
///
///     LinearModel part = constant_model(model, InitialState::partly_diffuse);
///     part.stationary = {2};
///     StateSpace at = written_matrices(part, {});
///     set_partly_diffuse_start(part, at, nullptr);
///
/// @param derivatives  of `model`; their x0 and P0 become those of the start; or null
void set_partly_diffuse_start(const LinearModel& of, StateSpace& model,
                              std::vector<StateSpace>* derivatives);

/// Holds no column of A or C a free parameter that multiplies a state which starts diffuse? Then the
/// diffuse likelihoods of such models can be compared.
bool diffuse_states_move_as_known(const LinearModel& model, const ParameterSet& parameters);

}  // namespace identikal
