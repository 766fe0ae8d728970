// What can one core of this machine do at best? The measure of every other figure.
#pragma once

namespace identikal {

/// Fused multiply-adds on registers [FLOP/s], by the widest vectors there are.
double fma_roof();
/// memcpy of a block much larger than the caches [bytes copied / s].
double copy_roof();

}  // namespace identikal
