// The information of the compressed likelihood, in the notation of compressed_kernel.h. On noise
// alone it is an expectation; on parameters of the dynamics delta is held, and what is lost because
// delta is not known is taken off: with s_i = sum_t F'^t C' Sigma^-1 de_i(t),
//
//   sum_t de_i' Sigma^-1 de_j - s_i' (I + Pi M)^-1 Pi s_j.
//
// Its sums of dx x' and dx dx' follow like X, with the products of the first dx added and those of
// the one behind the last sample taken off. Internal to the filter.
#pragma once

#include "lib/filter/internal/compressed_kernel.h"

namespace identikal {

inline void add_symmetric(Eigen::MatrixXd& to, std::size_t i, std::size_t j, double term) {
  const auto row = static_cast<Eigen::Index>(i), col = static_cast<Eigen::Index>(j);
  to(row, col) += term;
  if (row != col) to(col, row) += term;
}

/// Noise moves the filter by its gain alone: dx+ = F dx + dK e, so that the expectation
/// sum_t de_i' Sigma^-1 de_j is N tr(M dK_i Sigma dK_j'), whether or not A is stable.
template <int n>
void CompressedKernel<n>::add_noise_information(double samples, Likelihood& out) const {
  Columns MK, MKS;
  SmallMatrix half, relative;
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    set_product(MK, M_, directions_[i].K);
    set_product(MKS, MK, filter_.Sigma);
    set_product(half, filter_.Sigma_inverse, directions_[i].Sigma);
    set_product(relative, half, filter_.Sigma_inverse);
    for (std::size_t j = 0; j <= i; ++j) {
      add_symmetric(out.information, i, j,
                    samples * (0.5 * inner_product(relative, directions_[j].Sigma) +
                               inner_product(MKS, directions_[j].K)));
    }
  }
}

/// What dx owes to the start, dh+ = F dh + a F^t x0, does with z'; and s_i of the first
/// innovations.
template <int n>
void CompressedKernel<n>::follow_start(const Segment& segment, Response& r) {
  const SteadySolution<n>& f = filter_;
  const Eigen::Index L = memory();
  State dh = r.dx0, dx = r.dx0, next;
  for (Eigen::Index t = 0; t < L; ++t) {
    auto de = e_.col(t);
    set_product(de, f.Ct.transpose(), dx, -1.0);
    add_product(de, r.dC, first_.col(t), -1.0);
    set_product(next, f.F, dx);
    add_product(next, r.a, first_.col(t));
    for (Eigen::Index c = 0; c < channels_; ++c) {
      const double z = segment.sums.sample(c, t);
      r.dx_z.col(c) += z * dh;
      de += z * r.g.col(c);
      next += z * r.b.col(c);
    }
    dx = next;
    set_product(next, f.F, dh);
    add_product(next, r.a, head_.col(t));
    dh = next;
  }
  r.s.setZero(model_->states());
  for (Eigen::Index t = L - 1; t >= 0; --t) {
    set_product(next, f.F.transpose(), r.s);
    add_product(next, CW_, e_.col(t));
    r.s = next;
  }
}

/// The state over the first samples.
template <int n>
void CompressedKernel<n>::find_first_states(const SegmentAutocovariances& sums) {
  const Eigen::Index L = memory();
  first_.resize(model_->states(), std::max(L, first_.cols()));
  State x = x0_, next;
  for (Eigen::Index t = 0; t < L; ++t) {
    first_.col(t) = x;
    set_product(next, filter_.F, x);
    for (Eigen::Index c = 0; c < channels_; ++c) next += sums.sample(c, t) * Kz_.col(c);
    x = next;
  }
}

/// The response to parameter i, with its sums.
template <int n>
void CompressedKernel<n>::sum_response(std::size_t i, const Segment& segment,
                                       const SegmentStart<n>& start) {
  const SteadySolution<n>& f = filter_;
  const SegmentAutocovariances& sums = segment.sums;
  const auto Gamma_0 = sums.at(0);
  Columns next;
  Response& r = responses_[i];
  respond(i, segment, r);
  r.dx_z.setZero(model_->states(), channels_);
  for (Eigen::Index lag = lags_ - 1; lag > 0; --lag) {
    set_product(next, f.F, r.dx_z);
    add_product(next, r.a, T_.middleCols((lag + 1) * channels_, channels_));
    add_product(next, r.b, sums.at(lag).transpose());
    r.dx_z.swap(next);
  }
  r.dx0.setZero(model_->states());
  if (start.kind == InitialState::given) r.dx0 = start.mean_theta[i];
  follow_start(segment, r);
  r.dxN = last_response(r);
  // What drives dx, g = a x + b z, times x' and z'.
  set_product(r.g_x, r.a, X_);
  add_product(r.g_x, r.b, Yt_.transpose());
  set_product(r.g_z, r.a, Yt_);
  add_product(r.g_z, r.b, Gamma_0);
  set_product(r.dx_x, r.g_x, f.F.transpose());
  next = r.g_z;
  add_product(next, f.F, r.dx_z);
  add_product(r.dx_x, next, Kz_.transpose());
  add_product(r.dx_x, r.dx0, x0_.transpose());
  add_product(r.dx_x, r.dxN, xN_.transpose(), -1.0);
  f.powers.sum_forward(r.dx_x);
  // What c = g z - dC x, the direct effect on the innovation, does with x' and z'.
  set_product(r.c_x, r.g, Yt_.transpose());
  add_product(r.c_x, r.dC, X_, -1.0);
  set_product(r.c_z, r.g, Gamma_0);
  add_product(r.c_z, r.dC, Yt_, -1.0);
  // Weights of the sums above in tr(Sigma^-1 sum de de').
  set_product(r.M_a, M_, r.a);
  set_product(r.M_b, M_, r.b);
  set_product(r.W_g, f.Sigma_inverse, r.g);
  set_product(r.W_dC, f.Sigma_inverse, r.dC);
  set_product(r.on_dx_x, f.F.transpose(), r.M_a);
  add_product(r.on_dx_x, f.Ct, r.W_dC);
  set_product(r.on_dx_z, f.F.transpose(), r.M_b);
  add_product(r.on_dx_z, f.Ct, r.W_g, -1.0);
  set_product(small_, f.Sigma_inverse, directions_[i].Sigma);
  set_product(r.relative, small_, f.Sigma_inverse);
}

/// Parameters of the dynamics move the filter by what the states and inputs did in this segment:
/// sums of products with dx follow like X and Y.
template <int n>
void CompressedKernel<n>::add_full_information(const Segment& segment, const SegmentStart<n>& start,
                                               Likelihood& out) {
  const auto samples = static_cast<double>(segment.sums.samples());
  responses_.resize(directions_.size());
  find_first_states(segment.sums);
  for (std::size_t i = 0; i < directions_.size(); ++i) sum_response(i, segment, start);
  State M_dx0, M_dxN, Z_s;
  for (std::size_t i = 0; i < responses_.size(); ++i) {
    const Response& p = responses_[i];
    set_product(M_dx0, M_, p.dx0);
    set_product(M_dxN, M_, p.dxN);
    set_product(Z_s, Z_, p.s);
    for (std::size_t j = 0; j <= i; ++j) {
      const Response& q = responses_[j];
      add_symmetric(out.information, i, j,
                    inner_product(q.on_dx_x, p.dx_x) + inner_product(q.on_dx_z, p.dx_z) +
                        inner_product(p.on_dx_x, q.dx_x) + inner_product(p.on_dx_z, q.dx_z) +
                        inner_product(q.M_a, p.g_x) + inner_product(q.M_b, p.g_z) +
                        inner_product(q.W_g, p.c_z) - inner_product(q.W_dC, p.c_x) +
                        M_dx0.dot(q.dx0) - M_dxN.dot(q.dxN) - Z_s.dot(q.s) +
                        0.5 * samples * inner_product(p.relative, directions_[j].Sigma));
    }
  }
}

}  // namespace identikal
