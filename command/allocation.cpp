// The program's own requests for memory: the linker sends malloc() of all that it is linked from through here (--wrap). Eigen
// and the archives under Ceres ask malloc(); operator new has its handler.
#include <cstddef>

#include "command/memory.h"

extern "C" {

void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* old, std::size_t size);

void* __wrap_malloc(std::size_t size) {
  void* const out = __real_malloc(size);
  if (out == nullptr && size > 0) identikal::memory_has_failed();
  return out;
}

void* __wrap_calloc(std::size_t count, std::size_t size) {
  void* const out = __real_calloc(count, size);
  if (out == nullptr && count > 0 && size > 0) identikal::memory_has_failed();
  return out;
}

void* __wrap_realloc(void* old, std::size_t size) {
  void* const out = __real_realloc(old, size);
  if (out == nullptr && size > 0) identikal::memory_has_failed();
  return out;
}

}  // extern "C"
