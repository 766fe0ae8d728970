// A short row is added to another: the innermost loop of all that is derived in several directions.
// Internal to lib.
#pragma once

#include <cstddef>

namespace identikal {

template <std::ptrdiff_t kCount>
inline void add_scaled_of_size(double* __restrict to, double weight, const double* from) {
  for (std::ptrdiff_t c = 0; c < kCount; ++c) to[c] += weight * from[c];
}

/// to[0 .. count - 1] += weight from[..]; nothing where the weight is zero, as most entries of most
/// models' matrices are. Loops of a length that is known at run time only cost more to enter than
/// these take.
[[gnu::always_inline]] inline void add_scaled(double* __restrict to, double weight,
                                              const double* from, std::ptrdiff_t count) {
  if (weight == 0.0) return;
  for (; count > 8; count -= 8, to += 8, from += 8) add_scaled_of_size<8>(to, weight, from);
  switch (count) {
    case 1:
      return add_scaled_of_size<1>(to, weight, from);
    case 2:
      return add_scaled_of_size<2>(to, weight, from);
    case 3:
      return add_scaled_of_size<3>(to, weight, from);
    case 4:
      return add_scaled_of_size<4>(to, weight, from);
    case 5:
      return add_scaled_of_size<5>(to, weight, from);
    case 6:
      return add_scaled_of_size<6>(to, weight, from);
    case 7:
      return add_scaled_of_size<7>(to, weight, from);
    case 8:
      return add_scaled_of_size<8>(to, weight, from);
    default:
      return;
  }
}

}  // namespace identikal
