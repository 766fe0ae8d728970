#include "solvers/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace identikal {

namespace {

std::atomic<int> most_threads{0};

}  // namespace

void use_threads_at_most(int threads) { most_threads = threads; }

void in_parallel(int count, int threads, const std::function<void(int task)>& task) {
  std::atomic<int> next{0};
  std::mutex mutex;  // of what follows
  int failed = count;
  std::exception_ptr failure;
  const auto work = [&] {
    for (;;) {
      const int i = next++;
      if (i >= count) return;
      try {
        task(i);
      } catch (...) {
        // Every earlier task has been taken, so the first failure is among those under way.
        next = count;
        const std::lock_guard<std::mutex> lock(mutex);
        if (i < failed) {
          failed = i;
          failure = std::current_exception();
        }
      }
    }
  };
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const int most = most_threads > 0 ? most_threads.load() : std::max(threads, cores);
  const int together = std::min({threads > 0 ? threads : cores, most, count});
  std::vector<std::thread> others;
  others.reserve(static_cast<std::size_t>(std::max(together, 0)));
  try {
    for (int t = 1; t < together; ++t) others.emplace_back(work);
  } catch (const std::system_error&) {
    // The system gives no more: those that there are share the work.
  }
  work();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace identikal
