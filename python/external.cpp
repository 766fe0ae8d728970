// A filter that somebody wrote in Python, tuned by its innovations.
#include <optional>

#include "jobs/run.h"
#include "python/result.h"
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "identify/noise/external_filter.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

namespace py = pybind11;
using Eigen::Index;

// name, value, least, greatest
using GivenParameter = std::tuple<std::string, double, double, double>;

ParameterSet parameter_set(const std::vector<GivenParameter>& given) {
  ParameterSet out;
  for (const auto& [name, value, min, max] : given) {
    Parameter p;
    p.name = name;
    p.value = Eigen::MatrixXd::Constant(1, 1, value);
    p.min = min;
    p.max = max;
    out.push_back(std::move(p));
  }
  return out;
}

// One covariance, or one per row.
std::vector<Eigen::MatrixXd> covariances(const Doubles& S, Index outputs, Index rows) {
  const auto refuse = [&](const char* what) {
    throw InputError({}, what, "one of outputs x outputs, or rows x outputs x outputs");
  };
  const bool each = S.ndim() == 3;
  if (S.ndim() != 2 && !each) refuse("covariances with neither two nor three dimensions");
  if (each && S.shape(0) != rows) refuse("as many covariances as innovations are needed");
  if (S.shape(S.ndim() - 1) != outputs || S.shape(S.ndim() - 2) != outputs) {
    refuse("covariances of another size than the innovations");
  }
  std::vector<Eigen::MatrixXd> out;
  for (Index k = 0; k < (each ? rows : 1); ++k) {
    out.emplace_back(
        Eigen::Map<const Eigen::MatrixXd>(S.data() + k * outputs * outputs, outputs, outputs));
  }
  return out;
}

// The function answers with innovations, rows x outputs, and covariances; None where it does not run.
std::optional<Innovations> innovations_of(const py::object& filter, const ParameterSet& at) {
  Eigen::VectorXd values(static_cast<Index>(at.size()));
  for (std::size_t i = 0; i < at.size(); ++i) values[static_cast<Index>(i)] = at[i].scalar();
  const py::object answer = filter(values);
  if (answer.is_none()) return std::nullopt;
  const auto parts = py::cast<py::tuple>(answer);
  const auto e = py::cast<Doubles>(parts[0]);
  const Index rows = e.shape(0), outputs = e.shape(1);
  Innovations out;
  out.e = Eigen::Map<const Eigen::MatrixXd>(e.data(), outputs, rows);
  out.Sigma = covariances(py::cast<Doubles>(parts[1]), outputs, rows);
  return out;
}

// Numbers as its author returns them, with what the tests need beside the likelihood.
py::tuple fit(const std::vector<GivenParameter>& given, const py::object& filter, int iterations,
              const py::object& progress) {
  auto result = std::make_shared<ik_result>();
  result->verb = "tune";
  Pulse pulse(progress);
  std::exception_ptr thrown;
  ExternalFilterOptions options;
  if (iterations > 0) options.max_iterations = iterations;
  options.progress = [&](int iteration, double L) {
    return pulse("iteration " + std::to_string(iteration), kNone, L);
  };
  const ExternalFilter run = [&](const ParameterSet& at) -> std::optional<Innovations> {
    const py::gil_scoped_acquire held;
    if (thrown || pulse.interrupted()) return std::nullopt;
    try {
      return innovations_of(filter, at);
    } catch (const py::error_already_set& error) {
      if (error.matches(PyExc_KeyboardInterrupt)) {
        pulse.interrupt();
      } else {
        thrown = std::current_exception();
      }
    } catch (const InputError&) {
      thrown = std::current_exception();
    }
    return std::nullopt;
  };
  guarded(*result, [&] {
    const py::gil_scoped_release released;
    const auto estimate =
        std::make_shared<NoiseEstimate>(fit_external_filter(parameter_set(given), run, options));
    if (pulse.interrupted()) {
      estimate->findings = {
          make_finding(FindingCode::stopped, {}, "stopped; the values are the best so far")};
      conclude(*estimate, "");
    }
    estimate->verb = "tune";
    estimate->model_name = "own filter";
    Call call;
    call.wants_text = false;
    const Run of_call{"tune", call, "", {}, {}};
    result->outcome = outcome_of(of_call, kept(estimate));
    result->code = result->outcome.exit_code;
    result->message = result->outcome.message;
  });
  if (thrown) {  // whatever was made of it
    try {
      std::rethrow_exception(thrown);
    } catch (const InputError& error) {
      result->code = 2;
      result->message = error.what();
    }
  }
  pulse.rethrow();
  return py::make_tuple(result, pulse.interrupted());
}

}  // namespace

void add_external_filter(py::module_& module) { module.def("tune_external", fit); }

}  // namespace identikal
