#include "lib/data/csv_cell.h"

#include <cmath>

#include <fmt/format.h>

namespace identikal {

std::string csv_cell(const std::string& text) {
  if (!text.starts_with('#') && text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

std::string csv_cell(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : std::string();
}

}  // namespace identikal
