#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <numeric>
#include <string>
#include <vector>

#include "lib/data/csv.h"
#include "lib/data/internal/csv_cell.h"

namespace identikal {

int Table::line_of_row(std::size_t row) const {
  const auto after =
      std::upper_bound(line_runs.begin(), line_runs.end(), row,
                       [](std::size_t r, const LineRun& run) { return r < run.row; });
  if (after == line_runs.begin()) return 0;
  const LineRun& run = *std::prev(after);
  return run.line + static_cast<int>(row - run.row);
}

std::string date_text(const Column& column, std::size_t row) {
  constexpr std::int64_t kNano = 1000000000, kDay = 86400;
  const double whole = std::floor(column.values[row]);
  const double rest = column.values[row] - whole + column.remainder[row];
  const auto nanoseconds =
      static_cast<std::int64_t>(std::llround(rest * static_cast<double>(kNano)));
  std::int64_t seconds = static_cast<std::int64_t>(whole), fraction = nanoseconds % kNano;
  seconds += nanoseconds / kNano;
  if (fraction < 0) --seconds, fraction += kNano;
  const std::int64_t day = (seconds - (seconds < 0 ? kDay - 1 : 0)) / kDay;
  const std::int64_t of_day = seconds - kDay * day;
  const std::chrono::year_month_day date{std::chrono::sys_days(std::chrono::days(day))};
  char text[64];
  std::string out;
  if (column.dates == Dates::instants) {
    std::snprintf(text, sizeof text, "%04d-%02u-%02u", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()));
    out = text;
    if (column.months > 0 || (of_day == 0 && fraction == 0)) return out;
    out += " ";
  }
  std::snprintf(text, sizeof text, "%02d:%02d:%02d", static_cast<int>(of_day / 3600),
                static_cast<int>(of_day / 60 % 60), static_cast<int>(of_day % 60));
  out += text;
  if (fraction == 0) return out;
  std::snprintf(text, sizeof text, ".%09lld", static_cast<long long>(fraction));
  out += text;
  while (out.back() == '0') out.pop_back();
  return out;
}

Table rows_at(const Table& table, const std::vector<std::size_t>& rows) {
  const auto taken = [&](const std::vector<double>& values) {
    std::vector<double> out;
    out.reserve(rows.size());
    if (values.empty()) return out;
    for (const std::size_t row : rows) out.push_back(values[row]);
    return out;
  };
  Table out;
  out.path = table.path;
  out.metadata = table.metadata;
  out.rows = rows.size();
  out.separator = table.separator;
  out.blanks = table.blanks;
  out.decimal_comma = table.decimal_comma;
  out.has_header = table.has_header;
  out.header_line = table.header_line;
  out.unit_line = table.unit_line;
  for (const Column& column : table.columns) {
    Column& part = out.columns.emplace_back();
    part.name = column.name;
    part.header = column.header;
    part.unit = column.unit;
    part.values = taken(column.values);
    part.remainder = taken(column.remainder);
    part.missing = static_cast<std::size_t>(std::count_if(part.values.begin(), part.values.end(),
                                                          [](double x) { return std::isnan(x); }));
    part.text_cells = column.text_cells;
    part.infinite = column.infinite;
    part.first_text = column.first_text;
    part.dates = column.dates;
    part.months = column.months;
  }
  int next = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const int line = table.line_of_row(rows[i]);
    if (line != next) out.line_runs.push_back({i, line});
    next = line + 1;
  }
  return out;
}

Table rows_of(const Table& table, std::size_t first, std::size_t count) {
  std::vector<std::size_t> rows(count);
  std::iota(rows.begin(), rows.end(), first);
  return rows_at(table, rows);
}

const Column* Table::find(const std::string& name) const {
  for (const Column& column : columns) {
    if (column.name == name) return &column;
  }
  for (const Column& column : columns) {
    if (!column.header.empty() && column.header == name) return &column;
  }
  const Column* found = nullptr;
  for (const Column& column : columns) {
    if (!csv::same_ignoring_case(column.name, name)) continue;
    if (found != nullptr) return nullptr;
    found = &column;
  }
  if (found != nullptr) return found;
  std::size_t number = 0;
  const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const bool whole = error == std::errc{} && stop == name.data() + name.size();
  return whole && number >= 1 && number <= columns.size() ? &columns[number - 1] : nullptr;
}

std::vector<std::string> Table::column_names() const {
  std::vector<std::string> names;
  for (const Column& column : columns) names.push_back(column.name);
  return names;
}

}  // namespace identikal
