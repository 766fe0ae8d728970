// Which level do the outputs of a model move around?
#pragma once

#include <Eigen/Core>

#include "identify/black_box/internal/scaled_recordings.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// What is to be taken off the outputs for innovations without a mean; zero where predictions follow any level, as those
/// of an integrator do.
Eigen::VectorXd level_of(const InnovationForm& model, const ScaledRecordings& recordings,
                         Eigen::Index lags);

}  // namespace identikal
