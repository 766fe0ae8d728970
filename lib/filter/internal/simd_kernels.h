// The two loops that run over every sample of a long recording, written for the widest vectors of
// the machine they run on. Raw pointers only: this file is compiled for several instruction sets,
// and nothing that another file might also instantiate may pass through it. Internal to the filter.
#pragma once

#include <cstddef>

namespace identikal::simd {

/// sums[((m - first_lag) * channels + j) * channels + i] += sum_{p=0}^{count-1} z_i(p + m) z_j(p)
/// for first_lag <= m < first_lag + lags, summed in runs, so that rounding grows with the square
/// root of count at most.
/// @param z      channels pointers to sample 0 of each channel; samples up to
///               count + first_lag + lags + padding() are read
/// @param count  a multiple of 16, or zeros follow
void add_autocovariance_sums(const double* const* z, std::size_t channels, std::size_t count,
                             std::size_t first_lag, std::size_t lags, double* sums);

/// How many samples behind the last product are read (and not used).
std::size_t padding();

/// Several chunks of a recording side by side: chunk c holds samples c T .. (c + 1) T - 1, and its
/// sample s of channel j stands at z[(s channels + j) lanes() + c].
std::size_t lanes();

inline constexpr int kMostLaneStates = 8, kMostLaneOutputs = 3;

/// A filter with constant gain over all chunks at once: x+ = F x + K y, e = y - C x. Every chunk
/// but the first is entered with x = 0 `warmup` samples earlier, in the chunk before it, by when
/// that has been forgotten.
struct LaneFilter {
  int states, outputs;      ///< at most kMostLaneStates, kMostLaneOutputs
  const double *F, *K, *C;  ///< states x states, states x outputs, outputs x states; by columns
};
/// @param z       lane-interleaved samples, with one readable double before them
/// @param length  T >= warmup, skip
/// @param skip    samples of the first chunk that do not count; there it enters with state x
/// @param x       in: state of the first chunk at sample `skip`; out: state behind the last chunk
/// @param squares outputs x outputs, by columns: receives sum e e'
void sum_squares_in_lanes(const LaneFilter& filter, const double* z, std::size_t length,
                          std::size_t warmup, std::size_t skip, double* x, double* squares);

}  // namespace identikal::simd
