// The gradient of the compressed likelihood: the adjoint of the equations in compressed_kernel.h,
// gone through from the last to the first. delta stands at a minimum, so it is held. Names say what
// a derivative is by: bar.F by F. Internal to the filter.
#pragma once

#include "lib/filter/internal/compressed_kernel.h"

namespace identikal {

/// What S_e and X owe to the sums and matrices that they are made of.
template <int n>
template <class Sums>
void CompressedKernel<n>::begin_adjoints(const Sums& Gamma_0, const Square& M_F, Adjoints& bar) {
  const SteadySolution<n>& f = filter_;
  Square half;
  set_product(bar.Kz, Kz_, Gamma_0);
  add_product(bar.Kz, f.F, Yt_);
  set_product(half, f.F, X_);
  add_product(half, Kz_, Yt_.transpose());
  set_product(work_, M_, bar.Kz);
  bar.Kz = 2.0 * work_;
  set_product(bar.F, M_, half, 2.0);
  set_product(bar.Yt, M_F.transpose(), Kz_);
  add_product(bar.Yt, CW_, H_, -1.0);
  bar.Yt *= 2.0;
  set_product(work_, X_, f.Ct);
  add_product(work_, Yt_, H_.transpose(), -1.0);
  set_product(bar.Ct, work_, f.Sigma_inverse, 2.0);
  set_product(small_, H_, Gamma_0);
  add_product(small_, f.Ct.transpose(), Yt_, -1.0);
  set_product(bar.H, f.Sigma_inverse, small_, 2.0);
}

/// Back through Horner's rule.
template <int n>
void CompressedKernel<n>::back_through_lags(const SegmentAutocovariances& sums,
                                            Adjoints& bar) const {
  Columns bar_T = bar.Yt, moved;
  moved.resize(model_->states(), channels_);
  for (Eigen::Index lag = 1; lag < lags_; ++lag) {
    const auto Gamma = sums.at(lag);
    for (Eigen::Index c = 0; c < channels_; ++c) {
      add_product(bar.F, bar_T.col(c), T_.col((lag + 1) * channels_ + c).transpose());
      for (Eigen::Index j = 0; j < channels_; ++j) bar.Kz.col(j) += Gamma(c, j) * bar_T.col(c);
      set_product(moved.col(c), filter_.F.transpose(), bar_T.col(c));
    }
    bar_T.swap(moved);
  }
}

/// Back through F^t x0.
template <int n>
void CompressedKernel<n>::back_through_first_states(const SegmentAutocovariances& sums,
                                                    Adjoints& bar) const {
  State bar_x = State::Zero(model_->states()), next;
  for (Eigen::Index t = memory() - 1; t >= 0; --t) {
    add_product(bar.F, bar_x, head_.col(t).transpose());
    set_product(next, filter_.F.transpose(), bar_x);
    for (Eigen::Index c = 0; c < channels_; ++c) next += sums.sample(c, t) * bar.Yt.col(c);
    bar_x = next;
  }
  bar.x0 = bar_x;
  add_product(bar.x0, M_, x0_, 2.0);
}

/// Back through the state behind the last sample.
template <int n>
void CompressedKernel<n>::back_through_last_states(const SegmentAutocovariances& sums,
                                                   Adjoints& bar) const {
  const Eigen::Index L = memory(), N = sums.samples();
  State bar_x, next;
  set_product(bar_x, M_, xN_, -2.0);
  for (Eigen::Index t = L - 1; t >= 0; --t) {
    add_product(bar.F, bar_x, tail_.col(t).transpose());
    for (Eigen::Index c = 0; c < channels_; ++c) {
      bar.Kz.col(c) += sums.sample(c, N - L + t) * bar_x;
    }
    set_product(next, filter_.F.transpose(), bar_x);
    bar_x = next;
  }
}

/// The determinant of the start, through M = F' M F + C' Sigma^-1 C, and N log|Sigma|.
template <int n>
void CompressedKernel<n>::back_through_determinants(double samples, const Square& M_F,
                                                    Adjoints& bar) {
  const SteadySolution<n>& f = filter_;
  Square N_start = Z_, half;
  f.powers.sum_forward(N_start);
  set_product(half, M_F, N_start);
  bar.F += 2.0 * half;
  set_product(work_, N_start, f.Ct);
  add_product(bar.Ct, work_, f.Sigma_inverse, 2.0);
  set_product(small_, f.Ct.transpose(), work_);
  small_ += S_e_;
  set_product(SiSeSi_, f.Sigma_inverse, small_);
  set_product(bar.Sigma, SiSeSi_, f.Sigma_inverse, -1.0);
  bar.Sigma += samples * f.Sigma_inverse;
}

/// Back through F = A - K C, Kz = [K, B - K D], H = [I, -D], and a mean that was taken out.
template <int n>
void CompressedKernel<n>::back_through_gain(const Segment& segment, Adjoints& bar) const {
  const Eigen::Index ny = model_->outputs(), nu = nominal_ != nullptr ? 0 : model_->inputs();
  if (nominal_ == nullptr && segment.mean.size() > 0) {
    const auto last = channels_ - 1;
    add_product(bar.Kz.leftCols(last), bar.Kz.col(last), segment.mean.transpose());
    add_product(bar.H.leftCols(last), bar.H.col(last), segment.mean.transpose());
  }
  bar.K = bar.Kz.leftCols(ny);
  add_product(bar.K, bar.F, filter_.Ct, -1.0);
  add_product(bar.Ct, bar.F.transpose(), filter_.K, -1.0);
  if (nu > 0) add_product(bar.K, bar.Kz.middleCols(ny, nu), model_->D.transpose(), -1.0);
}

template <int n>
void CompressedKernel<n>::back_through_start(const SegmentStart<n>& start, Adjoints& bar) const {
  if (start.kind == InitialState::diffuse) return;
  set_product(bar.P0, M_, inverse_);
  symmetrise(bar.P0);
  add_product(bar.P0, v_, v_.transpose(), -1.0);
  if (start.kind == InitialState::stationary) {
    bar.Lambda = bar.P0;
    open_loop_.sum_backward(bar.Lambda);
  }
}

/// The derivative of -2 log L by parameter i.
template <int n>
double CompressedKernel<n>::derivative(std::size_t i, const SegmentStart<n>& start,
                                       const Adjoints& bar) {
  const Eigen::Index ny = model_->outputs(), nu = model_->inputs();
  const Direction& d = directions_[i];
  const StateSpace& by = (*derivatives_)[i];
  double sum = inner_product(bar.Sigma, d.Sigma) + inner_product(bar.K, d.K);
  if (d.dynamics) {
    sum += inner_product(bar.F, by.A) + inner_product(bar.Ct, by.C.transpose());
    if (nu > 0) {
      const auto bar_Ku = bar.Kz.middleCols(ny, nu);
      sum += inner_product(bar_Ku, by.B);
      set_product(small_, filter_.K.transpose(), bar_Ku);
      small_ += bar.H.middleCols(ny, nu);
      sum -= inner_product(small_, by.D);
    }
  }
  if (start.kind == InitialState::stationary) {
    sum += inner_product(bar.Lambda, d.W) - bar.P0.cwiseProduct(d.P).sum();
    if (d.dynamics) {
      Square half, both;
      set_product(half, by.A, start.P);
      set_product(both, half, filter_.A.transpose());
      sum += 2.0 * inner_product(bar.Lambda, both);
    }
  } else if (start.kind == InitialState::given) {
    sum += bar.P0.cwiseProduct(start.P_theta[i]).sum() - bar.P0.cwiseProduct(d.P).sum() +
           bar.x0.dot(start.mean_theta[i]);
  }
  return sum;
}

template <int n>
void CompressedKernel<n>::add_gradient(const Segment& segment, const SegmentStart<n>& start,
                                       Likelihood& out) {
  const SegmentAutocovariances& sums = *sums_;
  Square M_F;
  set_product(M_F, M_, filter_.F);
  Adjoints bar;
  begin_adjoints(sums.at(0), M_F, bar);
  back_through_lags(sums, bar);
  back_through_first_states(sums, bar);
  back_through_last_states(sums, bar);
  back_through_determinants(static_cast<double>(sums.samples()), M_F, bar);
  back_through_gain(segment, bar);
  back_through_start(start, bar);
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    out.gradient[i] -= 0.5 * derivative(i, start, bar);
  }
}

}  // namespace identikal
