// The few samples between outputs at different rates: where the covariance comes back to what it was,
// the gains of the last time serve again.
#include <algorithm>

#include "lib/filter/internal/tangent_filter.h"

namespace identikal {

using Eigen::Index;

// Does the covariance begin as it did, to 1e-13 of the standard deviations, and its derivatives to
// 1e-11 of their largest entry?
bool TangentFilter::comes_back(const Passage& passage) const {
  const double *P = run_.P, *before = passage.begin.data();
  const auto scale = [&](Index i, Index j) {
    return P[place(n_ * n_, i * n_ + i, 0)] * P[place(n_ * n_, j * n_ + j, 0)];
  };
  for (std::size_t l = 0; l <= derivatives_->size(); ++l) {
    double largest = 0.0, change = 0.0;  // squared, against the deviations
    for (Index i = 0; i < n_; ++i) {
      for (Index j = 0; j <= i; ++j) {
        const std::size_t at = place(n_ * n_, i * n_ + j, l);
        const double size = scale(i, j), moved = P[at] - before[at];
        if (moved == 0.0 && P[at] == 0.0) continue;
        if (!(size > 0.0)) return false;
        largest = std::max(largest, P[at] * P[at] / size);
        change = std::max(change, moved * moved / size);
      }
    }
    if (!(change <= (l == 0 ? 1e-26 : 1e-22) * largest)) return false;
  }
  return true;
}

std::size_t TangentFilter::gain_size(const Pattern& p) const {
  const auto n = static_cast<std::size_t>(n_), m = static_cast<std::size_t>(p.model.m);
  return (n * m + m * m) * lanes_ * blocks_ + n * m + 3 * m * m + static_cast<std::size_t>(ny_);
}

// copy(number kept, number in use, how many) of all that a sample's gain consists of.
template <typename Copy>
void TangentFilter::copy_gain(const Pattern& p, double* gain, Copy&& copy) {
  const auto n = static_cast<std::size_t>(n_), m = static_cast<std::size_t>(p.model.m);
  const std::size_t all = lanes_ * blocks_;
  const auto next = [&](double* used, std::size_t size) {
    copy(gain, used, size);
    gain += size;
  };
  next(run_.K_theta, n * m * all);
  next(run_.Sigma, m * m * all);
  next(run_.K, n * m);
  next(run_.L_inverse, m * m);
  next(run_.Sigma_inverse, m * m);
  next(run_.work, m * m);  // L
  next(e_sd_.data(), static_cast<std::size_t>(ny_));
}

// A few samples, with the gains of the last time where the covariance has come back.
FilterStatus TangentFilter::run_passage(Pattern& p, const TangentRecording& recording, Index& t,
                                        Index end, Likelihood& out) {
  if (p.passages.empty()) p.passages.resize(kLongestPassage + 1);
  Passage& passage = p.passages[static_cast<std::size_t>(end - t)];
  const std::size_t size = static_cast<std::size_t>(n_ * n_) * lanes_ * blocks_;
  const bool watched = recording.store != nullptr || recording.score_products != nullptr;
  const bool same = passage.known && comes_back(passage);
  p.in_vain = same ? 0 : p.in_vain + 1;
  if (!same) {
    passage.begin.assign(run_.P, run_.P + size);
    passage.gains.resize(gain_size(p) * static_cast<std::size_t>(end - t));
    passage.known = false;
  }
  double* gain = passage.gains.data();
  for (; t < end; gain += gain_size(p)) {
    if (same) {
      copy_gain(p, gain, [](const double* kept, double* used, std::size_t count) {
        std::copy(kept, kept + count, used);
      });
      simd::run_settled_tangents(p.model, run_, recording.y.data(), static_cast<int>(ny_),
                                 recording.u.data(), t, t + 1);
      samples_ += p.model.m;
      ++t;
    } else {
      if (step(p, recording, t, t + 1) == simd::TangentEnd::indefinite) {
        return FilterStatus::indefinite;
      }
      if (recording.store != nullptr) find_innovation_sd();
      copy_gain(p, gain, [](double* kept, const double* used, std::size_t count) {
        std::copy(used, used + count, kept);
      });
    }
    if (watched) leave_sample(p, recording, t - 1, out);
  }
  if (same) {
    std::copy(passage.end.begin(), passage.end.end(), run_.P);
  } else {
    passage.end.assign(run_.P, run_.P + size);
    passage.known = true;
  }
  return FilterStatus::ok;
}

}  // namespace identikal
