// What does every sample leave to those who ask: innovations, products of scores, the state behind it?
#include <cmath>

#include "lib/base/constants.h"
#include "lib/filter/internal/tangent_filter.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The covariance before the last sample has not been overwritten yet.
void TangentFilter::find_innovation_sd() {
  const MatrixXd& C = model_->C;
  for (Index i = 0; i < ny_; ++i) {
    double variance = model_->R(i, i);
    for (Index j = 0; j < n_; ++j) {
      if (C(i, j) == 0.0) continue;
      for (Index k = 0; k < n_; ++k) {
        if (C(i, k) == 0.0) continue;
        variance += C(i, j) * C(i, k) * run_.next_P[place(n_ * n_, j * n_ + k, 0)];
      }
    }
    e_sd_[i] = std::sqrt(variance);
  }
}

void TangentFilter::leave_sample(const Pattern& p, const TangentRecording& recording, Index t,
                                 const Likelihood& out) {
  const auto m = static_cast<std::size_t>(p.model.m);
  if (FilterResult* store = recording.store) {
    store->e_sd.col(t) = e_sd_;
    store->e.col(t).setConstant(kNaN);
    store->standardised.col(t).setConstant(kNaN);
    for (std::size_t a = 0; a < m; ++a) {
      double z = 0.0;
      for (std::size_t c = 0; c <= a; ++c) z += run_.L_inverse[a * m + c] * run_.E[c * lanes_];
      store->e(p.model.channel[a], t) = run_.E[a * lanes_];
      store->standardised(p.model.channel[a], t) = z;
    }
  }
  add_score_product(recording, out);
}

// Of what has been added to the gradient since the last time.
void TangentFilter::add_score_product(const TangentRecording& recording, const Likelihood& out) {
  if (recording.score_products == nullptr) return;
  VectorXd now = out.gradient;
  for (Index i = 0; i < now.size(); ++i) now[i] += run_.gradient[i + 1];
  const VectorXd score = now - scored_;
  *recording.score_products += score * score.transpose();
  scored_ = now;
}

// What was before the last sample has not been overwritten yet; a covariance that has settled is that
// of the sample before.
void TangentFilter::show_filtered(const Pattern& p, Index t, bool settled,
                                  const FilteredStateWatcher& see) {
  if (!settled) filtered_.take_covariance(p.model, run_, run_.next_P);
  filtered_.take_state(p.model, run_, run_.next_x);
  filtered_.state().t = t;
  see(filtered_.state());
}

}  // namespace identikal
