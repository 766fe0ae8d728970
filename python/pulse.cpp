// How does a long call see Ctrl-C, and show its progress?
#include <chrono>

#include "python/result.h"

namespace identikal {
namespace {

// Often enough for Ctrl-C and a moving bar, too seldom to cost anything [s].
constexpr double kBetweenCalls = 0.05;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Pulse::Pulse(pybind11::object callback) : callback_(std::move(callback)), last_(now()) {}

bool Pulse::operator()(const std::string& what, double share, double value) {
  if (interrupted_ || thrown_) return false;
  if (now() - last_ < kBetweenCalls) return true;
  const pybind11::gil_scoped_acquire held;
  last_ = now();
  if (PyErr_CheckSignals() != 0) {
    const pybind11::error_already_set signal;
    if (signal.matches(PyExc_KeyboardInterrupt)) {
      interrupted_ = true;
    } else {
      thrown_ = std::make_exception_ptr(signal);
    }
    return false;
  }
  if (callback_.is_none()) return true;
  try {
    const pybind11::object answer = callback_(what, share, value);
    return !(answer.is(pybind11::bool_(false)));
  } catch (const pybind11::error_already_set&) {
    thrown_ = std::current_exception();
    return false;
  }
}

void Pulse::rethrow() const {
  if (thrown_) std::rethrow_exception(thrown_);
}

}  // namespace identikal
