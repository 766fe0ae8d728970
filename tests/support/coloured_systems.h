// Systems with coloured noise: Matisko (2013), chapter 5.
#pragma once

#include <Eigen/Core>

#include "identify/model_file.h"
#include "identify/published_systems.h"
#include "identify/shaped_model.h"

namespace identikal {

/// (5.17).
inline ModelFile system_5_17() {
  return model_of({(Eigen::MatrixXd(2, 2) << 0.9, -0.8, 0.2, 0.8).finished(),
                   Eigen::Vector2d(0.1, 0.05), Eigen::RowVector2d(4.0, 0.1)},
                  1.0, 1.0);
}

/// (5.21), with its zero at -8 moved inside the unit circle, which leaves the spectrum's shape.
inline ShapingFilter filter_5_21() {
  return {Eigen::Vector2d(-0.6, 0.84), Eigen::VectorXd::Constant(1, 0.125)};
}

}  // namespace identikal
