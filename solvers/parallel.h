// How is work shared among cores, without the result depending on how many there are?
#pragma once

#include <functional>

namespace identikal {

/// Calls task(i) for i = 0 .. count - 1, `threads` at a time, 0: as many as there are cores. Tasks
/// may write to what belongs to i only. Without threads, or with one task, in order and on the
/// caller's thread.
///
/// Example:
///
///     std::vector<double> squares(9);
///     in_parallel(9, 0, [&](int i) { squares[static_cast<std::size_t>(i)] = i * i; });
///
/// @throws what the first task, of those that throw, throws; tasks that were not begun by then are
///   left out
void in_parallel(int count, int threads, const std::function<void(int task)>& task);

/// From here on no in_parallel() of this process has more threads at a time, whatever it asks for:
/// where several processes share the machine. 0: no such limit.
void use_threads_at_most(int threads);

/// While one lives, in_parallel() has one thread where this thread calls it: for callers that have
/// shared their work among threads themselves.
class OneThread {
 public:
  OneThread();
  ~OneThread();
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  bool before_;
};

}  // namespace identikal
