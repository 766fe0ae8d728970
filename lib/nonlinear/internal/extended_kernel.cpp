#include "lib/nonlinear/internal/extended_kernel.h"

#include <algorithm>
#include <cmath>
#include <cstring>

// Instruction sets that add nothing here only take the compiler longer.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/nonlinear/internal/extended_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Pack before those that use it.
#include "lib/internal/lane_pack.h"
#include "lib/internal/lane_rows.h"
#include "lib/internal/lane_scores.h"

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// What lib/internal/lane_scores.h asks of a model.
struct SampleShape {
  int m, blocks, derivatives;
};

// The derivatives alone.
template <int W>
HWY_INLINE Pack<W> WithoutValue(Pack<W> a, int b) {
  if (b == 0) a.v[0] = hn::IfThenZeroElse(hn::FirstN(typename Pack<W>::Tag(), 1), a.v[0]);
  return a;
}
template <int W>
HWY_INLINE Pack<W> Derivatives(const double* at, int b) {
  return WithoutValue(Pack<W>::Load(at), b);
}

// How the curved slopes move with the directions, where the state moves as x does.
template <int W>
HWY_INLINE void MoveSlopes(const LaneSlopes& f, const LanePoint& p, const double* x, int n,
                           int blocks) {
  for (int b = 0; b < blocks; ++b) {
    for (int c = 0; c < f.curved; ++c) {
      Pack<W> sum = Pack<W>::Zero();
      for (int s = f.second_row[c]; s < f.second_row[c + 1]; ++s) {
        sum.Add(p.second[s], Pack<W>::Load(x + (b * n + f.second_by[s]) * W));
      }
      sum = WithoutValue(sum, b);
      sum.Add(Pack<W>::Load(p.by_p + (b * f.curved + c) * W));
      sum.Store(p.theta + (b * f.curved + c) * W);
    }
  }
}

// Number i of the formula, with the derivatives that it has where the state has those of x.
template <int W>
HWY_INLINE Pack<W> MoveValue(const LaneSlopes& f, const LanePoint& p, const double* x, int n, int b,
                             int i) {
  Pack<W> sum = Pack<W>::Zero();
  for (int e = f.row[i]; e < f.row[i + 1]; ++e) {
    sum.Add(p.slope[e], Pack<W>::Load(x + (b * n + f.column[e]) * W));
  }
  sum = WithoutValue(sum, b);
  sum.Add(Pack<W>::Load(p.value + (b * f.rows + i) * W));
  return sum;
}

// Adds the terms of entry o: `by` times numbers in lanes, `moved` times their values.
template <int W>
HWY_INLINE void AddTerms(const LaneTerms& terms, const LaneTerms& moved, const double* by,
                         const double* theta, const double* value, const double* from, int o,
                         Pack<W>& sum) {
  for (int at = terms.row[o]; at < terms.row[o + 1]; ++at) {
    sum.Add(by[terms.factor[at]], Pack<W>::Load(from + terms.in[at] * W));
  }
  for (int at = moved.row[o]; at < moved.row[o + 1]; ++at) {
    sum.Add(value[moved.in[at] * W], Pack<W>::Load(theta + moved.factor[at] * W));
  }
}

template <int W>
void FollowStageIn(const ExtendedModel& f, ExtendedRun& r, double weight, double reach,
                   bool is_first, bool state_alone) {
  const int n = f.n, all = n + f.Phi_entries + f.W_entries, at_W = n + f.Phi_entries;
  const double* const stage = is_first ? r.begin : r.stage;
  const LanePoint& p = r.f;
  if (!state_alone) MoveSlopes<W>(f.f, p, stage, all, f.blocks);
  for (int b = 0; b < f.blocks; ++b) {
    const double* const from = stage + b * all * W;
    const double* const theta = p.theta + b * f.f.curved * W;
    const double *begin = r.begin + b * all * W,
                 *before = (is_first ? r.begin : r.sum) + b * all * W;
    double *next = r.next_stage + b * all * W, *sum = r.sum + b * all * W;
    const auto put = [&](int o, const Pack<W>& rate) HWY_ATTR {
      Pack<W> to = Pack<W>::Load(before + o * W);
      to.Add(weight, rate);
      to.Store(sum + o * W);
      if (reach == 0.0) return;
      Pack<W> there = Pack<W>::Load(begin + o * W);
      there.Add(reach, rate);
      there.Store(next + o * W);
    };
    for (int i = 0; i < n; ++i) put(i, MoveValue<W>(f.f, p, stage, all, b, i));
    if (state_alone) continue;
    for (int o = 0; o < f.Phi_entries; ++o) {
      Pack<W> rate = Pack<W>::Zero();
      AddTerms<W>(f.Phi_terms, f.Phi_moved, p.slope, theta, stage + n * W, from + n * W, o, rate);
      put(n + o, rate);
    }
    for (int o = 0; o < f.W_entries; ++o) {
      Pack<W> rate = Pack<W>::Load(f.Q + (b * f.W_entries + o) * W);
      AddTerms<W>(f.W_terms, f.W_moved, p.slope, theta, stage + at_W * W, from + at_W * W, o, rate);
      put(at_W + o, rate);
    }
  }
  std::swap(r.stage, r.next_stage);
}

template <int W>
void MapStateIn(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, all = n + f.Phi_entries + f.W_entries;
  const LanePoint& p = r.f;
  MoveSlopes<W>(f.f, p, r.begin, all, f.blocks);
  for (int b = 0; b < f.blocks; ++b) {
    for (int i = 0; i < n; ++i) {
      MoveValue<W>(f.f, p, r.begin, all, b, i).Store(r.sum + (b * all + i) * W);
    }
    double* Phi = r.sum + (b * all + n) * W;
    for (int e = 0; e < f.Phi_entries; ++e) {
      (b == 0 ? Pack<W>::First(p.slope[e]) : Pack<W>::Zero()).Store(Phi + e * W);
    }
    for (int c = 0; c < f.f.curved; ++c) {
      Pack<W> moved = Pack<W>::Load(Phi + f.f.entry[c] * W);
      moved.Add(Pack<W>::Load(p.theta + (b * f.f.curved + c) * W));
      moved.Store(Phi + f.f.entry[c] * W);
    }
    std::memcpy(Phi + f.Phi_entries * W, r.begin + (b * all + n + f.Phi_entries) * W,
                sizeof(double) * static_cast<std::size_t>(f.W_entries * W));
  }
  std::swap(r.begin, r.sum);
}

// Row i of weights times a matrix: `column` says which of its rows each belongs to.
template <int W>
HWY_INLINE void MultiplyRow(const double* weights, const int* column, int count, const double* of,
                            int n, double* to) {
  Entries some;
  for (int at = 0; at < count; at += some.count) {
    some.count = std::min(kMostEntries, count - at);
    some.weight = weights + at;
    for (int q = 0; q < some.count; ++q) some.from[q] = of + column[at + q] * n * W;
    at == 0 ? WeighRows<W, false>(some, n, to) : WeighRows<W, true>(some, n, to);
  }
}

// += column j of a matrix times such a row's transpose, from the diagonal down.
template <int W>
HWY_INLINE void AddColumn(const double* weights, const int* column, int count, const double* of,
                          int n, int j, double* to) {
  Entries some;
  for (int at = 0; at < count; at += some.count) {
    some.count = std::min(kMostEntries, count - at);
    some.weight = weights + at;
    for (int q = 0; q < some.count; ++q) some.from[q] = of + column[at + q] * W;
    WeighColumns<W, false>(some, n, n, j, to, to);
  }
}

template <int W>
HWY_INLINE void MirrorLower(int n, double* of) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) Pack<W>::Load(of + (i * n + j) * W).Store(of + (j * n + i) * W);
  }
}

template <int W>
void PredictCovarianceIn(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, all = n + f.Phi_entries + f.W_entries, nn = n * n;
  for (int e = 0; e < f.Phi_entries; ++e) r.Phi_value[e] = r.begin[(n + e) * W];
  for (int b = 0; b < f.blocks; ++b) {
    const double* const Phi = r.begin + (b * all + n) * W;
    double* const T = r.T + b * nn * W;
    for (int i = 0; i < n; ++i) {
      double* const row = T + i * n * W;
      const int first = f.Phi_row[i];
      MultiplyRow<W>(r.Phi_value + first, f.Phi_column + first, f.Phi_row[i + 1] - first,
                     r.P + b * nn * W, n, row);
      for (int e = first; e < f.Phi_row[i + 1]; ++e) {
        if (!f.Phi_moves[e]) continue;
        const Pack<W> moved = Derivatives<W>(Phi + e * W, b);
        for (int j = 0; j < n; ++j) {
          Pack<W> sum = Pack<W>::Load(row + j * W);
          sum.Add(r.P[(f.Phi_column[e] * n + j) * W], moved);
          sum.Store(row + j * W);
        }
      }
    }
  }
  for (int b = 0; b < f.blocks; ++b) {
    const double* const Phi = r.begin + (b * all + n) * W;
    const double* const noise = Phi + f.Phi_entries * W;
    double* const next = r.next_P + b * nn * W;
    for (int j = 0; j < n; ++j) {
      for (int i = j; i < n; ++i) {
        const int w = f.W_index[i * n + j];
        (w < 0 ? Pack<W>::Zero() : Pack<W>::Load(noise + w * W)).Store(next + (i * n + j) * W);
      }
      const int first = f.Phi_row[j];
      AddColumn<W>(r.Phi_value + first, f.Phi_column + first, f.Phi_row[j + 1] - first,
                   r.T + b * nn * W, n, j, next);
      for (int e = first; e < f.Phi_row[j + 1]; ++e) {
        if (!f.Phi_moves[e]) continue;
        const Pack<W> moved = Derivatives<W>(Phi + e * W, b);
        for (int i = j; i < n; ++i) {
          Pack<W> sum = Pack<W>::Load(next + (i * n + j) * W);
          sum.Add(r.T[(i * n + f.Phi_column[e]) * W], moved);
          sum.Store(next + (i * n + j) * W);
        }
      }
    }
    MirrorLower<W>(n, next);
  }
  std::swap(r.P, r.next_P);
}

// M = P H' and Sigma = H M + R of the outputs that are there.
template <int W>
HWY_INLINE void SeeCovariance(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, m = r.m;
  const LaneSlopes& h = f.h;
  for (int b = 0; b < f.blocks; ++b) {
    const double *P = r.P + b * n * n * W, *theta = r.h.theta + b * h.curved * W;
    double *M = r.M + b * n * m * W, *Sigma = r.Sigma + b * m * m * W;
    for (int a = 0; a < m; ++a) {
      const int first = h.row[r.channel[a]], last = h.row[r.channel[a] + 1];
      for (int i = 0; i < n; ++i) {
        Pack<W> sum = Pack<W>::Zero();
        for (int e = first; e < last; ++e) {
          const int l = h.column[e] * n + i;
          sum.Add(r.h.slope[e], Pack<W>::Load(P + l * W));
          if (h.curved_of[e] >= 0) {
            sum.Add(r.P[l * W], Pack<W>::Load(theta + h.curved_of[e] * W));
          }
        }
        sum.Store(M + (i * m + a) * W);
      }
    }
    for (int a = 0; a < m; ++a) {
      const int first = h.row[r.channel[a]], last = h.row[r.channel[a] + 1];
      for (int c = 0; c <= a; ++c) {
        Pack<W> sum = Pack<W>::Load(f.R + ((b * f.ny + r.channel[a]) * f.ny + r.channel[c]) * W);
        for (int e = first; e < last; ++e) {
          const int l = h.column[e] * m + c;
          sum.Add(r.h.slope[e], Pack<W>::Load(M + l * W));
          if (h.curved_of[e] >= 0) {
            sum.Add(r.M[l * W], Pack<W>::Load(theta + h.curved_of[e] * W));
          }
        }
        sum.Store(Sigma + (a * m + c) * W);
        if (a != c) sum.Store(Sigma + (c * m + a) * W);
      }
    }
  }
}

// K = M Sigma^-1 by substitution; L is in r.work.
template <int W>
HWY_INLINE void FindGain(const ExtendedModel& f, ExtendedRun& r) {
  const int m = r.m;
  const double* const L = r.work;
  for (int i = 0; i < f.n; ++i) {
    double* const k = r.K + i * m;
    for (int a = 0; a < m; ++a) {
      k[a] = r.M[(i * m + a) * W];
      for (int c = 0; c < a; ++c) k[a] -= L[a * m + c] * k[c];
      k[a] *= r.L_inverse[a * m + a];
    }
    for (int a = m - 1; a >= 0; --a) {
      for (int c = a + 1; c < m; ++c) k[a] -= L[c * m + a] * k[c];
      k[a] *= r.L_inverse[a * m + a];
    }
  }
}

// e and its derivatives: h moves with xi, what is left of it with x.
template <int W>
HWY_INLINE void Innovate(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, m = r.m;
  const LaneSlopes& h = f.h;
  for (int b = 0; b < f.blocks; ++b) {
    for (int a = 0; a < m; ++a) {
      const int i = r.channel[a];
      // h - y, and h moved by x: what xi moves by itself cancels in the first order.
      Pack<W> sum = MoveValue<W>(h, r.h, r.x, n, b, i);
      for (int e = h.row[i]; r.xi != r.x && e < h.row[i + 1]; ++e) {
        const double away = r.x[h.column[e] * W] - r.xi[h.column[e] * W];
        if (b == 0) sum.Add(Pack<W>::First(r.h.slope[e] * away));
        if (h.curved_of[e] < 0) continue;
        sum.Add(away, Pack<W>::Load(r.h.theta + (b * h.curved + h.curved_of[e]) * W));
      }
      Pack<W> e = Pack<W>::Zero();
      e.Subtract(1.0, sum);
      e.Store(r.E + (b * m + a) * W);
    }
  }
}

template <int W>
HWY_INLINE void CorrectState(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, m = r.m;
  double* const q = r.work + m * m;  // m: de - dSigma Sigma^-1 e
  for (int b = 0; b < f.blocks; ++b) {
    const double *M = r.M + b * n * m * W, *Sigma = r.Sigma + b * m * m * W;
    for (int a = 0; a < m; ++a) {
      Pack<W> sum = Pack<W>::Load(r.E + (b * m + a) * W);
      for (int c = 0; c < m; ++c) {
        sum.Subtract(r.Sie[c], Pack<W>::Load(Sigma + (a * m + c) * W));
      }
      WithoutValue(sum, b).Store(q + a * W);
    }
    for (int i = 0; i < n; ++i) {
      Pack<W> sum = Pack<W>::Load(r.x + (b * n + i) * W);
      for (int a = 0; a < m; ++a) {
        sum.Add(r.Sie[a], Pack<W>::Load(M + (i * m + a) * W));
        sum.Add(r.K[i * m + a], Pack<W>::Load(q + a * W));
      }
      sum.Store(r.next_x + (b * n + i) * W);
    }
  }
}

template <int W>
SampleEnd InnovateIn(const ExtendedModel& f, ExtendedRun& r) {
  const SampleShape shape{r.m, f.blocks, f.derivatives};
  const int m = r.m;
  MoveSlopes<W>(f.h, r.h, r.xi, f.n, f.blocks);
  Innovate<W>(f, r);
  SeeCovariance<W>(f, r);
  for (int a = 0; a < m; ++a) {
    if (!std::isfinite(r.E[a * W])) return SampleEnd::not_finite;
    for (int c = 0; c <= a; ++c) {
      if (!std::isfinite(r.Sigma[(a * m + c) * W])) return SampleEnd::not_finite;
    }
  }
  if (!FactorSigma<W, 0>(shape, r)) return SampleEnd::indefinite;
  for (int a = 0; a < m; ++a) r.Sie[a] = 0.0;
  for (int a = 0; a < m; ++a) {
    double z = 0.0;
    for (int c = 0; c <= a; ++c) z += r.L_inverse[a * m + c] * r.E[c * W];
    r.white_e[a] = z;
    for (int c = 0; c <= a; ++c) r.Sie[c] += r.L_inverse[a * m + c] * z;
  }
  FindGain<W>(f, r);
  CorrectState<W>(f, r);
  return SampleEnd::done;
}

// T = I - K H, the entries that may differ from zero row by row: those of the states that the outputs
// see, and the diagonal.
HWY_INLINE void FindGains(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, m = r.m;
  std::fill_n(r.is_seen, n, false);
  for (int a = 0; a < m; ++a) {
    for (int e = f.h.row[r.channel[a]]; e < f.h.row[r.channel[a] + 1]; ++e) {
      r.is_seen[f.h.column[e]] = true;
    }
  }
  int count = 0;
  for (int i = 0; i < n; ++i) {
    r.gain_row[i] = count;
    for (int l = 0; l < n; ++l) {
      if (!r.is_seen[l] && l != i) continue;
      r.gain_at[l] = count;
      r.gain_column[count] = l;
      r.gains[count++] = l == i ? 1.0 : 0.0;
    }
    for (int a = 0; a < m; ++a) {
      for (int e = f.h.row[r.channel[a]]; e < f.h.row[r.channel[a] + 1]; ++e) {
        r.gains[r.gain_at[f.h.column[e]]] -= r.K[i * m + a] * r.h.slope[e];
      }
    }
  }
  r.gain_row[n] = count;
}

// dH P T' and K R of a block; T P is there.
template <int W>
HWY_INLINE void MoveGain(const ExtendedModel& f, ExtendedRun& r, int b) {
  const int n = f.n, m = r.m;
  for (int i = 0; i < n; ++i) {
    for (int a = 0; a < m; ++a) {
      Pack<W> moved = Pack<W>::Zero(), noise = Pack<W>::Zero();
      for (int e = f.h.row[r.channel[a]]; e < f.h.row[r.channel[a] + 1]; ++e) {
        if (f.h.curved_of[e] < 0) continue;
        moved.Add(r.T[(i * n + f.h.column[e]) * W],
                  Pack<W>::Load(r.h.theta + (b * f.h.curved + f.h.curved_of[e]) * W));
      }
      for (int c = f.diagonal_R ? a : 0; c < (f.diagonal_R ? a + 1 : m); ++c) {
        const int entry = (b * f.ny + r.channel[c]) * f.ny + r.channel[a];
        noise.Add(r.K[i * m + c], Pack<W>::Load(f.R + entry * W));
      }
      moved.Store(r.HX + (i * m + a) * W);
      noise.Store(r.KR + (i * m + a) * W);
    }
  }
}

template <int W>
void CorrectIn(const ExtendedModel& f, ExtendedRun& r) {
  const int n = f.n, m = r.m, nn = n * n;
  FindGains(f, r);
  const auto count = [&](int i) { return r.gain_row[i + 1] - r.gain_row[i]; };
  for (int b = 0; b < f.blocks; ++b) {
    double *const T = r.T + b * nn * W, *const next = r.next_P + b * nn * W;
    for (int i = 0; i < n; ++i) {
      const int first = r.gain_row[i];
      MultiplyRow<W>(r.gains + first, r.gain_column + first, count(i), r.P + b * nn * W, n,
                     T + i * n * W);
    }
    MoveGain<W>(f, r, b);
    for (int j = 0; j < n; ++j) {
      for (int i = j; i < n; ++i) {
        Pack<W> sum = Pack<W>::Zero();
        for (int a = 0; a < m; ++a) {
          sum.Add(r.K[j * m + a], Pack<W>::Load(r.KR + (i * m + a) * W));
          if (f.h.curved == 0) continue;
          sum.Subtract(r.K[i * m + a], Pack<W>::Load(r.HX + (j * m + a) * W));
          sum.Subtract(r.K[j * m + a], Pack<W>::Load(r.HX + (i * m + a) * W));
        }
        sum.Store(next + (i * n + j) * W);
      }
      AddColumn<W>(r.gains + r.gain_row[j], r.gain_column + r.gain_row[j], count(j), T, n, j, next);
    }
    MirrorLower<W>(n, next);
  }
  std::swap(r.P, r.next_P);
}

template <int W>
void AddSampleIn(const ExtendedModel& f, ExtendedRun& r) {
  const SampleShape shape{r.m, f.blocks, f.derivatives};
  for (int a = 0; a < r.m; ++a) r.squares += r.white_e[a] * r.white_e[a];
  if (f.derivatives == 0) return;
  AddScore<W, 0>(shape, r, true);
  AddInformation<W>(shape, r, r.m + r.m * (r.m + 1) / 2, 1.0);
}

void FollowStage(const ExtendedModel& f, ExtendedRun& r, double weight, double reach, bool is_first,
                 bool state_alone) {
  if (f.lanes == 4) return FollowStageIn<4>(f, r, weight, reach, is_first, state_alone);
  FollowStageIn<8>(f, r, weight, reach, is_first, state_alone);
}
void MapState(const ExtendedModel& f, ExtendedRun& r) {
  f.lanes == 4 ? MapStateIn<4>(f, r) : MapStateIn<8>(f, r);
}
void PredictCovariance(const ExtendedModel& f, ExtendedRun& r) {
  f.lanes == 4 ? PredictCovarianceIn<4>(f, r) : PredictCovarianceIn<8>(f, r);
}
SampleEnd InnovateLanes(const ExtendedModel& f, ExtendedRun& r) {
  return f.lanes == 4 ? InnovateIn<4>(f, r) : InnovateIn<8>(f, r);
}
void Correct(const ExtendedModel& f, ExtendedRun& r) {
  f.lanes == 4 ? CorrectIn<4>(f, r) : CorrectIn<8>(f, r);
}
void AddSample(const ExtendedModel& f, ExtendedRun& r) {
  f.lanes == 4 ? AddSampleIn<4>(f, r) : AddSampleIn<8>(f, r);
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "lib/internal/instruction_set.h"

namespace identikal::simd {

void follow_stage(const ExtendedModel& model, ExtendedRun& run, double weight, double reach,
                  bool is_first, bool state_alone) {
  IDENTIKAL_DISPATCH(FollowStage)(model, run, weight, reach, is_first, state_alone);
}

void map_state(const ExtendedModel& model, ExtendedRun& run) {
  IDENTIKAL_DISPATCH(MapState)(model, run);
}

void predict_covariance(const ExtendedModel& model, ExtendedRun& run) {
  IDENTIKAL_DISPATCH(PredictCovariance)(model, run);
}

SampleEnd innovate(const ExtendedModel& model, ExtendedRun& run) {
  return IDENTIKAL_DISPATCH(InnovateLanes)(model, run);
}

void correct(const ExtendedModel& model, ExtendedRun& run) {
  IDENTIKAL_DISPATCH(Correct)(model, run);
}

void add_sample(const ExtendedModel& model, ExtendedRun& run) {
  IDENTIKAL_DISPATCH(AddSample)(model, run);
}

}  // namespace identikal::simd
#endif
