// How does Python read a fleet's store, and write samples as the files that a fleet takes?
#include <string>

#include "fleet/page.h"
#include "fleet/population.h"
#include "fleet/store.h"
#include "fleet/summary.h"
#include "fleet/table.h"
#include "interface/recording_table.h"
#include "python/given_recording.h"
#include <pybind11/stl.h>

#include "identify/model/model_file.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

namespace py = pybind11;

std::string table_of(FleetStore& store) {
  std::string out;
  write_table(store, [&](const std::string& text) { out += text; });
  return out;
}

/// @param what  "table", "status", "summary", "counts", "population" or "page"
std::string fleet_text(const std::string& path, const std::string& what) {
  const py::gil_scoped_release released;
  FleetStore store(path, FleetStore::Open::read);
  if (what == "table") return table_of(store);
  if (what == "status") return status_json(store);
  if (what == "summary") return status_text(store);
  if (what == "population") return population_json(population_of(store));
  if (what == "page") return fleet_page(store, population_of(store));
  const FleetCounts counts = store.counts();
  return "{\"recordings\": " + std::to_string(counts.jobs) +
         ", \"done\": " + std::to_string(counts.done) + "}";
}

/// @param text, path  the model's, one of them empty
std::string csv_text_of(const std::string& text, const std::string& path, const py::tuple& item,
                        const std::string& name) {
  GivenRecording given = given_recording(item);
  const ik_recording view = given.view();
  const py::gil_scoped_release released;
  const Model model = text.empty() ? read_model_file(path) : parse_model_file(text, "model");
  return csv_text(recording_table(view, model, name, view.ny > 0));
}

}  // namespace

void add_fleets(py::module_& module) {
  module.def("fleet_text", fleet_text);
  module.def("csv_text", csv_text_of);
}

}  // namespace identikal
