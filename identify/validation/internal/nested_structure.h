// Is a model that knows a few parameters more otherwise the same model?
#pragma once

#include "identify/result/file.h"

namespace identikal {

enum class NestedStructure {
  same,     ///< with the known values in, the larger model is the smaller one
  other,    ///< it is not
  unknown,  ///< a result without its model file, or states of another number: nothing to compare by
};

/// Whether the larger result's model becomes the smaller one's at the smaller one's parameters, 0
/// for those that it has not: matrices to 1e-9 of their size; formulas by their values at random
/// states and inputs; a built-in vehicle by its channels, sensors and tyres, where a straight tyre
/// is a curve whose largest force is infinite.
/// @param small, large  of the same outputs
NestedStructure structure_at(const StoredResult& small, const StoredResult& large);

}  // namespace identikal
