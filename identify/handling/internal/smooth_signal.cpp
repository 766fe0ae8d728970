#include "identify/handling/internal/smooth_signal.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace identikal {

using Eigen::Index;

SmoothSignal::SmoothSignal(const Eigen::Ref<const Eigen::VectorXd>& time,
                           const Eigen::Ref<const Eigen::VectorXd>& x, double half_width)
    : time_(time), x_(x) {
  const Index N = time_.size();
  const double step = N > 1 ? (time_[N - 1] - time_[0]) / static_cast<double>(N - 1) : 1.0;
  half_width_ = std::max(half_width, 2.0 * step) + 0.01 * step;
  double squares = 0.0, freedom = 0.0;
  for (Index t = 0; t < N; ++t) {
    const LocalParabola here = at(time_[t]);
    if (std::isnan(x_[t]) || std::isnan(here.value)) continue;
    squares += (x_[t] - here.value) * (x_[t] - here.value);
    freedom += 1.0 - here.value_gain * here.value_gain;
  }
  if (freedom > 0.0) noise_sd_ = std::sqrt(squares / freedom);
}

LocalParabola SmoothSignal::at(double moment) const {
  const double* const begin = time_.data();
  const double* const end = begin + time_.size();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int samples = 0;
  // In units of the half width, or the moments would lie far apart.
  for (const double* t = std::lower_bound(begin, end, moment - half_width_);
       t != end && *t <= moment + half_width_; ++t) {
    const double x = x_[t - begin], s = (*t - moment) / half_width_;
    if (std::isnan(x)) continue;
    const Eigen::Vector3d powers(1.0, s, s * s);
    moments.noalias() += powers * powers.transpose();
    right += x * powers;
    ++samples;
  }
  if (samples < 4) return {};
  const Eigen::Matrix3d inverse = moments.llt().solve(Eigen::Matrix3d::Identity());
  const Eigen::Vector3d c = inverse * right;
  return {c[0], c[1] / half_width_, 2.0 * c[2] / (half_width_ * half_width_),
          std::sqrt(inverse(0, 0)), std::sqrt(inverse(1, 1)) / half_width_};
}

}  // namespace identikal
