// The module identikal._identikal: verbs, results and filters for the package around it.
#include "jobs/verbs.h"
#include "python/result.h"

#include "lib/version.h"

PYBIND11_MODULE(_identikal, module) {
  module.doc() = "What the package identikal is made of; not for use by itself.";
  module.attr("version") = IDENTIKAL_VERSION;
  identikal::add_results(module);
  identikal::add_external_filter(module);
  identikal::add_online_filter(module);
}
