#include "command/table_text.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "lib/base/median.h"
#include "lib/data/dataset.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

struct Summary {
  std::size_t present = 0;
  double min = std::nan(""), max = min, mean = min, sd = min;
  double held = 0.0;  // share of samples equal to the one before
};

template <typename Values>
Summary summarise(const Values& values) {
  Summary out;
  double sum = 0.0, squares = 0.0, held = 0.0, previous = std::nan("");
  for (const double value : values) {
    if (std::isnan(value)) continue;
    if (out.present == 0) out.min = out.max = value;
    out.min = std::min(out.min, value);
    out.max = std::max(out.max, value);
    held += value == previous ? 1.0 : 0.0;
    previous = value;
    sum += value;
    ++out.present;
  }
  if (out.present == 0) return out;
  const auto n = static_cast<double>(out.present);
  out.mean = sum / n;
  for (const double value : values) {
    if (!std::isnan(value)) squares += (value - out.mean) * (value - out.mean);
  }
  out.sd = std::sqrt(squares / n);
  out.held = held / n;
  return out;
}

bool increasing(const Column& column, const std::vector<double>& stamps) {
  return column.missing == 0 &&
         std::is_sorted(stamps.begin(), stamps.end(), std::less_equal<double>());
}

std::string time_text(const Table& table) {
  std::string other;  // of a column that looks like time and is none
  for (const Column& column : table.columns) {
    if (!looks_like_time(column) || column.values.size() < 2) continue;
    const std::vector<double> stamps = exact_stamps(column);
    if (!increasing(column, stamps)) {
      if (column.text_cells > 0 || !other.empty()) continue;
      other = fmt::format("time   '{}' does not increase from row to row\n", column.name);
      continue;
    }
    std::vector<double> steps;
    for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
    const double usual = median(steps);
    const auto gaps =
        std::count_if(steps.begin(), steps.end(), [usual](double s) { return s > 1.5 * usual; });
    const auto uneven = std::count_if(steps.begin(), steps.end(), [usual](double s) {
      return std::abs(s - usual) > 0.05 * usual && s <= 1.5 * usual;
    });
    const Unit unit = *parse_unit(time_unit(column));
    return fmt::format(
        "time   '{}': {:.6g} Hz (step {:.6g} s), {:.6g} s long, {} gaps, {} uneven steps\n",
        column.name, 1.0 / (usual * unit.scale), usual * unit.scale,
        (stamps.back() - stamps.front()) * unit.scale, gaps, uneven);
  }
  if (!other.empty()) return other;
  return "time   no column looks like time; a model gives the step: time: {kind: discrete, step: "
         "...}\n";
}

std::string remark(const Column& column, const Summary& s) {
  if (column.text_cells > 0) {
    return fmt::format("text in {} cells, first in line {}", column.text_cells,
                       column.first_text.line);
  }
  std::string out;
  if (s.present > 0 && s.min == s.max)
    out = "constant";
  else if (column.months > 0)
    out = "months from " + date_text(column, 0) + " on";
  else if (column.dates != Dates::none && column.missing == 0)
    out = date_text(column, 0) + " to " + date_text(column, column.values.size() - 1);
  else if (s.held > 0.5)
    out = fmt::format("{:.0f} % held samples", 100.0 * s.held);
  if (column.missing > 0)
    out += fmt::format("{}{} missing", out.empty() ? "" : ", ", column.missing);
  return out;
}

}  // namespace

std::string table_text(const Table& table) {
  const char* separator = table.blanks              ? "blanks"
                          : table.separator == '\t' ? "tab"
                          : table.separator == ';'  ? "semicolon"
                                                    : "comma";
  std::string out = fmt::format("{}\n", table.path);
  out += fmt::format("rows   {}, columns {}, separated by {}{}{}\n", table.rows,
                     table.columns.size(), separator, table.decimal_comma ? ", decimal comma" : "",
                     table.has_header ? "" : ", no header");
  out += time_text(table);
  std::size_t width = 8;
  for (const Column& column : table.columns)
    width = std::max(width, std::min<std::size_t>(24, column.name.size()));
  out += fmt::format("\n{:<{}} {:<7} {:>10} {:>10} {:>10} {:>10}  {}\n", "column", width, "unit",
                     "min", "max", "mean", "sd", "");
  for (const Column& column : table.columns) {
    const Summary s = summarise(column.values);
    out += fmt::format("{:<{}} {:<7} {:>10.4g} {:>10.4g} {:>10.4g} {:>10.4g}  {}", column.name,
                       width, column.unit.empty() ? "-" : column.unit, s.min, s.max, s.mean, s.sd,
                       remark(column, s));
    while (out.back() == ' ') out.pop_back();
    out += '\n';
  }
  return out;
}

std::string channels_text(const Model& model, const Dataset& data) {
  std::string out =
      fmt::format("\n{} takes {} rows, step {:.6g} s, from {:.6g} s to {:.6g} s\n", model.name,
                  data.size(), data.dt, data.time[0], data.time[data.size() - 1]);
  out += fmt::format("{:<8} {:<22} {:<8} {:>10} {:>10} {:>10} {:>8}\n", "", "channel", "unit",
                     "min", "max", "sd", "missing");
  const auto list = [&out](const char* kind, const std::vector<Channel>& channels,
                           const Eigen::MatrixXd& values) {
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const Eigen::VectorXd row = values.row(static_cast<Eigen::Index>(i)).transpose();
      const Summary s = summarise(row);
      const Unit unit = unit_or_dimensionless(channels[i].unit);
      out += fmt::format("{:<8} {:<22} {:<8} {:>10.4g} {:>10.4g} {:>10.4g} {:>8}{}\n", kind,
                         channels[i].name, channels[i].unit.empty() ? "-" : channels[i].unit,
                         unit.from_si(s.min), unit.from_si(s.max), s.sd / unit.scale,
                         static_cast<std::size_t>(row.size()) - s.present,
                         s.min == s.max ? "  constant" : "");
    }
  };
  list("input", data.inputs, data.u);
  list("output", data.outputs, data.y);
  return out;
}

}  // namespace identikal
