// Readers of text: what cannot be read is refused in one line, what can be read holds together.
#include <cstdlib>
#include <string>

#include "identify/model/model_file.h"
#include "identify/model/yaml_reader.h"
#include "identify/result/estimated_model.h"
#include "identify/result/export.h"
#include "identify/result/file.h"
#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "tests/fuzz/targets.h"

namespace identikal::fuzz {
namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

// A tree is no deeper and no larger than the reader says, and each scalar's place is one of the text.
std::size_t nodes_of(const YamlNode& node, std::size_t depth) {
  require(depth < 100);
  if (node.kind == YamlNode::Kind::mapping) require(node.keys.size() == node.items.size());
  std::size_t count = 1;
  for (const YamlNode& item : node.items) count += nodes_of(item, depth + 1);
  return count;
}

// Whatever job() asks for in vain is refused in one line.
template <typename Job>
void refused_or_done(const Job& job) {
  try {
    job();
  } catch (const InputError& error) {
    require_one_line(error.what());
  }
}

}  // namespace

void csv(std::string_view bytes) {
  refused_or_done([&] {
    const Table table = parse_csv(std::string(bytes), "data.csv");
    for (const Column& column : table.columns) {
      require(column.values.size() == table.rows);
      require(column.missing <= table.rows && column.text_cells <= column.missing);
      require(column.remainder.empty() || column.remainder.size() == table.rows);
    }
    for (std::size_t row = 0; row < table.rows; ++row) require(table.line_of_row(row) > 0);
  });
}

void yaml(std::string_view bytes) {
  refused_or_done(
      [&] { require(nodes_of(parse_yaml(std::string(bytes), "model.yaml"), 0) <= 200'000); });
}

void model_file(std::string_view bytes) {
  const std::string text(bytes);
  if (text.find("include") != std::string::npos) return;  // would open files of any name
  for (const FormulaReading reading : {FormulaReading::linear, FormulaReading::as_written}) {
    refused_or_done([&] {
      Model model = parse_model_file(text, "model.yaml", reading);
      set_parameter(model, "q=2");
    });
  }
}

void result(std::string_view bytes) {
  const std::string text(bytes);
  if (text.find("include") != std::string::npos) return;
  refused_or_done([&] {
    StoredResult given;
    given.path = "result.json";
    given.text = text;
    const StoredResult stored = parse_stored_result(given);
    refused_or_done([&] { estimated_model(stored.estimate, stored.path); });
    refused_or_done([&] { estimated_model_text(stored.estimate, stored.path); });
    for (const std::string& name : export_formats()) {
      refused_or_done([&] { export_text(stored, *export_format(name)); });
    }
  });
}

}  // namespace identikal::fuzz
