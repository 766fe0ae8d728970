// The two loops that run over every sample of a long recording, written for the widest vectors of
// the machine they run on. Raw pointers only: this file is compiled for several instruction sets,
// and nothing that another file might also instantiate may pass through it.
#pragma once

#include <cstddef>

namespace identikal::simd {

/// sums[(m * channels + j) * channels + i] += sum_{t=0}^{count-1} z_i(t) z_j(t - m) for
/// first_lag <= m < first_lag + lags, summed in blocks so that rounding grows with the square root
/// of count at most.
/// @param z          channels pointers to sample 0 of each channel; samples before it are read,
/// down
///                   to -(first_lag + lags + padding())
/// @param sums       starts at m = first_lag
void add_lag_products(const double* const* z, std::size_t channels, std::size_t count,
                      std::size_t first_lag, std::size_t lags, double* sums);

/// How many samples before the oldest lag are read (and not used).
std::size_t padding();

}  // namespace identikal::simd
