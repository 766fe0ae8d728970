// What does a recorder write for a value of the model?
#pragma once

#include <string>

#include "identify/model/model.h"
#include "lib/data/units.h"

namespace identikal {

/// recorded = factor x + shift of a channel's value x [SI], in the column's unit: the inverse of `scale` and `offset` of its model
/// file, value = scale recorded + offset.
struct RecordedScale {
  double factor = 1.0, shift = 0.0;
};

/// @param unit  of the column
///
/// Example:
///
///     const RecordedScale to = recorded_scale(model.outputs[0], "degC");
///     const Eigen::VectorXd recorded = to.factor * y + Eigen::VectorXd::Constant(y.size(), to.shift);
inline RecordedScale recorded_scale(const ChannelSource& source, const std::string& unit) {
  const Unit of = unit_or_dimensionless(unit);
  return {1.0 / (of.scale * source.scale), -(of.offset / of.scale + source.offset) / source.scale};
}

}  // namespace identikal
