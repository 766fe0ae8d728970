#include "lib/simd_kernels.h"

#include <algorithm>

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

std::size_t padding() { return HWY_DYNAMIC_DISPATCH(Padding)(); }

}  // namespace identikal::simd
#endif
