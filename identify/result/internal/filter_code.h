// How does the filter of a nonlinear model read as a program?
#pragma once

#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/formula/tape_code.h"

namespace identikal {

/// Why there is no program; empty: there is one.
std::string why_no_filter_code(const Model& model, const std::string& method);

/// What the exported numbers are called, for the functions that use them.
struct FilterCodeNames {
  std::string prefix;                   ///< of all names; empty where they have a namespace
  std::vector<std::string> parameters;  ///< text of each of the equations' parameters
};

/// Functions of the equations with their derivatives, of the prediction to the next sample and of
/// the update by a measurement: an extended Kalman filter, as lib/nonlinear/filter.h has it.
/// Q, R, x0, P0 and, in continuous time, longest_step stand before it.
/// @param cpp  functions are `inline`, else `static inline`
std::string filter_in_c(const Model& model, const FilterCodeNames& names, bool cpp);
std::string filter_in_python(const Model& model, const FilterCodeNames& names);

}  // namespace identikal
