// What does the engine make of a digest? Internal to the filter.
#pragma once

#include "lib/filter/internal/segment.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

/// @throws std::invalid_argument for a digest whose parts do not fit together
Segment segment_of(const RecordingDigest& digest);

}  // namespace identikal
