#include "lib/data/join.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "lib/base/interpolation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

std::string stem(const std::string& path) { return std::filesystem::path(path).stem().string(); }

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

std::string to_four_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

// The time column of one of the files: named by the model, else by its looks.
TimeSource time_of(const Table& table, TimeSource time, bool first) {
  if (!time.column.empty() && (first || table.find(time.column) != nullptr)) return time;
  for (const Column& column : table.columns) {
    if (!looks_like_time(column) || column.text_cells > 0) continue;
    time.column = column.name;
    time.unit = time_unit(column);
    return time;
  }
  throw InputError(
      {table.path, table.header_line}, "no time column",
      "one in every file that is joined, to tell which samples belong together",
      time.column.empty() ? "name it 'time' or 't'" : "name it " + quoted_excerpt(time.column));
}

Eigen::Map<const VectorXd> values_of(const Column& column) {
  return {column.values.data(), static_cast<Index>(column.values.size())};
}

}  // namespace

std::vector<std::string> joined_files(const std::string& argument) {
  std::vector<std::string> pieces(1);
  for (const char c : argument) {
    if (c == '+') {
      pieces.emplace_back();
    } else {
      pieces.back() += c;
    }
  }
  std::error_code ignored;
  if (pieces.size() == 1 || std::filesystem::exists(argument, ignored)) return {argument};
  std::vector<std::string> files;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    // The shortest name that exists, so that a '+' may be part of it.
    std::string name = pieces[i];
    std::size_t last = i;
    while (!std::filesystem::is_regular_file(name, ignored) && last + 1 < pieces.size()) {
      name += "+" + pieces[++last];
    }
    if (std::filesystem::is_regular_file(name, ignored)) {
      i = last;
    } else {
      name = pieces[i];
    }
    if (name.empty()) {
      throw InputError({}, "a '+' without a file beside it in " + quoted_excerpt(argument),
                       "FILE+FILE+..., files of one recording");
    }
    files.push_back(name);
  }
  return files;
}

namespace {

std::string rate(const VectorXd& t) { return to_four_digits(1.0 / own_period(t, t)) + " Hz"; }

std::string span(const VectorXd& t) {
  return to_four_digits(t[0]) + " s to " + to_four_digits(t[t.size() - 1]) + " s";
}

void require_two(const Table& table, const VectorXd& t) {
  if (t.size() < 2) {
    throw InputError({table.path}, "a single row", "at least two, to be joined with other files");
  }
}

// The columns of file f of the recording, at the times of the first one.
void join_columns(const Table& first, const VectorXd& at, const Table& table, std::size_t f,
                  const TimeSource& own, Joined& out) {
  const VectorXd t = time_stamps(table, own);
  require_two(table, t);
  if (t[0] > at[at.size() - 1] || t[t.size() - 1] < at[0]) {
    throw InputError({table.path},
                     "times from " + span(t) + ", " + file_name(first.path) + " has " + span(at),
                     "files that have some time in common",
                     "do their clocks start at different times, or are they in other units?");
  }
  const Column* stamps = table.find(own.column);
  std::string names;
  std::size_t lost = 0;
  for (const Column& column : table.columns) {
    if (&column == stamps) continue;
    Column joined = column;
    joined.remainder.clear();
    joined.dates = Dates::none;
    if (holds_numbers(column)) {
      const VectorXd x = interpolate_linearly(t, values_of(column), at,
                                              kBridgedPeriods * own_period(t, values_of(column)));
      joined.values.assign(x.begin(), x.end());
      joined.missing = static_cast<std::size_t>(x.array().isNaN().count());
      lost = std::max(lost, joined.missing);
      names += (names.empty() ? "" : ", ") + column.name;
    } else {
      joined.values.resize(first.rows, std::nan(""));
      joined.missing = first.rows;
    }
    out.table.columns.push_back(std::move(joined));
    out.file.push_back(f);
  }
  std::string note =
      names + " interpolated linearly from " + file_name(table.path) + " (" + rate(t) + ")";
  if (lost > 0) {
    note += "; up to " + std::to_string(lost) + " of " + std::to_string(first.rows) +
            " rows lie outside its samples or in its gaps";
  }
  out.notes.push_back(note);
  out.table.path += "+" + file_name(table.path);
}

// Columns of one name get the names of their files before it; the first file's time keeps its own.
void tell_columns_apart(const std::vector<Table>& tables, const std::string& stamps, Joined& out) {
  std::vector<Column>& columns = out.table.columns;
  const std::vector<std::string> names = out.table.column_names();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const bool alone = std::count(names.begin(), names.end(), names[i]) == 1;
    if (alone || (out.file[i] == 0 && names[i] == stamps)) continue;
    const std::string& path = tables[out.file[i]].path;
    columns[i].name = stem(path) + "." + names[i];
    columns[i].header.clear();
    for (std::size_t j = 0; j < i; ++j) {
      if (columns[j].name != columns[i].name) continue;
      throw InputError({path},
                       "column " + quoted_excerpt(names[i]) + " is in two files called " +
                           quoted_excerpt(stem(path)),
                       "files with different names, to tell their columns apart");
    }
  }
}

}  // namespace

Joined join_tables(const std::vector<Table>& tables, const TimeSource& time) {
  Joined out;
  out.table = tables.at(0);
  out.file.assign(out.table.columns.size(), 0);
  if (tables.size() == 1) return out;

  const Table& first = tables.front();
  const TimeSource own = time_of(first, time, true);
  const VectorXd at = time_stamps(first, own);
  require_two(first, at);
  out.notes.push_back("rows and times are those of " + file_name(first.path) + " (" + rate(at) +
                      ")");
  for (std::size_t f = 1; f < tables.size(); ++f) {
    join_columns(first, at, tables[f], f, time_of(tables[f], time, false), out);
  }
  tell_columns_apart(tables, first.find(own.column)->name, out);
  return out;
}

}  // namespace identikal
