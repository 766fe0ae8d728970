#include "studies/runs.h"

#include <mutex>

#include "solvers/parallel.h"

namespace identikal {
namespace {

// Neighbouring numbers far apart (splitmix64: Steele, Lea & Flood 2014, OOPSLA).
std::uint64_t scattered(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

}  // namespace

void repeat(const StudyOptions& options, std::uint64_t stream,
            const std::function<void(int run, Random& random)>& run) {
  const std::uint64_t seed = scattered(scattered(options.seed) + stream);
  std::mutex mutex;  // of what follows
  int done = 0;
  in_parallel(options.runs, options.threads, [&](int i) {
    Random random(scattered(seed + static_cast<std::uint64_t>(i)));
    run(i, random);
    const std::lock_guard<std::mutex> lock(mutex);
    if (options.progress) options.progress(++done, options.runs);
  });
}

}  // namespace identikal
