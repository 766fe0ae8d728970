// What does Python hold of a job? Its result, whose numbers are read where they lie.
#pragma once

#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "interface/run.h"
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace identikal {

using Doubles = pybind11::array_t<double, pybind11::array::c_style>;
using SharedResult = std::shared_ptr<ik_result>;

/// Adds the class Result and what makes one.
void add_results(pybind11::module_& module);

/// Adds what runs a verb on each of many recordings.
void add_each(pybind11::module_& module);

/// Of results that outlive what comes out.
std::vector<const ik_result*> pointers(const std::vector<SharedResult>& results);

/// Lets go of Python while it works, and comes back for signals and for the caller's progress now and then.
class Pulse {
 public:
  /// @param callback  None, or a function (what, share, value) that returns False to stop
  explicit Pulse(pybind11::object callback);

  /// Of one call at a time; the caller does not hold the interpreter. @return false to stop
  bool operator()(const std::string& what, double share, double value);
  bool interrupted() const { return interrupted_; }
  /// Ctrl-C has come while Python code ran: the next call answers false.
  void interrupt() { interrupted_ = true; }
  /// What the callback threw. @throws it, with the interpreter held
  void rethrow() const;

 private:
  pybind11::object callback_;
  std::exception_ptr thrown_;
  double last_ = 0.0;
  bool interrupted_ = false;
};

/// Adds tune_external.
void add_external_filter(pybind11::module_& module);

/// Adds the class OnlineFilter.
void add_online_filter(pybind11::module_& module);

/// Adds what reads a fleet's store.
void add_fleets(pybind11::module_& module);

}  // namespace identikal
