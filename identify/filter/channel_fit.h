// How well do predictions follow what was measured?
#pragma once

#include <Eigen/Core>

#include "identify/estimate/recording_fit.h"
#include "lib/data/dataset.h"

namespace identikal {

/// How well predictions follow an output. @param y  SI  @param e  y less what was predicted; NaN =
/// missing
///
/// Example:
///
///     const Dataset& drive = recordings[0];
///     const Eigen::VectorXd measured = drive.y.row(0);
///     const Eigen::VectorXd e = measured.array() - measured.mean();
///     const auto fit = channel_fit(drive.outputs[0], measured, e);  // 0 %: the mean says nothing
ChannelFit channel_fit(const Channel& output, const Eigen::VectorXd& y, const Eigen::VectorXd& e);

}  // namespace identikal
