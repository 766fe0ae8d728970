#include "python/given_recording.h"

#include <pybind11/stl.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

namespace py = pybind11;

std::optional<Doubles> doubles(const py::handle& given) {
  if (given.is_none()) return std::nullopt;
  if (!py::isinstance<Doubles>(given)) {
    throw InputError({}, "samples that are not rows of float64", "arrays in C order");
  }
  return py::reinterpret_borrow<Doubles>(given);
}

}  // namespace

GivenRecording given_recording(const py::handle& item) {
  const auto parts = py::cast<py::tuple>(item);
  GivenRecording out;
  out.time = doubles(parts[0]);
  out.y = doubles(parts[1]);
  out.u = doubles(parts[2]);
  out.step = py::cast<double>(parts[3]);
  out.names = py::cast<std::vector<std::string>>(parts[4]);
  out.units = py::cast<std::vector<std::optional<std::string>>>(parts[5]);
  return out;
}

ik_recording GivenRecording::view() {
  ik_recording out{};
  const auto take = [&](const std::optional<Doubles>& from, const double*& values,
                        std::size_t& columns) {
    if (!from) return;
    values = from->data();
    out.rows = static_cast<std::size_t>(from->shape(0));
    columns = from->ndim() > 1 ? static_cast<std::size_t>(from->shape(1)) : 1;
  };
  std::size_t of_time = 0;
  take(time, out.time, of_time);
  take(u, out.u, out.nu);
  take(y, out.y, out.ny);
  for (const auto* each : {&time, &u, &y}) {
    if (each->has_value() && static_cast<std::size_t>((*each)->shape(0)) != out.rows) {
      throw InputError({}, "times, outputs and inputs of different lengths",
                       "a row for each sample");
    }
  }
  out.step = step;
  for (const std::string& name : names) name_pointers.push_back(name.c_str());
  for (const auto& unit : units) unit_pointers.push_back(unit ? unit->c_str() : nullptr);
  if (!names.empty() && names.size() != out.ny + out.nu) {
    throw InputError({}, "as many names as columns are needed", "a name for each column");
  }
  if (!units.empty() && units.size() != out.ny + out.nu) {
    throw InputError({}, "as many units as columns are needed", "a unit for each column");
  }
  out.names = names.empty() ? nullptr : name_pointers.data();
  out.units = units.empty() ? nullptr : unit_pointers.data();
  return out;
}

GivenData::GivenData(const py::handle& samples, std::vector<std::string> files)
    : files_(std::move(files)) {
  for (const py::handle& item : samples) recordings_.push_back(given_recording(item));
  for (GivenRecording& each : recordings_) views_.push_back(each.view());
}

Arguments GivenData::arguments(const std::vector<std::pair<std::string, std::string>>& models,
                               const std::vector<const ik_result*>& previous) const {
  Arguments out;
  for (const auto& [text, file] : models) out.models.push_back({text, file});
  out.recordings = views_.data();
  out.count = views_.size();
  out.files = files_;
  out.previous = previous.data();
  out.previous_count = previous.size();
  return out;
}

}  // namespace identikal
