// How well do predictions follow what was measured?
#pragma once

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "lib/data/dataset.h"

namespace identikal {

/// How well predictions follow an output. @param y  SI  @param e  y less what was predicted; NaN =
/// missing
ChannelFit channel_fit(const Channel& output, const Eigen::VectorXd& y, const Eigen::VectorXd& e);

}  // namespace identikal
