// The module identikal._identikal: verbs, results and filters for the package around it.
#include <exception>
#include <string>
#include <vector>

#include "python/result.h"
#include <pybind11/stl.h>

#include "command/command_line.h"
#include "identify/model/templates.h"
#include "lib/base/error.h"
#include "lib/data/units.h"
#include "lib/version.h"

namespace identikal {
namespace {

// The tool, for python -m identikal.
int tool(std::vector<std::string> arguments) {
  std::vector<char*> pointers;
  for (std::string& each : arguments) pointers.push_back(each.data());
  pointers.push_back(nullptr);
  const pybind11::gil_scoped_release released;
  return run_program(static_cast<int>(arguments.size()), pointers.data());
}

std::vector<std::pair<std::string, std::string>> templates() {
  std::vector<std::pair<std::string, std::string>> out;
  for (const ModelTemplate& each : model_templates()) out.emplace_back(each.name, each.text);
  return out;
}

// Mistakes are ValueErrors, of which the package makes its InputErrors.
void raise_mistakes(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const InputError& error) {
    PyErr_SetString(PyExc_ValueError, error.what());
  }
}

}  // namespace
}  // namespace identikal

PYBIND11_MODULE(_identikal, module) {
  module.doc() = "What the package identikal is made of; not for use by itself.";
  pybind11::register_exception_translator(identikal::raise_mistakes);
  module.attr("version") = IDENTIKAL_VERSION;
  module.def("tool", identikal::tool);
  module.def("templates", identikal::templates);
  module.def("is_unit",
             [](const std::string& text) { return identikal::parse_unit(text).has_value(); });
  identikal::add_results(module);
  identikal::add_each(module);
  identikal::add_external_filter(module);
  identikal::add_online_filter(module);
  identikal::add_fleets(module);
}
