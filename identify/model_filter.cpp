#include "identify/model_filter.h"

#include "identify/nonlinear_recordings.h"

namespace identikal {

FilterResult run_filter(const ModelFile& model, const ParameterSet& parameters,
                        const Dataset& recording, Keep keep) {
  if (model.form == ModelFile::Form::nonlinear) {
    return nonlinear_filter(model, parameters, recording, keep);
  }
  return kalman_filter(instantiate(model.linear, parameters), model.linear.initial, recording.y,
                       model_inputs(model.linear, recording.u), keep);
}

}  // namespace identikal
