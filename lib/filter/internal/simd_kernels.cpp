#include "lib/filter/internal/simd_kernels.h"

#include <algorithm>
#include <iterator>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/filter/internal/simd_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::ScalableTag<double>;
using Vector = hn::Vec<Tag>;

// Longest run that is summed before it is added to the totals: it stays in the nearest cache.
constexpr std::size_t kRun = 4096;
// Accumulators that fit the registers beside what they are fed with.
constexpr int kAccumulators = HWY_TARGET <= HWY_AVX3 ? 24 : 12;

// Products of kColumns channels, a vector of consecutive samples each, with single samples of one
// other channel: accumulator a, lane l sums now(p + first + a) past(p + l) over vectors p, that is
// lag first + a - l. Only the past is read as a vector, and always aligned with the run.
template <int kColumns>
void SumProducts(const double* now, const double* const* past, std::size_t count, long first,
                 std::size_t lags, std::size_t column_stride, std::size_t lag_stride,
                 double* sums) {
  constexpr int kDeep = kAccumulators / kColumns;
  const Tag d;
  const std::size_t width = hn::Lanes(d);
  Vector sum[kColumns][kDeep];
  for (auto& column : sum) {
    for (Vector& s : column) s = hn::Zero(d);
  }
  std::size_t p = 0;
  if constexpr (kColumns == 1) {
    // Two vectors share their single samples: loading those would take longer than the products.
    constexpr int kWidth = hn::MaxLanes(d);
    for (; p + 2 * width <= count; p += 2 * width) {
      const Vector then = hn::LoadU(d, past[0] + p), later = hn::LoadU(d, past[0] + p + width);
      const double* at = now + static_cast<long>(p) + first;
#pragma GCC unroll 64
      for (int a = 0; a < kDeep + kWidth; ++a) {
        const Vector here = hn::Set(d, at[a]);
        if (a < kDeep) sum[0][a] = hn::MulAdd(here, then, sum[0][a]);
        if (a >= kWidth) sum[0][a - kWidth] = hn::MulAdd(here, later, sum[0][a - kWidth]);
      }
    }
  }
  for (; p < count; p += width) {
    Vector then[kColumns];
    for (int c = 0; c < kColumns; ++c) then[c] = hn::LoadU(d, past[c] + p);
    const double* at = now + static_cast<long>(p) + first;
    for (int a = 0; a < kDeep; ++a) {
      const Vector here = hn::Set(d, at[a]);
      for (int c = 0; c < kColumns; ++c) sum[c][a] = hn::MulAdd(here, then[c], sum[c][a]);
    }
  }
  alignas(64) double lane[HWY_MAX_BYTES / sizeof(double)];
  for (int c = 0; c < kColumns; ++c) {
    for (int a = 0; a < kDeep; ++a) {
      hn::Store(sum[c][a], d, lane);
      for (std::size_t l = 0; l < width; ++l) {
        const long lag = first + a - static_cast<long>(l);
        if (lag < 0 || lag >= static_cast<long>(lags)) continue;
        sums[static_cast<std::size_t>(lag) * lag_stride +
             static_cast<std::size_t>(c) * column_stride] += lane[l];
      }
    }
  }
}

template <int kColumns>
void SumLags(const double* now, const double* const* past, std::size_t count, std::size_t lags,
             std::size_t column_stride, std::size_t lag_stride, double* sums) {
  const auto end = static_cast<long>(lags + hn::Lanes(Tag()) - 1);
  for (long first = 0; first < end; first += kAccumulators / kColumns) {
    SumProducts<kColumns>(now, past, count, first, lags, column_stride, lag_stride, sums);
  }
}

void AddAutocovarianceSums(const double* const* z, std::size_t channels, std::size_t count,
                           std::size_t first_lag, std::size_t lags, double* sums) {
  const std::size_t column_stride = channels, lag_stride = channels * channels;
  for (std::size_t begin = 0; begin < count; begin += kRun) {
    const std::size_t here = std::min(kRun, count - begin);
    for (std::size_t i = 0; i < channels; ++i) {
      const double* now = z[i] + begin + first_lag;
      for (std::size_t j = 0; j < channels; j += 3) {
        const double* past[3];
        const std::size_t columns = std::min<std::size_t>(3, channels - j);
        for (std::size_t c = 0; c < columns; ++c) past[c] = z[j + c] + begin;
        double* to = sums + j * column_stride + i;
        if (columns == 3) SumLags<3>(now, past, here, lags, column_stride, lag_stride, to);
        if (columns == 2) SumLags<2>(now, past, here, lags, column_stride, lag_stride, to);
        if (columns == 1) SumLags<1>(now, past, here, lags, column_stride, lag_stride, to);
      }
    }
  }
}

// Two vectors of chunks: the chain from one state to the next leaves room for both.
constexpr std::size_t kVectors = 2;

std::size_t LaneCount() { return kVectors * hn::Lanes(Tag()); }

template <int n, int r>
void SumSquares(const LaneFilter& f, const double* z, std::size_t length, std::size_t warmup,
                std::size_t skip, double* state, double* squares) {
  const Tag d;
  const std::size_t width = hn::Lanes(d), lanes = kVectors * width;
  Vector x[kVectors][n], sum[kVectors][r * (r + 1) / 2];
  for (std::size_t u = 0; u < kVectors; ++u) {
    for (int i = 0; i < n; ++i) x[u][i] = hn::Zero(d);
    for (auto& s : sum[u]) s = hn::Zero(d);
  }
  // kSum: 0 not, 1 all chunks but the first, 2 all chunks. kShift: each lane reads its neighbour's
  // chunk.
  const auto run = [&]<int kSum, int kShift>(std::size_t from, std::size_t to) HWY_ATTR {
    const auto not_first = hn::Not(hn::FirstN(d, 1));
    for (std::size_t s = from; s < to; ++s) {
      const double* row = z + s * r * lanes - kShift;
      for (std::size_t u = 0; u < kVectors; ++u) {
        Vector y[r], e[r], next[n];
        for (int j = 0; j < r; ++j) {
          y[j] = hn::LoadU(d, row + static_cast<std::size_t>(j) * lanes + u * width);
        }
        for (int i = 0; i < n; ++i) {
          next[i] = hn::Mul(hn::Set(d, f.K[i]), y[0]);
          for (int j = 1; j < r; ++j) {
            next[i] = hn::MulAdd(hn::Set(d, f.K[j * n + i]), y[j], next[i]);
          }
          for (int k = 0; k < n; ++k) {
            next[i] = hn::MulAdd(hn::Set(d, f.F[k * n + i]), x[u][k], next[i]);
          }
        }
        if constexpr (kSum > 0) {
          for (int j = 0; j < r; ++j) {
            e[j] = y[j];
            for (int k = 0; k < n; ++k) {
              e[j] = hn::NegMulAdd(hn::Set(d, f.C[k * r + j]), x[u][k], e[j]);
            }
            if (kSum == 1 && u == 0) e[j] = hn::IfThenElseZero(not_first, e[j]);
          }
          int at = 0;
          for (int j = 0; j < r; ++j) {
            for (int k = 0; k <= j; ++k, ++at) sum[u][at] = hn::MulAdd(e[j], e[k], sum[u][at]);
          }
        }
        for (int i = 0; i < n; ++i) x[u][i] = next[i];
      }
    }
  };
  run.template operator()<0, 1>(length - warmup, length);
  run.template operator()<1, 0>(0, skip);
  const auto first = hn::FirstN(d, 1);
  for (int i = 0; i < n; ++i) x[0][i] = hn::IfThenElse(first, hn::Set(d, state[i]), x[0][i]);
  run.template operator()<2, 0>(skip, length);

  alignas(64) double lane[HWY_MAX_BYTES / sizeof(double)];
  for (int i = 0; i < n; ++i) {
    hn::Store(x[kVectors - 1][i], d, lane);
    state[i] = lane[width - 1];
  }
  int at = 0;
  for (int j = 0; j < r; ++j) {
    for (int k = 0; k <= j; ++k, ++at) {
      double total = 0.0;
      for (std::size_t u = 0; u < kVectors; ++u)
        total += hn::GetLane(hn::SumOfLanes(d, sum[u][at]));
      squares[k * r + j] = squares[j * r + k] = total;
    }
  }
}

template <int n>
void SumSquaresOf(const LaneFilter& f, const double* z, std::size_t length, std::size_t warmup,
                  std::size_t skip, double* x, double* squares) {
  if (f.outputs == 1) SumSquares<n, 1>(f, z, length, warmup, skip, x, squares);
  if (f.outputs == 2) SumSquares<n, 2>(f, z, length, warmup, skip, x, squares);
  if (f.outputs == 3) SumSquares<n, 3>(f, z, length, warmup, skip, x, squares);
}

void SumSquaresInLanes(const LaneFilter& f, const double* z, std::size_t length, std::size_t warmup,
                       std::size_t skip, double* x, double* squares) {
  constexpr void (*kBy[])(const LaneFilter&, const double*, std::size_t, std::size_t, std::size_t,
                          double*, double*) = {SumSquaresOf<1>, SumSquaresOf<2>, SumSquaresOf<3>,
                                               SumSquaresOf<4>, SumSquaresOf<5>, SumSquaresOf<6>,
                                               SumSquaresOf<7>, SumSquaresOf<8>};
  static_assert(std::size(kBy) == kMostLaneStates && kMostLaneOutputs == 3);
  kBy[f.states - 1](f, z, length, warmup, skip, x, squares);
}

std::size_t Padding() { return kAccumulators + 2 * hn::Lanes(Tag()); }

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "lib/internal/instruction_set.h"

namespace identikal::simd {

void add_autocovariance_sums(const double* const* z, std::size_t channels, std::size_t count,
                             std::size_t first_lag, std::size_t lags, double* sums) {
  IDENTIKAL_DISPATCH(AddAutocovarianceSums)(z, channels, count, first_lag, lags, sums);
}

std::size_t lanes() { return IDENTIKAL_DISPATCH(LaneCount)(); }

void sum_squares_in_lanes(const LaneFilter& filter, const double* z, std::size_t length,
                          std::size_t warmup, std::size_t skip, double* x, double* squares) {
  IDENTIKAL_DISPATCH(SumSquaresInLanes)(filter, z, length, warmup, skip, x, squares);
}

std::size_t padding() { return IDENTIKAL_DISPATCH(Padding)(); }

}  // namespace identikal::simd
#endif
