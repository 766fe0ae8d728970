#include "lib/filter/internal/tangent_filtered.h"

#include <algorithm>
#include <cstddef>

namespace identikal {

using simd::TangentModel;
using simd::TangentRun;

namespace {

// to[l] += by from[l] over the lanes, whose number the compiler knows.
template <int W>
void add(double by, const double* from, double* to) {
  for (int l = 0; l < W; ++l) to[l] += by * from[l];
}

}  // namespace

void FilteredTangents::take_covariance(const TangentModel& f, const TangentRun& r,
                                       const double* P) {
  const auto n = static_cast<std::size_t>(f.n), m = static_cast<std::size_t>(f.m),
             lanes = static_cast<std::size_t>(f.lanes);
  T_.resize(n * n * lanes);
  out_.resize(n * n * lanes);
  KR_.resize(n * m * lanes);
  moved_gain_.assign(n * m * lanes * static_cast<std::size_t>(f.blocks), 0.0);
  state_.P.resize(f.n, f.n);
  state_.dP.resize(f.n * f.n, f.derivatives);
  find_gain(f, r, P);
  if (f.C_theta != nullptr) find_rest_of_covariance(f, P);
  f.lanes == 4 ? find_blocks<4>(f, r, P) : find_blocks<8>(f, r, P);
}

template <int W>
void FilteredTangents::find_blocks(const TangentModel& f, const TangentRun& r, const double* P) {
  for (int b = 0; b < f.blocks; ++b) {
    find_block<W>(f, r, P + b * f.n * f.n * W, b);
    if (f.C_theta != nullptr) add_moved_outputs<W>(f, P, b);
    set_covariances<W>(f, b);
  }
  // What rounding leaves of P C' - Kf Sigma is no derivative.
  for (int at = 0; at < f.n * f.m; ++at) moved_gain_[at * W] = 0.0;
}

// Kf and I - Kf C of the value, which stands in the first lanes.
void FilteredTangents::find_gain(const TangentModel& f, const TangentRun& r, const double* P) {
  const int n = f.n, m = f.m, W = f.lanes;
  Kf_.assign(static_cast<std::size_t>(n * m), 0.0);
  rest_.assign(static_cast<std::size_t>(n * n), 0.0);
  for (int i = 0; i < n; ++i) {
    rest_[i * n + i] = 1.0;
    for (int c = 0; c < m; ++c) {
      double PC = 0.0;
      for (int at = f.C_row[c]; at < f.C_row[c + 1]; ++at) {
        PC += f.C[at] * P[(i * n + f.C_column[at]) * W];
      }
      for (int a = 0; a < m; ++a) Kf_[i * m + a] += PC * r.Sigma_inverse[c * m + a];
    }
    for (int a = 0; a < m; ++a) {
      for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
        rest_[i * n + f.C_column[at]] -= Kf_[i * m + a] * f.C[at];
      }
    }
  }
}

// P (I - Kf C)' of the value.
void FilteredTangents::find_rest_of_covariance(const TangentModel& f, const double* P) {
  const int n = f.n;
  P_rest_.assign(static_cast<std::size_t>(n * n), 0.0);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      double& sum = P_rest_[i * n + j];
      for (int k = 0; k < n; ++k) sum += P[(i * n + k) * f.lanes] * rest_[j * n + k];
    }
  }
}

// moved_gain_ and (I - Kf C) P (I - Kf C)' + Kf R Kf' of a block, where C does not move.
template <int W>
void FilteredTangents::find_block(const TangentModel& f, const TangentRun& r, const double* P,
                                  int b) {
  const int n = f.n, m = f.m;
  const double *R = f.R + b * m * m * W, *Sigma = r.Sigma + b * m * m * W;
  double* moved = moved_gain_.data() + b * n * m * W;
  std::fill(T_.begin(), T_.end(), 0.0);
  std::fill(KR_.begin(), KR_.end(), 0.0);
  std::fill(out_.begin(), out_.end(), 0.0);
  for (int i = 0; i < n; ++i) {
    for (int a = 0; a < m; ++a) {
      for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
        add<W>(f.C[at], P + (i * n + f.C_column[at]) * W, moved + (i * m + a) * W);
      }
      for (int c = 0; c < m; ++c) {
        add<W>(-Kf_[i * m + c], Sigma + (c * m + a) * W, moved + (i * m + a) * W);
        add<W>(Kf_[i * m + c], R + (c * m + a) * W, KR_.data() + (i * m + a) * W);
      }
    }
    for (int k = 0; k < n; ++k) {
      if (rest_[i * n + k] == 0.0) continue;
      for (int j = 0; j < n; ++j) {
        add<W>(rest_[i * n + k], P + (k * n + j) * W, T_.data() + (i * n + j) * W);
      }
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double* to = out_.data() + (i * n + j) * W;
      for (int k = 0; k < n; ++k) add<W>(rest_[j * n + k], T_.data() + (i * n + k) * W, to);
      for (int a = 0; a < m; ++a) add<W>(Kf_[j * m + a], KR_.data() + (i * m + a) * W, to);
    }
  }
}

// What C's own derivatives add; those of the first lane are zero.
template <int W>
void FilteredTangents::add_moved_outputs(const TangentModel& f, const double* P, int b) {
  const int n = f.n, m = f.m;
  for (int a = 0; a < m; ++a) {
    for (int at = f.C_theta_row[a]; at < f.C_theta_row[a + 1]; ++at) {
      const int k = f.C_theta_column[at];
      const double* dC = f.C_theta + (b * f.C_theta_row[m] + at) * W;
      for (int i = 0; i < n; ++i) {
        add<W>(P[(i * n + k) * W], dC, moved_gain_.data() + ((b * n + i) * m + a) * W);
        for (int j = 0; j <= i; ++j) {
          double* to = out_.data() + (i * n + j) * W;
          add<W>(-Kf_[i * m + a] * P_rest_[k * n + j], dC, to);
          add<W>(-Kf_[j * m + a] * P_rest_[k * n + i], dC, to);
        }
      }
    }
  }
}

template <int W>
void FilteredTangents::set_covariances(const TangentModel& f, int b) {
  const int n = f.n;
  for (int l = 0; l < W && b * W + l <= f.derivatives; ++l) {
    double* to = b + l == 0 ? state_.P.data() : state_.dP.col(b * W + l - 1).data();
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) to[i * n + j] = to[j * n + i] = out_[(i * n + j) * W + l];
    }
  }
}

template <int W>
void FilteredTangents::find_state(const TangentModel& f, const TangentRun& r, const double* x) {
  const int n = f.n, m = f.m;
  for (int b = 0; b < f.blocks; ++b) {
    for (int i = 0; i < n; ++i) {
      double sum[W];
      std::copy_n(x + (b * n + i) * W, W, sum);
      for (int a = 0; a < m; ++a) {
        add<W>(Kf_[i * m + a], r.E + (b * m + a) * W, sum);
        add<W>(r.Sie[a], moved_gain_.data() + ((b * n + i) * m + a) * W, sum);
      }
      if (b == 0) state_.x[i] = sum[0];
      for (int l = b == 0 ? 1 : 0; l < W && b * W + l <= f.derivatives; ++l) {
        state_.dx(i, b * W + l - 1) = sum[l];
      }
    }
  }
}

void FilteredTangents::take_state(const TangentModel& f, const TangentRun& r, const double* x) {
  state_.x.resize(f.n);
  state_.dx.resize(f.n, f.derivatives);
  f.lanes == 4 ? find_state<4>(f, r, x) : find_state<8>(f, r, x);
}

}  // namespace identikal
