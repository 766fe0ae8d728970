// How does Python run a verb, and read its result where it lies?
#include "python/result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "python/given_recording.h"
#include <pybind11/stl.h>

#include "identify/model/model_file.h"
#include "identify/result/export.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

namespace py = pybind11;

// The verb, without the interpreter; what it throws becomes code and message.
// @param models  text and path of each, one of them empty
py::tuple run_verb(const std::string& verb,
                   const std::vector<std::pair<std::string, std::string>>& models,
                   const py::list& recordings, const std::vector<std::string>& files,
                   const std::vector<SharedResult>& previous, const std::string& options,
                   const py::object& progress) {
  auto result = std::make_shared<ik_result>();
  result->verb = verb;
  result->options = options;
  std::optional<GivenData> data;
  const std::vector<const ik_result*> before = pointers(previous);
  Pulse pulse(progress);
  const bool silent = progress.is_none();
  guarded(*result, [&] {
    data.emplace(recordings, files);
    const Arguments arguments = data->arguments(models, before);
    const py::gil_scoped_release released;
    if (silent) {
      run(*result, arguments, {}, [&] { return pulse("", 0.0, 0.0); });
    } else {
      run(*result, arguments, std::ref(pulse));
    }
  });
  pulse.rethrow();
  return py::make_tuple(result, pulse.interrupted());
}

SharedResult failed(const std::string& verb, const std::string& message) {
  auto out = std::make_shared<ik_result>();
  out->verb = verb;
  out->code = 2;
  out->message = message;
  return out;
}

// name, value, se, interval, error bound, unit, verdict, start, fixed, bounds
// @param nan  one for all, so that equal results are equal
py::object parameter_rows(const ik_result& result, const py::object& nan) {
  if (!result.outcome.estimate) return py::none();
  const auto number = [&](double x) { return std::isnan(x) ? nan : py::float_(x); };
  const auto pair = [&](const std::array<double, 2>& x) {
    return py::make_tuple(number(x[0]), number(x[1]));
  };
  py::list out;
  for (const EstimatedParameter& p : result.outcome.estimate->parameters) {
    out.append(py::make_tuple(p.name, number(p.value), number(p.se), pair(p.ci95), number(p.crb_se),
                              p.unit, to_string(p.verdict), number(p.start), p.fixed,
                              pair(p.bounds)));
  }
  return out;
}

// severity, code, text, remedy
py::object finding_rows(const ik_result& result) {
  if (!result.outcome.estimate) return py::none();
  py::list out;
  for (const Finding& f : printed(result.outcome.estimate->findings)) {
    out.append(py::make_tuple(to_string(f.severity), std::string(name_of(f)), f.text, f.remedy));
  }
  return out;
}

// Beyond notes; of every call, so it makes no list.
bool has_warnings(const ik_result& result) {
  if (!result.outcome.estimate) return result.outcome.json.exists();
  const Findings& all = result.outcome.estimate->findings;
  return std::any_of(all.begin(), all.end(),
                     [](const Finding& f) { return f.severity != Severity::note; });
}

py::object series_of(const py::object& self, const std::string& name) {
  const auto& result = py::cast<const ik_result&>(self);
  for (const NamedSeries& each : result.outcome.series) {
    if (each.name != name) continue;
    // A view, which keeps the result alive and cannot be written to.
    py::array_t<double> view({each.values.rows(), each.values.cols()}, each.values.data(), self);
    py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return view;
  }
  return py::none();
}

std::vector<std::string> series_names_of(const ik_result& result) {
  std::vector<std::string> out;
  for (const NamedSeries& each : result.outcome.series) out.push_back(each.name);
  return out;
}

std::string page_of(ik_result& result) {
  ik_result problem;
  guarded(problem, [&] {
    draw_page(result);
    problem.code = 0;
  });
  if (problem.code != 0) throw std::runtime_error(problem.message);
  return result.page;
}

StoredResult stored(const ik_result& result) {
  Inputs inputs;
  inputs.keep_result(result_name_in_memory(0), result.outcome.json.text(), "");
  return inputs.result(result_name_in_memory(0));
}

std::string exported_of(const ik_result& result, const std::string& to) {
  const std::optional<ExportFormat> format = export_format(to);
  std::string text;
  ik_result problem;
  guarded(problem, [&] {
    if (!format) throw InputError({}, "'" + to + "' is no format", export_format_list());
    if (!result.outcome.json.exists()) throw InputError({}, "no result to export", "an estimate");
    text = export_text(stored(result), *format);
    problem.code = 0;
  });
  if (problem.code != 0) throw std::invalid_argument(problem.message);
  return text;
}

// For pickle: texts and numbers; what could draw the page again stays behind.
py::dict state_of(const py::object& self) {
  const auto& result = py::cast<const ik_result&>(self);
  py::dict kept, series_kept;
  for (const NamedSeries& each : result.outcome.series) {
    series_kept[each.name.c_str()] = series_of(self, each.name).attr("copy")();
  }
  kept["verb"] = result.verb;
  kept["code"] = result.code;
  kept["message"] = result.message;
  kept["page"] = result.page;
  kept["text"] = result.outcome.text;
  kept["json"] = result.outcome.json.text();
  kept["summary"] = result.outcome.summary.text();
  kept["series"] = series_kept;
  return kept;
}

LateText kept_text(const py::dict& kept, const char* key) {
  auto text = py::cast<std::string>(kept[key]);
  if (text.empty()) return {};
  return LateText([text = std::move(text)] { return text; });
}

SharedResult restored(const py::dict& kept) {
  auto out = std::make_shared<ik_result>();
  out->verb = py::cast<std::string>(kept["verb"]);
  out->code = py::cast<int>(kept["code"]);
  out->message = py::cast<std::string>(kept["message"]);
  out->page = py::cast<std::string>(kept["page"]);
  out->outcome.text = py::cast<std::string>(kept["text"]);
  out->outcome.json = kept_text(kept, "json");
  out->outcome.summary = kept_text(kept, "summary");
  for (const auto& [name, values] : py::cast<py::dict>(kept["series"])) {
    const auto array = py::cast<Doubles>(values);
    NamedSeries each{py::cast<std::string>(name), {}};
    each.values =
        Eigen::Map<const decltype(each.values)>(array.data(), array.shape(0), array.shape(1));
    out->outcome.series.push_back(std::move(each));
  }
  return out;
}

double log_likelihood_of(const ik_result& result) {
  return result.outcome.estimate ? result.outcome.estimate->objective.log_likelihood : std::nan("");
}

py::object status_of(const ik_result& result) {
  if (!result.outcome.estimate) return py::none();
  return py::str(to_string(result.outcome.estimate->status));
}

// Columns of outputs, columns of inputs, names of states: as a model's file calls them.
py::tuple channels_of(const std::string& text, const std::string& path) {
  Model model;
  ik_result problem;
  guarded(problem, [&] {
    model = path.empty() ? parse_model_file(text, model_name_in_memory()) : read_model_file(path);
    problem.code = 0;
  });
  if (problem.code != 0) throw std::invalid_argument(problem.message);
  std::vector<std::string> outputs, inputs;
  for (const ChannelSource& each : model.outputs) {
    if (!each.value) outputs.push_back(each.column);
  }
  for (const ChannelSource& each : model.inputs) inputs.push_back(each.column);
  std::vector<std::string> states;
  for (const StateName& each : model.states) states.push_back(each.name);
  if (states.empty() && is_linear(model)) {
    for (Eigen::Index i = 1; i <= as_linear(model).A.constant.rows(); ++i) {
      states.push_back("x" + std::to_string(i));
    }
  }
  return py::make_tuple(outputs, inputs, states);
}

}  // namespace

std::vector<const ik_result*> pointers(const std::vector<SharedResult>& results) {
  std::vector<const ik_result*> out;
  for (const SharedResult& each : results) out.push_back(each.get());
  return out;
}

void add_results(py::module_& module) {
  py::class_<ik_result, SharedResult>(module, "Result")
      .def_readonly("code", &ik_result::code)
      .def_readonly("message", &ik_result::message)
      .def_readonly("verb", &ik_result::verb)
      .def("has_document", [](const ik_result& r) { return r.outcome.json.exists(); })
      .def("has_values", [](const ik_result& r) { return r.outcome.estimate != nullptr; })
      .def("status", status_of)
      .def("log_likelihood", log_likelihood_of)
      .def("parameters", parameter_rows)
      .def("has_warnings", has_warnings)
      .def("findings", finding_rows)
      .def("series", series_of)
      .def("series_names", series_names_of)
      .def("text", [](const ik_result& r) { return r.outcome.text; })
      .def(
          "json", [](const ik_result& r) { return r.outcome.json.text(); },
          py::call_guard<py::gil_scoped_release>())
      .def(
          "summary", [](const ik_result& r) { return r.outcome.summary.text(); },
          py::call_guard<py::gil_scoped_release>())
      .def("page", page_of, py::call_guard<py::gil_scoped_release>())
      .def("export", exported_of, py::call_guard<py::gil_scoped_release>())
      .def("state", state_of);
  module.def("run", run_verb);
  module.def("failed", failed);
  module.def("channels", channels_of);
  module.def("restored", restored);
}

}  // namespace identikal
