// How often does a piece of code allocate memory? Replaces malloc() of the whole program, so what
// includes it is a program of its own (and has no sanitizer, which replaces malloc() too).
#pragma once

#include <atomic>
#include <cstdlib>

namespace identikal::counted_malloc {
inline std::atomic<bool> counting{false};
inline std::atomic<long> allocations{0};
}  // namespace identikal::counted_malloc

extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  if (identikal::counted_malloc::counting) ++identikal::counted_malloc::allocations;
  return __libc_malloc(size);
}

namespace identikal {

/// The number of times that `work()` called malloc().
template <class Work>
long allocations_of(const Work& work) {
  counted_malloc::allocations = 0;
  counted_malloc::counting = true;
  work();
  counted_malloc::counting = false;
  return counted_malloc::allocations;
}

}  // namespace identikal
