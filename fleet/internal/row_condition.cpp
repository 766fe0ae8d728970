#include "fleet/internal/row_condition.h"

#include <cmath>
#include <numeric>
#include <optional>
#include <unordered_map>

#include "fleet/internal/plain_number.h"
#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/text_table.h"

namespace identikal {
namespace {

const char* const kForm = "a condition such as 'series = 17 and speed > 5'";

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t") - first + 1));
}

struct Condition {
  std::string column, sign, value;
};

Condition comparison_of(const std::string& text, const std::string& whole) {
  const std::size_t at = text.find_first_of("=!<>");
  if (at == std::string::npos) throw InputError({}, fmt::format("where '{}'", whole), kForm);
  const bool two = at + 1 < text.size() && text[at + 1] == '=';
  Condition out{trimmed(text.substr(0, at)), text.substr(at, two ? 2 : 1),
                trimmed(text.substr(at + (two ? 2 : 1)))};
  const bool quoted = out.value.size() > 1 && out.value.front() == out.value.back() &&
                      (out.value.front() == '\'' || out.value.front() == '"');
  if (quoted) out.value = out.value.substr(1, out.value.size() - 2);
  if (out.sign == "==") out.sign = "=";
  if (out.column.empty() || out.value.empty() || out.sign == "!") {
    throw InputError({}, fmt::format("where '{}'", whole), kForm);
  }
  return out;
}

std::vector<Condition> comparisons_of(const std::string& condition) {
  std::vector<Condition> out;
  for (std::size_t begin = 0; begin <= condition.size();) {
    const std::size_t end = std::min(condition.find(" and ", begin), condition.size());
    out.push_back(comparison_of(condition.substr(begin, end - begin), condition));
    begin = end + 5;
  }
  return out;
}

const Column& column_called(const std::string& name, const Table& table) {
  if (const Column* column = table.find(name)) return *column;
  throw InputError({table.path, table.header_line}, fmt::format("no column '{}'", name), "",
                   did_you_mean(name, table.column_names()));
}

bool holds(const std::string& sign, double x, double value) {
  if (std::isnan(x)) return false;
  if (sign == "=") return x == value;
  if (sign == "!=") return x != value;
  if (sign == "<") return x < value;
  if (sign == "<=") return x <= value;
  return sign == ">" ? x > value : x >= value;
}

void keep_where(const Condition& comparison, std::string_view text, const Table& table,
                std::vector<std::size_t>& rows) {
  const Column& column = column_called(comparison.column, table);
  if (const std::optional<double> value = plain_number(comparison.value)) {
    std::erase_if(
        rows, [&](std::size_t row) { return !holds(comparison.sign, column.values[row], *value); });
    return;
  }
  if (comparison.sign != "=" && comparison.sign != "!=") {
    throw InputError({},
                     fmt::format("where '{} {}' with a text", comparison.column, comparison.sign),
                     "= or !=");
  }
  const std::vector<std::string> cells = written_cells(text, table, column);
  std::erase_if(rows, [&](std::size_t row) {
    const bool same = cells[row] == comparison.value;
    return cells[row].empty() || same != (comparison.sign == "=");
  });
}

}  // namespace

std::vector<std::size_t> rows_where(const std::string& condition, std::string_view text,
                                    const Table& table) {
  std::vector<std::size_t> rows(table.rows);
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  if (condition.empty()) return rows;
  for (const Condition& comparison : comparisons_of(condition)) {
    keep_where(comparison, text, table, rows);
  }
  if (rows.empty()) {
    throw InputError({table.path}, fmt::format("no row where {}", condition), "some");
  }
  return rows;
}

std::vector<RowGroup> groups_by(const std::string& column, std::string_view text,
                                const Table& table, const std::vector<std::size_t>& rows) {
  const std::vector<std::string> cells = written_cells(text, table, column_called(column, table));
  std::vector<RowGroup> out;
  std::unordered_map<std::string_view, std::size_t> known;
  for (const std::size_t row : rows) {
    if (cells[row].empty()) {
      throw InputError({table.path, table.line_of_row(row)},
                       fmt::format("nothing in column '{}'", column), "whose row it is");
    }
    const auto [at, is_new] = known.try_emplace(cells[row], out.size());
    if (is_new) out.push_back({cells[row], {}});
    out[at->second].rows.push_back(row);
  }
  return out;
}

}  // namespace identikal
