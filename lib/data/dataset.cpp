#include "lib/data/dataset.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/base/nearest_name.h"
#include "lib/data/internal/sampling_grid.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;

// The shortest text that reads back as the same number: an epoch time keeps its fraction.
std::string number(double value) {
  std::array<char, 32> text;
  const auto [stop, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} ? std::string(text.data(), stop) : "?";
}

// Measured and derived numbers: the digits beyond the sixth are rounding.
std::string rounded(double value) {
  std::array<char, 32> text;
  const auto [stop, error] =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 6);
  return error == std::errc{} ? std::string(text.data(), stop) : "?";
}

std::string file_name(const Table& table) {
  return std::filesystem::path(table.path).filename().string();
}

// The model file's line when the model came from a file, else the recording.
Location place(const Location& at, const Table& table) {
  return at.path.empty() ? Location{table.path} : at;
}

const Column& find_any_column(const Table& table, const std::string& name, const Location& at) {
  const Column* column = table.find(name);
  if (column == nullptr) {
    const std::vector<std::string> names = table.column_names();
    const std::string ending = "." + name;  // of a column that several joined files have
    std::string several;
    int files = 0;
    for (const std::string& known : names) {
      if (!known.ends_with(ending)) continue;
      several += (files++ > 0 ? ", " : "") + quoted_excerpt(known);
    }
    if (files > 1) {
      throw InputError(place(at, table), "column " + quoted_excerpt(name) + " is in several files",
                       several, "write which one is meant");
    }
    if (name.find_first_not_of("0123456789") == std::string::npos) {
      throw InputError(place(at, table),
                       "no column " + quoted_excerpt(name) + " in " + file_name(table),
                       "a name or 1 to " + std::to_string(names.size()));
    }
    std::string list;
    std::size_t shown = 0;
    for (; shown < names.size() && list.size() < 80; ++shown) {
      list += (shown > 0 ? ", " : "") + quoted_excerpt(names[shown]);
    }
    if (shown < names.size()) list += ", ... (" + std::to_string(names.size()) + " columns)";
    throw InputError(place(at, table),
                     "no column " + quoted_excerpt(name) + " in " + file_name(table),
                     "one of " + list, did_you_mean(name, names));
  }
  return *column;
}

const Column& find_column(const Table& table, const std::string& name, const Location& at) {
  const Column& column = find_any_column(table, name, at);
  if (holds_numbers(column)) return column;
  const TextCell& text = column.first_text;
  throw InputError(
      {table.path, text.line, text.column},
      quoted_excerpt(text.text) + " in column " + quoted_excerpt(column.name), "a number",
      column.dates == Dates::ambiguous
          ? "as a date it may be two days: write it as 2024-01-31, or 31-Jan-2024"
      : column.dates != Dates::none ? "dates are times: 'time: {column: " + column.name + "}'"
                                    : "");
}

// Where dates have been made numbers.
const Column& find_dates_or_numbers(const Table& table, const std::string& name,
                                    const Location& at) {
  const Column& column = find_any_column(table, name, at);
  return column.text_cells > 0 ? find_column(table, name, at) : column;
}

Unit known_unit(const std::string& text, const Location& at, const std::string& context,
                const std::string& remedy) {
  if (const std::optional<Unit> unit = parse_unit(text)) return *unit;
  const std::string nearest = nearest_unit(text);
  std::string hint = nearest.empty() ? "" : "did you mean " + quoted_excerpt(nearest) + "?";
  if (!remedy.empty()) hint += (hint.empty() ? "" : " ") + remedy;
  throw InputError(at, "unknown unit " + quoted_excerpt(text) + context, "", hint);
}

struct ResolvedUnit {
  Unit unit;
  std::string text;
  std::string doubt;  // about a unit in the file that nobody knows, and the model overrules
};

// The unit of a column: the model's, else the file's, else SI. It must measure what `si_text` does.
ResolvedUnit resolve_unit(const Table& table, const Column& column, const std::string& model_text,
                          const std::string& si_text, const Location& at) {
  if (model_text.empty() && column.unit.empty()) return {Unit{}, si_text, ""};
  const Location model_at = place(at, table);
  const std::string of_column = " of column " + quoted_excerpt(column.name);
  const std::string& text = model_text.empty() ? column.unit : model_text;
  Unit unit;
  std::string doubt;
  if (model_text.empty()) {
    const Location header{table.path, table.unit_line > 0 ? table.unit_line : table.header_line};
    unit = known_unit(text, header, of_column, "give its 'unit:' in the model file");
  } else {
    unit = known_unit(text, model_at, of_column, "");
    const std::optional<Unit> in_file = parse_unit(column.unit);
    const bool conflict = !column.unit.empty() && in_file &&
                          !(same_dimension(unit, *in_file) && unit.offset == in_file->offset &&
                            std::abs(unit.scale / in_file->scale - 1.0) < 1e-9);
    if (conflict) {
      throw InputError(model_at,
                       "column " + quoted_excerpt(column.name) + " is in " +
                           quoted_excerpt(column.unit) + " according to " + file_name(table) +
                           ", in " + quoted_excerpt(text) + " according to the model",
                       "one unit", "remove the 'unit:' here, or the unit in the file's header");
    }
    if (!column.unit.empty() && !in_file) {
      doubt = file_name(table) + ": unknown unit " + quoted_excerpt(column.unit) + of_column +
              "; taken as " + quoted_excerpt(text) + ", as the model file says";
    }
  }
  if (!si_text.empty()) {
    const std::optional<Unit> si = parse_unit(si_text);
    if (!si) throw std::invalid_argument("make_dataset: '" + si_text + "' is not a unit");
    if (!same_dimension(unit, *si)) {
      throw InputError(model_at,
                       "column " + quoted_excerpt(column.name) + " is in " + quoted_excerpt(text) +
                           ", which measures something else",
                       "a unit of the same kind as " + quoted_excerpt(si_text));
    }
  }
  return {unit, text, doubt};
}

// Time stamps in the unit of the column: converting first would cost digits of an epoch time.
struct Stamps {
  std::size_t at_rest = 0;  // the last so many were infinite: a step each behind the others
  std::vector<double> values;
  double to_seconds = 1.0;
  bool from_first = false;  // the values count from the first stamp
};

// Taken as seconds they would be off by 1000 and more.
void refuse_missing_unit(const Table& table, const Column& column, const Location& at) {
  const std::string unit = time_unit(column);
  if (unit == "s" || !column.unit.empty()) return;
  throw InputError(place(at, table),
                   "column " + quoted_excerpt(column.name) + " has no unit, and is in " + unit +
                       " by its name or as a time since 1970",
                   "'unit: " + unit + "' beside the column, or 'unit: s'");
}

// Its text, if any, may be times that are infinite.
const Column& find_stamps(const Table& table, const TimeSource& source) {
  const Column& column = find_any_column(table, source.column, source.at);
  const TextCell& text = column.first_text;
  if (column.text_cells != column.infinite) return find_column(table, source.column, source.at);
  if (column.infinite > 0 && !source.infinite) {
    throw InputError({table.path, text.line, text.column},
                     quoted_excerpt(text.text) + " in column " + quoted_excerpt(column.name),
                     "a number",
                     "'infinity: steady-state' under 'time' in a model of formulas makes it the "
                     "time at which the motion has come to rest");
  }
  if (column.infinite > 0 && column.infinite != column.missing) {
    throw InputError({table.path, text.line, text.column},
                     quoted_excerpt(text.text) + " in column " + quoted_excerpt(column.name) +
                         ", where other rows have no time",
                     "a time for every row");
  }
  return column;
}

// What comes last at infinity, a usual step each behind the rows before. @return how many rows
std::size_t take_rest(const Table& table, const Column& column, std::vector<double>& t) {
  const std::size_t finite = t.size() - column.infinite;
  if (column.infinite == 0) return 0;
  const Location at{table.path, table.line_of_row(finite)};
  if (std::any_of(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(finite),
                  [](double stamp) { return std::isnan(stamp); })) {
    throw InputError({table.path, column.first_text.line, column.first_text.column},
                     "time inf before other times", "increasing time stamps");
  }
  const double step = finite < 2 ? 0.0 : median_step(t.data(), t.data() + finite);
  if (!(step > 0.0)) {
    throw InputError(at, "time inf behind fewer than two other times",
                     "at least two to begin with");
  }
  for (std::size_t row = finite; row < t.size(); ++row) t[row] = t[row - 1] + step;
  return t.size() - finite;
}

Stamps read_stamps(const Table& table, const TimeSource& source) {
  const Column& column = find_stamps(table, source);
  if (source.unit.empty()) refuse_missing_unit(table, column, source.at);
  const ResolvedUnit unit = resolve_unit(table, column, source.unit, "s", source.at);
  std::vector<double> t = exact_stamps(column);
  const std::size_t at_rest = take_rest(table, column, t);
  for (std::size_t row = 0; row < t.size(); ++row) {
    const Location at{table.path, table.line_of_row(row)};
    const auto stamp = [&](std::size_t k) {
      return column.dates == Dates::none ? number(t[k]) + " " + unit.text : date_text(column, k);
    };
    if (std::isnan(t[row])) {
      throw InputError(at, "no time stamp in column " + quoted_excerpt(column.name), "a number");
    }
    if (row == 0 || t[row] > t[row - 1]) continue;
    if (t[row] == t[row - 1] && source.replicates) continue;
    if (t[row] == t[row - 1]) {
      throw InputError(at, "time " + stamp(row) + " is a duplicate", "increasing time stamps",
                       "remove one of the two rows");
    }
    throw InputError(at, "time goes back from " + stamp(row - 1) + " to " + stamp(row),
                     "increasing time stamps",
                     "recordings joined end to end: 'runs: restart' under 'time' in the model file "
                     "makes each a separate run");
  }
  return {at_rest, t, unit.unit.scale, !column.remainder.empty()};
}

// Of rows with one time, each behind the one before by so little that nothing happens meanwhile.
void part_replicates(Dataset& data) {
  constexpr double kShare = 1e-9;  // of the shortest step
  double shortest = kInfinity;
  Index equal = 0;
  for (Index k = 1; k < data.size(); ++k) {
    const double step = data.time[k] - data.time[k - 1];
    equal += step == 0.0;
    if (step > 0.0) shortest = std::min(shortest, step);
  }
  if (equal == 0) return;
  data.stamps = data.time;
  const double least =
      8.0 * std::numeric_limits<double>::epsilon() * data.time.cwiseAbs().maxCoeff();
  const double apart = std::max(kShare * shortest, least);
  for (Index k = 1; k < data.size(); ++k) {
    if (data.stamps[k] == data.stamps[k - 1]) data.time[k] = data.time[k - 1] + apart;
  }
  data.notes.push_back(data.name + ": " + std::to_string(equal) +
                       " rows have the time of the row before, and count as measured again then");
}

// Rows [first, last) of the table.
struct Rows {
  std::size_t first;
  std::size_t last;
};

// What the model file does to the recorded values, in words; empty when nothing.
std::string treatment(const ChannelSource& source, const std::string& unit) {
  std::string out;
  if (source.scale != 1.0) out += " times " + number(source.scale);
  if (source.offset != 0.0) {
    out += (source.offset > 0.0 ? " plus " : " minus ") + number(std::abs(source.offset)) +
           (unit.empty() ? "" : " " + unit);
  }
  if (source.delay != 0.0) {
    out += (out.empty() ? " " : ", ") + number(std::abs(source.delay)) + " s " +
           (source.delay > 0.0 ? "earlier" : "later") + ", interpolated linearly";
  }
  return out.empty() ? "" : source.name + " is column " + quoted_excerpt(source.column) + out;
}

void take_logarithms(const Table& table, const ChannelSource& source, const Rows& rows,
                     Eigen::VectorXd& values) {
  const auto wrong = std::find_if(values.begin(), values.end(), [](double y) { return y <= 0.0; });
  if (wrong != values.end()) {
    const auto row = rows.first + static_cast<std::size_t>(wrong - values.begin());
    throw InputError({table.path, table.line_of_row(row)},
                     "column " + quoted_excerpt(source.column) + " is " + number(*wrong) +
                         ", and its logarithm is to be taken",
                     "values above 0, or an empty cell");
  }
  for (double& y : values) y = transformed(source.transform, y);
}

Eigen::RowVectorXd read_channel(const Table& table, const ChannelSource& source,
                                const Stamps& stamps, const Rows& rows, Channel& channel,
                                Dataset& data) {
  if (source.value) {
    channel = {source.name, source.unit, true};
    return Eigen::RowVectorXd::Constant(static_cast<Index>(rows.last - rows.first), *source.value);
  }
  const Column& column = find_column(table, source.column, source.at);
  const ResolvedUnit unit = resolve_unit(table, column, source.unit, source.si_unit, source.at);
  channel = {source.name, unit.text};
  if (const std::string text = treatment(source, unit.text); !text.empty()) {
    data.notes.push_back(text);
  }
  if (!unit.doubt.empty()) data.unknown_units.push_back(unit.doubt);
  const auto first = static_cast<Index>(rows.first), count = static_cast<Index>(rows.last) - first;
  const Eigen::Map<const Eigen::VectorXd> recorded(column.values.data(),
                                                   static_cast<Index>(column.values.size()));
  Eigen::VectorXd values = recorded.segment(first, count);
  if (source.empty_is_zero) values = values.array().isNaN().select(0.0, values);
  if (source.delay != 0.0) {
    const Eigen::Map<const Eigen::VectorXd> t(stamps.values.data(), recorded.size());
    if ((t.tail(t.size() - 1).array() == t.head(t.size() - 1).array()).any()) {
      throw InputError(source.at, "a delay of '" + source.name + "' beside rows that have one time",
                       "a time for every row, or no delay");
    }
    const Eigen::VectorXd seconds = (t.array() - t[0]) * stamps.to_seconds;
    values = interpolate_linearly(seconds, recorded,
                                  seconds.segment(first, count).array() + source.delay,
                                  kBridgedPeriods * own_period(seconds, recorded));
  }
  // Neutral scale and offset leave the bits alone.
  if (source.scale != 1.0 || source.offset != 0.0) {
    values = source.scale * values.array() + source.offset;
  }
  for (double& value : values) value = unit.unit.to_si(value);
  if (source.transform != Transform::none) {
    channel.unit.clear();
    channel.transform = source.transform;
    take_logarithms(table, source, rows, values);
  }
  return values.transpose();
}

void refuse_without_numbers(const Table& table, const ChannelSource& source, const Rows& rows,
                            const Eigen::RowVectorXd& values) {
  if (!values.array().isNaN().all()) return;
  const Column& column = find_column(table, source.column, source.at);
  if (source.delay != 0.0) {
    throw InputError(place(source.at, table),
                     "no number of column " + quoted_excerpt(column.name) + " is left after a " +
                         "delay of " + number(source.delay) + " s",
                     "a delay shorter than the recording");
  }
  throw InputError({table.path, table.line_of_row(rows.first)},
                   "no number in column " + quoted_excerpt(column.name) +
                       " from this row to line " + std::to_string(table.line_of_row(rows.last - 1)),
                   "at least one");
}

// Nothing where there is none to compare with: the note says so.
Eigen::MatrixXd read_references(const Table& table, const std::vector<ChannelSource>& sources,
                                const Stamps& stamps, const Rows& rows, Dataset& data) {
  const auto n = static_cast<Index>(rows.last - rows.first);
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Constant(static_cast<Index>(sources.size()), sources.empty() ? 0 : n, kNaN);
  for (std::size_t i = 0; i < sources.size(); ++i) {
    data.references.push_back({sources[i].name, sources[i].unit});
    // In several joined files it has a name in each, and find_column() asks which.
    const std::vector<std::string> names = table.column_names();
    const bool there = table.find(sources[i].column) != nullptr ||
                       std::any_of(names.begin(), names.end(), [&](const std::string& known) {
                         return known.ends_with("." + sources[i].column);
                       });
    auto row = out.row(static_cast<Index>(i));
    if (there) row = read_channel(table, sources[i], stamps, rows, data.references[i], data);
    if (!row.array().isNaN().all()) continue;
    data.notes.push_back("nothing to compare " + sources[i].name + " with: column " +
                         quoted_excerpt(sources[i].column) +
                         (there ? " has no number here" : " is not in " + data.name));
  }
  return out;
}

}  // namespace

namespace {

std::vector<std::string> words_in(const std::string& text) {
  std::vector<std::string> out(1);
  for (const char c : lower_case(text)) {
    const bool letter = std::isalnum(static_cast<unsigned char>(c)) != 0;
    if (letter) out.back() += c;
    if (!letter && !out.back().empty()) out.emplace_back();
  }
  if (out.back().empty()) out.pop_back();
  return out;
}

// Between 1973 and 2286, counted from 1970.
std::string epoch_unit(double stamp) {
  for (const auto& [unit, second] : {std::pair{"ms", 1e3}, {"us", 1e6}, {"ns", 1e9}}) {
    if (stamp >= 1e8 * second && stamp < 1e10 * second) return unit;
  }
  return "s";
}

bool is_time_unit(const std::string& text) {
  const std::optional<Unit> unit = parse_unit(text);
  return !text.empty() && unit && same_dimension(*unit, *parse_unit("s"));
}

}  // namespace

bool looks_like_time(const Column& column) {
  if (column.dates == Dates::instants || column.dates == Dates::times_of_day) return true;
  const std::vector<std::string> words = words_in(column.name);
  if (words.empty()) return false;
  if (words.front() == "t")
    return words.size() == 1 || (words.size() == 2 && is_time_unit(words[1]));
  return lower_case(column.name).find("time") != std::string::npos;
}

std::string time_unit(const Column& column) {
  if (is_time_unit(column.unit)) return column.unit;
  for (const std::string& text : {column.unit, column.name}) {
    const std::vector<std::string> words = words_in(text);
    if (words.size() > 1 && is_time_unit(words.back())) return words.back();
  }
  return column.values.empty() ? "s" : epoch_unit(column.values.front());
}

std::vector<double> exact_stamps(const Column& column) {
  std::vector<double> out = column.values;
  if (column.remainder.empty() || out.empty()) return out;
  for (std::size_t row = out.size(); row-- > 0;) {
    out[row] = (out[row] - out[0]) + (column.remainder[row] - column.remainder[0]);
  }
  return out;
}

Eigen::VectorXd time_stamps(const Table& table, const TimeSource& time) {
  Stamps stamps = read_stamps(table, time);
  if (stamps.from_first) stamps.values = find_dates_or_numbers(table, time.column, time.at).values;
  return stamps.to_seconds * Eigen::Map<const Eigen::VectorXd>(
                                 stamps.values.data(), static_cast<Index>(stamps.values.size()));
}

TimeRange::TimeRange() : from(-kInfinity), to(kInfinity) {}

std::vector<Table> split_runs(const Table& table, const TimeSource& time) {
  const Column* stamps = time.restarts ? table.find(time.column) : nullptr;
  if (stamps == nullptr) return {table};  // a missing column is reported where the dataset is made
  std::vector<Table> out;
  std::size_t first = 0;
  for (std::size_t row = 1; row <= table.rows; ++row) {
    const auto goes_on = [&] {
      const double now = stamps->values[row], before = stamps->values[row - 1];
      return time.replicates ? !(now < before) : !(now <= before);
    };
    if (row < table.rows && goes_on()) continue;
    if (row - first == 1 && table.rows > 1) {
      throw InputError(
          {table.path, table.line_of_row(first)},
          row < table.rows ? "a run of this row alone: the next time stamp is not above it"
                           : "a run of this row alone: the time stamp is not above the "
                             "one before, and nothing follows",
          "at least two rows in a run", "is a stamp written twice, or a row out of place?");
    }
    out.push_back(rows_of(table, first, row - first));
    first = row;
  }
  return out;
}

namespace {

std::string first_stamp_in_words(const Column& column) {
  const bool is_date = column.dates != Dates::none;
  std::string out = "time counts from the first stamp, ";
  out += is_date ? date_text(column, 0)
                 : std::to_string(static_cast<std::int64_t>(column.values[0]) +
                                  static_cast<std::int64_t>(column.remainder[0]));
  if (column.months == 0) return out;
  const std::string each = column.months == 1 ? "" : std::to_string(column.months) + " ";
  return out + ", and " + each + (column.months == 1 ? "a month" : "months") +
         " from row to row, each 30.436875 d";
}

}  // namespace

Dataset make_dataset(const Table& table, const TimeSource& time,
                     const std::vector<ChannelSource>& inputs,
                     const std::vector<ChannelSource>& outputs, const TimeRange& range,
                     const std::vector<ChannelSource>& references) {
  if (table.rows == 0) throw InputError({table.path}, "no rows", "at least one row of numbers");
  Stamps stamps;
  if (!time.column.empty()) {
    stamps = read_stamps(table, time);
  } else {
    if (!(time.step > 0.0)) {
      throw InputError(place(time.at, table), "neither a time column nor a time step",
                       "one of them");
    }
    stamps.to_seconds = time.step;
    for (std::size_t row = 0; row < table.rows; ++row) {
      stamps.values.push_back(static_cast<double>(row));
    }
  }

  // A bound that falls on a row takes the row in, whatever the rounding of its stamp.
  const std::vector<double>& t = stamps.values;
  const auto seconds = [&](double stamp) { return (stamp - t.front()) * stamps.to_seconds; };
  const double slack =
      t.size() < 2 ? 0.0 : 1e-6 * seconds(t.back()) / static_cast<double>(t.size());
  const auto first =
      std::find_if(t.begin(), t.end(), [&](double s) { return seconds(s) >= range.from - slack; });
  const auto last =
      std::find_if(first, t.end(), [&](double s) { return seconds(s) > range.to + slack; });
  const Rows rows{static_cast<std::size_t>(first - t.begin()),
                  static_cast<std::size_t>(last - t.begin())};
  if (rows.first == rows.last) {
    throw InputError({table.path},
                     "no row from " + rounded(range.from) + " s to " + rounded(range.to) + " s",
                     "a range within 0 s to " + rounded(seconds(t.back())) + " s");
  }

  Dataset data;
  data.name = file_name(table);
  data.dt = time.step;
  if (!time.column.empty()) {
    if (rows.last - rows.first < 2) {
      throw InputError({table.path, table.line_of_row(rows.first)}, "a single time stamp",
                       "at least two, to tell the step");
    }
    const double median =
        median_step(t.data() + rows.first, t.data() + rows.last) * stamps.to_seconds;
    if (!(median > 0.0)) {
      throw InputError({table.path, table.line_of_row(rows.first)}, "all rows have one time stamp",
                       "at least two, to tell the step");
    }
    const double step = time.step / stamps.to_seconds;
    const bool absent = time.rows_absent && time.step > 0.0 &&
                        on_some_of_grid(t.data() + rows.first, t.data() + rows.last, step);
    if (time.step > 0.0 && !absent && std::abs(median - time.step) > 0.01 * time.step) {
      throw InputError(place(time.at, table),
                       "the rows of " + data.name + " are " + rounded(median) + " s apart (median)",
                       rounded(time.step) + " s, the step of the model");
    }
    if (!(time.step > 0.0)) data.dt = median;
  }

  const auto n = static_cast<Index>(rows.last - rows.first);
  data.time = stamps.to_seconds * Eigen::Map<const Eigen::VectorXd>(t.data() + rows.first, n);
  if (stamps.from_first) {
    const Column& column = find_dates_or_numbers(table, time.column, time.at);
    data.notes.push_back(data.name + ": " + first_stamp_in_words(column));
  }
  const auto read_all = [&](const std::vector<ChannelSource>& sources,
                            std::vector<Channel>& channels) {
    channels.resize(sources.size());
    Eigen::MatrixXd values(static_cast<Index>(sources.size()), n);
    for (std::size_t i = 0; i < sources.size(); ++i) {
      values.row(static_cast<Index>(i)) =
          read_channel(table, sources[i], stamps, rows, channels[i], data);
      refuse_without_numbers(table, sources[i], rows, values.row(static_cast<Index>(i)));
    }
    return values;
  };
  data.u = read_all(inputs, data.inputs);
  data.y = read_all(outputs, data.outputs);
  data.reference = read_references(table, references, stamps, rows, data);
  if (time.replicates) part_replicates(data);
  const std::size_t finite = t.size() - stamps.at_rest;
  if (rows.last > finite) {
    if (data.stamps.size() == 0) data.stamps = data.time;
    data.stamps.tail(static_cast<Index>(rows.last - finite)).setConstant(kInfinity);
  }
  return data;
}

Index first_at_rest(const Dataset& data) {
  Index out = data.size();
  while (out > 0 && data.stamps.size() == data.size() && data.stamps[out - 1] == kInfinity) --out;
  return out;
}

Eigen::VectorXd log_jacobian(const Dataset& data) {
  Eigen::VectorXd out;
  for (std::size_t i = 0; i < data.outputs.size(); ++i) {
    const Transform transform = data.outputs[i].transform;
    if (transform == Transform::none) continue;
    if (out.size() == 0) out.setZero(data.size());
    for (Index k = 0; k < data.size(); ++k) {
      const double z = data.y(static_cast<Index>(i), k);
      if (!std::isnan(z)) out[k] += log_slope(transform, z);
    }
  }
  return out;
}

Dataset first_samples(const Dataset& data, Index count) {
  const Index keep = std::min(count, data.size());
  Dataset out = data;
  out.time.conservativeResize(keep);
  if (out.stamps.size() > 0) out.stamps.conservativeResize(keep);
  std::erase_if(out.absent, [&](Index row) { return row >= keep; });
  out.u.conservativeResize(Eigen::NoChange, keep);
  out.y.conservativeResize(Eigen::NoChange, keep);
  if (out.noise_scale.rows() > 0) out.noise_scale.conservativeResize(Eigen::NoChange, keep);
  if (out.reference.rows() > 0) out.reference.conservativeResize(Eigen::NoChange, keep);
  return out;
}

Dataset samples_from(const Dataset& data, Index first) {
  const Index keep = std::max<Index>(0, data.size() - first);
  Dataset out = data;
  if (first > 0) {  // that start is the first row's
    out.start_mean.resize(0);
    out.start_covariance.resize(0, 0);
  }
  out.time = data.time.tail(keep);
  if (data.stamps.size() > 0) out.stamps = data.stamps.tail(keep);
  std::erase_if(out.absent, [&](Index row) { return row < first; });
  for (Index& row : out.absent) row -= first;
  out.u = data.u.rightCols(keep);
  out.y = data.y.rightCols(keep);
  if (data.noise_scale.rows() > 0) out.noise_scale = data.noise_scale.rightCols(keep);
  if (data.reference.rows() > 0) out.reference = data.reference.rightCols(keep);
  return out;
}

bool has_rows_absent(const Eigen::VectorXd& time, double step) {
  return on_some_of_grid(time.data(), time.data() + time.size(), step);
}

Dataset on_uniform_grid(const Dataset& data, double step, double tolerance) {
  if (!(step > 0.0) || !std::isfinite(step)) {
    throw std::invalid_argument("on_uniform_grid: step " + number(step) + ", not in (0, inf)");
  }
  const Index n = data.size();
  const double most = 10.0 * static_cast<double>(n);
  std::vector<Index> target(static_cast<std::size_t>(n), 0);
  double k = 0.0;  // a double, so that an absurd gap cannot overflow it
  for (Index i = 1; i < n; ++i) {
    const double steps = (data.time[i] - data.time[i - 1]) / step;
    const double whole = std::round(steps);
    if (!(whole >= 1.0 && std::abs(steps - whole) <= tolerance)) {
      const double grid = grid_of(data.time.data(), data.time.data() + n);
      throw InputError(
          {data.name},
          "time " + number(data.time[i]) + " s is " + rounded(steps) +
              " steps after the row before",
          "a whole number of steps of " + rounded(step) + " s",
          grid > 0.0 ? "the stamps are on a grid of " + rounded(grid) +
                           " s with rows absent: 'step: " + rounded(grid) +
                           " s' under 'time' in the model file takes them so"
                     : "resample the recording; or, in continuous time, 'sampling: irregular'");
    }
    k += whole;
    if (k + 1.0 > most) {
      throw InputError({data.name},
                       "rows with a step of " + rounded(step) + " s up to time " +
                           number(data.time[i]) + " s would be more than ten times the " +
                           std::to_string(n) + " recorded",
                       "a recording without such gaps", "choose a range without the gap");
    }
    target[i] = static_cast<Index>(k);
  }

  Dataset out = data;
  out.dt = step;
  const Index rows = n == 0 ? 0 : target.back() + 1;
  out.time.resize(rows);
  for (Index i = 0; i < rows; ++i) out.time[i] = data.time[0] + static_cast<double>(i) * step;
  out.stamps.resize(rows);
  for (Index i = 0, at = 0; at < rows; ++at) {
    if (i + 1 < n && target[i + 1] == at) ++i;
    const Index absent = at - target[i];
    out.stamps[at] = data.time[i] + static_cast<double>(absent) * step;
    if (absent > 0) out.absent.push_back(at);
  }
  out.u = Eigen::MatrixXd::Constant(data.u.rows(), rows, kNaN);
  out.y = Eigen::MatrixXd::Constant(data.y.rows(), rows, kNaN);
  const bool scaled = data.noise_scale.rows() > 0;
  if (scaled) out.noise_scale = Eigen::MatrixXd::Ones(data.y.rows(), rows);
  const bool referenced = data.reference.rows() > 0;
  if (referenced) out.reference = Eigen::MatrixXd::Constant(data.reference.rows(), rows, kNaN);
  for (Index i = 0; i < n; ++i) {
    const Index at = target[i];
    if (referenced) out.reference.col(at) = data.reference.col(i);
    if (scaled) out.noise_scale.col(at) = data.noise_scale.col(i);
    out.u.col(at) = data.u.col(i);
    out.y.col(at) = data.y.col(i);
  }
  return out;
}

}  // namespace identikal
