#include "studies/runs.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

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
  std::atomic<int> next{0};
  std::mutex mutex;  // of what follows
  int done = 0, failed = options.runs;
  std::exception_ptr failure;
  const auto work = [&] {
    for (;;) {
      const int i = next++;
      if (i >= options.runs) return;
      try {
        Random random(scattered(seed + static_cast<std::uint64_t>(i)));
        run(i, random);
        const std::lock_guard<std::mutex> lock(mutex);
        if (options.progress) options.progress(++done, options.runs);
      } catch (...) {
        // Every earlier run has been taken, so the first failure is among those under way.
        next = options.runs;
        const std::lock_guard<std::mutex> lock(mutex);
        if (i < failed) {
          failed = i;
          failure = std::current_exception();
        }
      }
    }
  };
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const int threads = std::min(options.threads > 0 ? options.threads : cores, options.runs);
  std::vector<std::thread> others;
  for (int t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace identikal
