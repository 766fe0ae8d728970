#include "lib/simd_kernels.h"

#include <algorithm>
#include <iterator>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/simd_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::ScalableTag<double>;
using Vector = hn::Vec<Tag>;

// Longest run of products that is summed directly.
constexpr std::size_t kBlock = 1024;

// Lags first .. first + kVectors * Lanes - 1 of channels (i.., j), kRows channels i at a time. Lane
// l of a vector holds lag (its last lag - l), so that its samples lie contiguously in memory.
template <int kRows, int kVectors>
void block_of_lags(const double* const* rows, const double* column, std::size_t count,
                   std::size_t first, std::size_t lags, std::size_t row_stride,
                   std::size_t lag_stride, double* sums) {
  const Tag d;
  const std::size_t width = hn::Lanes(d);
  alignas(64) double lane[HWY_MAX_BYTES / sizeof(double)];
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t end = std::min(count, begin + kBlock);
    Vector acc[kRows][kVectors];
    for (int i = 0; i < kRows; ++i) {
      for (int v = 0; v < kVectors; ++v) acc[i][v] = hn::Zero(d);
    }
    const double* base = column - first - (width - 1);
    for (std::size_t t = begin; t < end; ++t) {
      Vector past[kVectors];
      for (int v = 0; v < kVectors; ++v) {
        past[v] = hn::LoadU(d, base + t - static_cast<std::size_t>(v) * width);
      }
      for (int i = 0; i < kRows; ++i) {
        const Vector now = hn::Set(d, rows[i][t]);
        for (int v = 0; v < kVectors; ++v) acc[i][v] = hn::MulAdd(now, past[v], acc[i][v]);
      }
    }
    for (int i = 0; i < kRows; ++i) {
      for (int v = 0; v < kVectors; ++v) {
        hn::Store(acc[i][v], d, lane);
        for (std::size_t l = 0; l < width; ++l) {
          const std::size_t m = static_cast<std::size_t>(v) * width + (width - 1 - l);
          if (m < lags) sums[m * lag_stride + static_cast<std::size_t>(i) * row_stride] += lane[l];
        }
      }
    }
  }
}

template <int kRows, int kVectors>
void all_lags(const double* const* rows, const double* column, std::size_t count, std::size_t first,
              std::size_t lags, std::size_t lag_stride, double* sums) {
  const std::size_t step = static_cast<std::size_t>(kVectors) * hn::Lanes(Tag());
  for (std::size_t m = 0; m < lags; m += step) {
    block_of_lags<kRows, kVectors>(rows, column, count, first + m, std::min(step, lags - m), 1,
                                   lag_stride, sums + m * lag_stride);
  }
}

void AddLagProducts(const double* const* z, std::size_t channels, std::size_t count,
                    std::size_t first_lag, std::size_t lags, double* sums) {
  const std::size_t lag_stride = channels * channels;
  // A stretch of the recording that stays in the cache meets all its lags before the next one.
  constexpr std::size_t kStretch = 2 * kBlock;
  for (std::size_t begin = 0; begin < count; begin += kStretch) {
    const std::size_t here = std::min(kStretch, count - begin);
    for (std::size_t j = 0; j < channels; ++j) {
      const double* column = z[j] + begin;
      std::size_t i = 0;
      while (i < channels) {
        const double* rows[3];
        const std::size_t left = std::min<std::size_t>(3, channels - i);
        for (std::size_t k = 0; k < left; ++k) rows[k] = z[i + k] + begin;
        double* to = sums + j * channels + i;
        if (left == 3) {
          all_lags<3, 3>(rows, column, here, first_lag, lags, lag_stride, to);
        } else if (left == 2) {
          all_lags<2, 5>(rows, column, here, first_lag, lags, lag_stride, to);
        } else {
          all_lags<1, 8>(rows, column, here, first_lag, lags, lag_stride, to);
        }
        i += left;
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

std::size_t Padding() { return 8 * hn::Lanes(Tag()); }

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace identikal::simd {

HWY_EXPORT(AddLagProducts);
HWY_EXPORT(Padding);

void add_lag_products(const double* const* z, std::size_t channels, std::size_t count,
                      std::size_t first_lag, std::size_t lags, double* sums) {
  HWY_DYNAMIC_DISPATCH(AddLagProducts)(z, channels, count, first_lag, lags, sums);
}

HWY_EXPORT(LaneCount);
HWY_EXPORT(SumSquaresInLanes);

std::size_t lanes() { return HWY_DYNAMIC_DISPATCH(LaneCount)(); }

void sum_squares_in_lanes(const LaneFilter& filter, const double* z, std::size_t length,
                          std::size_t warmup, std::size_t skip, double* x, double* squares) {
  HWY_DYNAMIC_DISPATCH(SumSquaresInLanes)(filter, z, length, warmup, skip, x, squares);
}

std::size_t padding() { return HWY_DYNAMIC_DISPATCH(Padding)(); }

}  // namespace identikal::simd
#endif
