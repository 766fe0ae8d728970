#include "identify/model/recording_nodes.h"

#include <utility>

#include "identify/model/late_inputs.h"

namespace identikal {
namespace {

InputNodes with_rest(InputNodes nodes, const Dataset& recording) {
  const Eigen::Index first = first_at_rest(recording);
  if (first < recording.size()) nodes.at_rest = first;
  return nodes;
}

}  // namespace

InputNodes recording_nodes(const FormulaModel& model, const ParameterSet& at,
                           const Dataset& recording, const std::vector<int>& steps) {
  return with_rest(
      input_nodes(recording.time, inputs_at(model, at, recording), model.inputs, steps), recording);
}

InputNodes controlled_recording_nodes(const FormulaModel& model, const ParameterSet& at,
                                      const Dataset& recording, double tolerance) {
  return with_rest(
      controlled_nodes(recording.time, inputs_at(model, at, recording), model.inputs, tolerance),
      recording);
}

}  // namespace identikal
