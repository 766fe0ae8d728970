#include "identify/vehicle/internal/block_tridiagonal.h"

#include <cmath>

#include "lib/base/constants.h"

namespace identikal {

BlockTridiagonal::BlockTridiagonal(Eigen::Index rows, Eigen::Index parameters)
    : blocks_(static_cast<std::size_t>(rows)) {
  for (Block& block : blocks_) block.G.setZero(2, parameters);
}

void BlockTridiagonal::add(Eigen::Index t, const Transition& step, MarginalQuadratic& rest) {
  Block &before = blocks_[t - 1], &now = blocks_[t];
  before.H += step.from.transpose() * step.from;
  before.U = step.from.transpose() * step.to;
  before.G += step.from.transpose() * step.by;
  before.g += step.from.transpose() * step.r;
  now.H += step.to.transpose() * step.to;
  now.G += step.to.transpose() * step.by;
  now.g += step.to.transpose() * step.r;
  rest.information += step.by.transpose() * step.by;
  rest.gradient += step.by.transpose() * step.r;
}

void BlockTridiagonal::add(Eigen::Index t, const Sample& sample, MarginalQuadratic& rest) {
  Block& now = blocks_[t];
  now.H += sample.slope * sample.slope.transpose();
  now.G += sample.slope * sample.by;
  now.g += sample.r * sample.slope;
  rest.information += sample.by.transpose() * sample.by;
  rest.gradient += sample.r * sample.by.transpose();
}

bool BlockTridiagonal::eliminate(const Eigen::Vector2d& state_scale, MarginalQuadratic& rest) {
  const double normal = 0.5 * kLogTwoPi;
  for (std::size_t t = 0; t < blocks_.size(); ++t) {
    Block& now = blocks_[t];
    if (t > 0) {
      const Block& before = blocks_[t - 1];
      const Eigen::Matrix2d back = before.U.transpose() * before.inverse;
      now.H -= back * before.U;
      now.G -= back * before.G;
      now.g -= back * before.g;
    }
    const double determinant = now.H.determinant();
    if (!(determinant > 0.0)) return false;
    now.inverse = now.H.inverse();
    rest.information -= now.G.transpose() * now.inverse * now.G;
    rest.gradient -= now.G.transpose() * now.inverse * now.g;
    rest.log_likelihood +=
        2.0 * normal + state_scale.array().log().sum() - 0.5 * std::log(determinant);
  }
  return true;
}

}  // namespace identikal
