// How many lanes does a number have that stands with its derivatives? Internal to lib.
#pragma once

namespace identikal::simd {

/// In a block, for a value and k derivatives: 1 + k lanes take as many blocks as they need.
inline int lane_count(int derivatives) { return derivatives < 4 ? 4 : 8; }

}  // namespace identikal::simd
