#include "lib/nonlinear/internal/scaled_noise.h"

namespace identikal {

using Eigen::Index;
using Eigen::VectorXd;

ScaledNoise::ScaledNoise(const NonlinearFilterOptions& options, const Eigen::Ref<const VectorXd>& p,
                         const FilterNoise& noise, const std::vector<FilterDirection>& directions)
    : options_(options), noise_(noise), directions_(directions) {
  if (options.scales == nullptr) return;
  chain_.emplace(*options.scales, directions);
  memory_ = make_memory(*options.scales);
  set_parameters(*options.scales, memory_, p);
}

bool ScaledNoise::multiply_by_formulas(const VectorXd& x, const Stack& dx,
                                       const Eigen::Ref<const VectorXd>& u, double time) {
  VectorXd by(scale_.size());
  observe(*options_.scales, memory_, x, u, time, by, slopes_);
  if (!(by.array() > 0.0).all() || !by.allFinite()) return false;
  chain_->add(slopes_.wrt_x, slopes_.wrt_p, dx, dscale_);
  for (Index a = 0; a < by.size(); ++a) dscale_.row(a) *= scale_[a];
  scale_ = scale_.cwiseProduct(by);
  return true;
}

FilterStatus ScaledNoise::set(Index t, const VectorXd& x, const Stack& dx,
                              const Eigen::Ref<const VectorXd>& u, double time, Eigen::MatrixXd& R,
                              Stack& dR) {
  const Index ny = noise_.R.rows(), k = static_cast<Index>(directions_.size());
  scale_.setOnes(ny);
  if (options_.noise_scale.size() > 0) scale_ = options_.noise_scale.col(t);
  dscale_.setZero(ny, k);
  if (chain_ && !multiply_by_formulas(x, dx, u, time)) return FilterStatus::indefinite;
  for (Index b = 0; b < ny; ++b) {
    for (Index a = 0; a < ny; ++a) {
      const Index entry = a + ny * b;
      const double written = noise_.R(a, b), factor = scale_[a] * scale_[b];
      R(a, b) = written * factor;
      for (Index i = 0; i < k; ++i) {
        dR(entry, i) = factor * directions_[static_cast<std::size_t>(i)].noise.R(a, b);
      }
      if (k == 0) continue;
      add_row(dR, entry, written * scale_[b], dscale_, a);
      add_row(dR, entry, written * scale_[a], dscale_, b);
    }
  }
  return FilterStatus::ok;
}

}  // namespace identikal
