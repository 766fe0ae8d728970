// How is a verb run on each of many recordings by itself, on several threads?
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "python/given_recording.h"
#include "python/result.h"
#include <pybind11/stl.h>

#include "lib/base/error.h"
#include "solvers/parallel.h"

namespace identikal {
namespace {

namespace py = pybind11;

using Task = std::function<void(int task, const GoesOn& goes_on)>;

// On the caller's thread, which sees signals itself.
void one_after_the_other(int count, Pulse& pulse, const Task& task) {
  const GoesOn goes_on = [&] { return pulse("", 0.0, 0.0); };
  for (int i = 0; i < count && goes_on(); ++i) task(i, goes_on);
}

// On threads of their own: only the one that Python began on is told of signals, and it may not be
// deep in a job when one comes.
void side_by_side(int count, int threads, Pulse& pulse, const Task& task) {
  std::atomic<int> next{0};
  std::atomic<bool> stopped{false};
  std::mutex mutex;  // of `working`
  std::condition_variable ended;
  int working = 0;
  const auto work = [&] {
    const OneThread alone;
    const GoesOn goes_on = [&] { return !stopped; };
    for (int i = next++; i < count && !stopped; i = next++) task(i, goes_on);
    const std::lock_guard<std::mutex> lock(mutex);
    --working;
    ended.notify_one();
  };
  std::vector<std::thread> all;
  std::unique_lock<std::mutex> lock(mutex);
  try {
    for (; working < threads; ++working) all.emplace_back(work);
  } catch (const std::system_error&) {
    // The system gives no more: those that there are share the work.
  }
  if (all.empty()) {
    lock.unlock();
    return one_after_the_other(count, pulse, task);
  }
  while (!ended.wait_for(lock, std::chrono::milliseconds(50), [&] { return working == 0; })) {
    lock.unlock();
    if (!pulse("", 0.0, 0.0)) stopped = true;
    lock.lock();
  }
  lock.unlock();
  for (std::thread& each : all) each.join();
}

// The results, None where a signal came first, and whether one did.
// @param recordings  (samples, files) of each: several of one are fitted together
py::tuple run_each(const std::string& verb,
                   const std::vector<std::pair<std::string, std::string>>& models,
                   const std::vector<std::pair<py::list, std::vector<std::string>>>& recordings,
                   const std::vector<SharedResult>& previous, const std::string& options,
                   int threads) {
  const std::vector<const ik_result*> before = pointers(previous);
  std::vector<GivenData> data;
  for (const auto& [samples, files] : recordings) data.emplace_back(samples, files);
  std::vector<SharedResult> results(data.size());
  Pulse pulse(py::none{});
  const Task task = [&](int i, const GoesOn& goes_on) {
    const auto at = static_cast<std::size_t>(i);
    auto result = std::make_shared<ik_result>();
    result->verb = verb;
    result->options = options;
    bool stopped = false;
    guarded(*result, [&] {
      run(*result, data[at].arguments(models, before), {},
          [&] { return !(stopped = stopped || !goes_on()); });
    });
    if (!stopped) results[at] = std::move(result);
  };
  {
    const py::gil_scoped_release released;
    const int count = static_cast<int>(data.size());
    if (threads == 1 || count == 1) {
      one_after_the_other(count, pulse, task);
    } else {
      side_by_side(count, std::min(threads, count), pulse, task);
    }
  }
  pulse.rethrow();
  return py::make_tuple(results, pulse.interrupted());
}

}  // namespace

void add_each(py::module_& module) {
  module.def("run_each", run_each);
  module.def("check_call", check_call);
}

}  // namespace identikal
