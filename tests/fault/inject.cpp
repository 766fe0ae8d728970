// Preloaded into a program, lets the n-th call of a kind fail, as a full disk or a full memory would:
//
//     FAULT=write:3 LD_PRELOAD=libfault.so identikal tune ...     the third write() fails
//     FAULT=write:3+                                              the third one and all after it
//     FAULT_COUNTS=file                                           how often each kind was called, and the paths opened
//
// Kinds: memory, open, read, write, rename, sync, folder, link, thread. Counted from the begin of main() on: what goes wrong
// before that is the loader's.
#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
}

namespace {

enum Kind { memory, open_, read_, write_, rename_, sync_, folder, link_, thread, kinds };
constexpr const char* kNames[kinds] = {"memory", "open",   "read", "write", "rename",
                                       "sync",   "folder", "link", "thread"};
constexpr int kErrors[kinds] = {ENOMEM, EACCES, EIO, ENOSPC, EIO, EIO, ENOSPC, EMLINK, EAGAIN};

std::array<std::atomic<long>, kinds> counts;
std::array<char, 1 << 16> opened;  // paths, a line each
std::atomic<std::size_t> opened_end{0};
std::atomic<bool> armed{false};
int chosen = -1;
long first = 0, last = 0;

bool fails(Kind kind) {
  if (!armed.load(std::memory_order_relaxed)) return false;
  const long n = ++counts[kind];
  if (kind != chosen || n < first || n > last) return false;
  errno = kErrors[kind];
  return true;
}

void note_opened(const char* path) {
  if (!armed.load(std::memory_order_relaxed)) return;
  const std::size_t length = std::strlen(path), begin = opened_end.fetch_add(length + 1);
  if (begin + length + 1 > opened.size()) return;
  std::memcpy(&opened[begin], path, length);
  opened[begin + length] = '\n';
}

template <typename Function>
Function next(Function, const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}
#define NEXT(name) static const auto real = next(static_cast<decltype(&::name)>(nullptr), #name)

void read_settings() {
  const char* const text = std::getenv("FAULT");
  for (int kind = 0; text != nullptr && kind < kinds; ++kind) {
    const std::size_t length = std::strlen(kNames[kind]);
    if (std::strncmp(text, kNames[kind], length) != 0 || text[length] != ':') continue;
    char* end = nullptr;
    chosen = kind;
    first = std::strtol(text + length + 1, &end, 10);
    last = *end == '+' ? 1L << 60 : first;
  }
}

void write_counts() {
  armed = false;
  const char* const path = std::getenv("FAULT_COUNTS");
  if (path == nullptr) return;
  const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0) return;
  for (int kind = 0; kind < kinds; ++kind) {
    dprintf(file, "%s %ld\n", kNames[kind], counts[kind].load());
  }
  const std::size_t size = std::min(opened_end.load(), opened.size());
  if (write(file, opened.data(), size) < 0) dprintf(file, "?\n");
  close(file);
}

// The third argument, which open() has where it may make a file.
unsigned mode_given(int flags, va_list more) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, unsigned) : 0;
}

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

int counted_main(int argc, char** argv, char** environment) {
  read_settings();
  std::atexit(write_counts);
  armed = true;
  return real_main(argc, argv, environment);
}

}  // namespace

extern "C" {

int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(),
                      void (*rtld_fini)(), void* stack_end) {
  using Start = int (*)(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
  real_main = main;
  const auto real = reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"));
  return real(counted_main, argc, argv, init, fini, rtld_fini, stack_end);
}

void* malloc(std::size_t size) { return fails(memory) ? nullptr : __libc_malloc(size); }
void* calloc(std::size_t count, std::size_t size) {
  return fails(memory) ? nullptr : __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  return fails(memory) ? nullptr : __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return fails(memory) ? nullptr : __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  if (fails(memory)) return ENOMEM;
  *out = __libc_memalign(alignment, size);
  return *out == nullptr ? ENOMEM : 0;
}

int open(const char* path, int flags, ...) {
  NEXT(open);
  note_opened(path);
  if (fails(open_)) return -1;
  va_list more;
  va_start(more, flags);
  const unsigned mode = mode_given(flags, more);
  va_end(more);
  return real(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  NEXT(open64);
  note_opened(path);
  if (fails(open_)) return -1;
  va_list more;
  va_start(more, flags);
  const unsigned mode = mode_given(flags, more);
  va_end(more);
  return real(path, flags, mode);
}
std::FILE* fopen(const char* path, const char* mode) {
  NEXT(fopen);
  note_opened(path);
  return fails(open_) ? nullptr : real(path, mode);
}
std::FILE* fopen64(const char* path, const char* mode) {
  NEXT(fopen64);
  note_opened(path);
  return fails(open_) ? nullptr : real(path, mode);
}
ssize_t read(int file, void* buffer, std::size_t size) {
  NEXT(read);
  return fails(read_) ? -1 : real(file, buffer, size);
}
// What goes to a terminal or a pipe is nobody's result.
ssize_t write(int file, const void* buffer, std::size_t size) {
  NEXT(write);
  return file > STDERR_FILENO && fails(write_) ? -1 : real(file, buffer, size);
}
ssize_t writev(int file, const iovec* parts, int count) {
  NEXT(writev);
  return file > STDERR_FILENO && fails(write_) ? -1 : real(file, parts, count);
}
int rename(const char* from, const char* to) {
  NEXT(rename);
  return fails(rename_) ? -1 : real(from, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  NEXT(renameat2);
  return fails(rename_) ? -1 : real(from_folder, from, to_folder, to, flags);
}
int fsync(int file) {
  NEXT(fsync);
  return fails(sync_) ? -1 : real(file);
}
int mkdir(const char* path, mode_t mode) {
  NEXT(mkdir);
  return fails(folder) ? -1 : real(path, mode);
}
int link(const char* from, const char* to) {
  NEXT(link);
  return fails(link_) ? -1 : real(from, to);
}
int pthread_create(pthread_t* made, const pthread_attr_t* attributes, void* (*begin)(void*),
                   void* given) {
  NEXT(pthread_create);
  return fails(thread) ? EAGAIN : real(made, attributes, begin, given);
}

}  // extern "C"
