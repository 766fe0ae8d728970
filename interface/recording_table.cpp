#include "interface/recording_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "identify/result/csv.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

// A column that was given as one of rows of `width` numbers.
Column column_of(const std::string& name, const std::string& unit, const double* values,
                 std::size_t rows, std::size_t width) {
  Column out;
  out.name = out.header = name;
  out.unit = unit;
  out.values.resize(rows);
  for (std::size_t row = 0; row < rows; ++row) out.values[row] = values[row * width];
  out.missing = static_cast<std::size_t>(
      std::count_if(out.values.begin(), out.values.end(), [](double x) { return std::isnan(x); }));
  return out;
}

void check_pointers(const ik_recording& given, const std::string& name) {
  const auto refuse = [&](const char* what, const char* expected) {
    throw InputError({name, 0, 0}, what, expected);
  };
  if (given.rows == 0) refuse("has no rows", "one at least");
  const std::size_t widest = std::max<std::size_t>({given.ny, given.nu, 1});
  if (given.rows > std::numeric_limits<std::ptrdiff_t>::max() / sizeof(double) / widest) {
    throw InputError({name, 0, 0},
                     fmt::format("{} rows of {} outputs and {} inputs are more than any memory",
                                 given.rows, given.ny, given.nu),
                     "the number of rows that y and u have");
  }
  if (given.ny > 0 && given.y == nullptr) refuse("y is NULL", "rows x ny numbers");
  if (given.nu > 0 && given.u == nullptr) refuse("u is NULL", "rows x nu numbers");
  for (const double* values : {given.y, given.u}) {
    const std::size_t width = values == given.y ? given.ny : given.nu;
    for (std::size_t i = 0; values != nullptr && i < given.rows * width; ++i) {
      if (std::isinf(values[i])) {
        throw InputError({name, 0, 0}, fmt::format("row {} holds an infinite value", i / width + 1),
                         "numbers, NaN where a value is missing");
      }
    }
  }
}

// The model's channels, in its order, or the names that were given.
std::vector<std::string> column_names(const ik_recording& given, const Model& model,
                                      const std::string& name, bool with_outputs) {
  std::vector<std::string> out;
  const std::size_t columns = given.ny + given.nu;
  if (given.names != nullptr) {
    for (std::size_t i = 0; i < columns; ++i) {
      if (given.names[i] == nullptr) {
        throw InputError({name, 0, 0}, fmt::format("name {} of {} is NULL", i + 1, columns),
                         "a text");
      }
      if (std::find(out.begin(), out.end(), given.names[i]) != out.end()) {
        throw InputError({name, 0, 0}, fmt::format("the name '{}' stands twice", given.names[i]),
                         "a name of its own for every column");
      }
      out.emplace_back(given.names[i]);
    }
    return out;
  }
  const std::size_t outputs = with_outputs ? model.outputs.size() : given.ny;
  if (given.ny != outputs || given.nu != model.inputs.size()) {
    throw InputError({name, 0, 0}, fmt::format("{} outputs and {} inputs", given.ny, given.nu),
                     fmt::format("{} and {}, as the model has", with_outputs ? outputs : 0,
                                 model.inputs.size()));
  }
  for (std::size_t i = 0; i < outputs && with_outputs; ++i) out.push_back(model.outputs[i].column);
  for (std::size_t i = out.size(); i < given.ny; ++i) out.push_back(fmt::format("y{}", i + 1));
  for (const ChannelSource& input : model.inputs) out.push_back(input.column);
  return out;
}

// A model without a time column has a step of its own, which times may not contradict.
void check_step(const ik_recording& given, const Model& model, const std::string& name) {
  const double step = model.time.step;
  const auto refuse = [&](double between) {
    throw InputError({name, 0, 0}, fmt::format("samples are {:.6g} s apart", between),
                     fmt::format("{:.6g} s, the model's step", step),
                     "a model with 'time: {column: t}' takes times as they are");
  };
  for (std::size_t row = 1; given.time != nullptr && row < given.rows; ++row) {
    const double between = given.time[row] - given.time[row - 1];
    if (!(std::abs(between - step) <= 0.01 * step)) refuse(between);
  }
  if (given.step != 0.0 && !(std::abs(given.step - step) <= 1e-6 * step)) refuse(given.step);
}

void add_time(const ik_recording& given, const Model& model, const std::string& name,
              Table& table) {
  if (model.time.column.empty()) {
    check_step(given, model, name);
    return;
  }
  if (table.find(model.time.column) != nullptr) {
    if (given.time == nullptr) return;
    throw InputError(
        {name, 0, 0},
        fmt::format("times, and a column '{}', which the model takes for them", model.time.column),
        "one of the two");
  }
  std::vector<double> times;
  if (given.time != nullptr) {
    times.assign(given.time, given.time + given.rows);
  } else {
    const double between = given.step != 0.0 ? given.step : model.time.step;
    if (!(between > 0.0) || !std::isfinite(between)) {
      throw InputError({name, 0, 0}, fmt::format("no times, and a step of {}", between),
                       "times, or a step above 0");
    }
    for (std::size_t row = 0; row < given.rows; ++row) {
      times.push_back(static_cast<double>(row) * between);
    }
  }
  table.columns.insert(table.columns.begin(),
                       column_of(model.time.column, "s", times.data(), given.rows, 1));
}

}  // namespace

Table recording_table(const ik_recording& given, const Model& model, const std::string& name,
                      bool with_outputs) {
  check_pointers(given, name);
  const std::vector<std::string> names = column_names(given, model, name, with_outputs);
  Table table;
  table.path = name;
  table.rows = given.rows;
  table.has_header = true;
  table.line_runs = {{0, 1}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const char* unit = given.units != nullptr ? given.units[i] : nullptr;
    if (unit != nullptr && !parse_unit(unit)) {
      throw InputError({name, 0, 0},
                       fmt::format("the unit of '{}' is unknown: '{}'", names[i], unit),
                       "a unit such as m/s or deg, or NULL for the model's");
    }
    const bool output = i < given.ny;
    table.columns.push_back(column_of(names[i], unit != nullptr ? unit : "",
                                      output ? given.y + i : given.u + (i - given.ny), given.rows,
                                      output ? given.ny : given.nu));
  }
  add_time(given, model, name, table);
  return table;
}

std::string csv_text(const Table& table) {
  fmt::memory_buffer out;
  for (const Column& column : table.columns) {
    if (!column.name.empty() && column.name.find_first_not_of("0123456789") == std::string::npos) {
      throw InputError({table.path, 0, 0}, fmt::format("a column called '{}'", column.name),
                       "a name", "say 'column: level' in the model");
    }
    fmt::format_to(std::back_inserter(out), "{}{}", &column == &table.columns.front() ? "" : ",",
                   csv_heading(column.name, column.unit));
  }
  out.push_back('\n');
  for (std::size_t row = 0; row < table.rows; ++row) {
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      if (i > 0) out.push_back(',');
      fmt::format_to(std::back_inserter(out), "{}", table.columns[i].values[row]);
    }
    out.push_back('\n');
  }
  return fmt::to_string(out);
}

}  // namespace identikal
