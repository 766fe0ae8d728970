// How are a study's repetitions shared among cores, without the result depending on how many?
#pragma once

#include <cstdint>
#include <functional>

#include "lib/base/random.h"
#include "studies/study.h"

namespace identikal {

/// Calls run(i, random) for i = 0 .. options.runs - 1, options.threads at a time. Each has random
/// numbers of its own, which follow from options.seed, `stream` and i alone; it may write to what
/// belongs to i only. Reports progress.
/// @param stream  tells experiments of one study apart
/// @throws what the first run, of those that throw, throws
void repeat(const StudyOptions& options, std::uint64_t stream,
            const std::function<void(int run, Random& random)>& run);

}  // namespace identikal
