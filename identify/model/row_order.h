// May the rows of a recording stand in any order? A regression of columns on columns has no time.
#pragma once

#include "identify/model/model.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Do the matrices leave every state where it is? Their noise is not looked at.
bool states_stay(const LinearModel& model);

/// Does no state of this model move, and is none disturbed or unknown at the start? Outputs are then
/// functions of the row's inputs and the parameters alone, and what follows from row to row is no
/// dynamics.
///
/// Example:
///
///     if (rows_have_no_order(model, model.parameters)) std::puts("a regression");
bool rows_have_no_order(const Model& model, const ParameterSet& at);

}  // namespace identikal
