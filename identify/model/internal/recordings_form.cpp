#include "identify/model/internal/recordings_form.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/model_values.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

constexpr const char* kEachRecording = "recording";

const YamlNode* per_of(const YamlNode& parameter) {
  return parameter.kind == YamlNode::Kind::mapping ? find(parameter, "per") : nullptr;
}

int place_of(const NamedParameters& parameters, const std::string& name) {
  const auto at = std::find(parameters.names.begin(), parameters.names.end(), name);
  return at == parameters.names.end() ? -1 : static_cast<int>(at - parameters.names.begin());
}

std::vector<RecordingTable::Own> read_own(const NamedParameters& parameters) {
  std::vector<RecordingTable::Own> out;
  for (std::size_t i = 0; parameters.declared && i < parameters.names.size(); ++i) {
    const YamlNode* per = per_of(parameters.declared->items[i]);
    if (per == nullptr) continue;
    const std::string what = "per of parameter " + in_quotes(parameters.names[i]);
    const std::string& label = text_of(*per, what);
    if (!is_name(label) || place_of(parameters, label) >= 0) {
      throw InputError(per->at, fmt::format("{} is {}", what, describe(*per)),
                       "recording, or a label that the rows of 'recordings' have");
    }
    out.push_back({static_cast<int>(i), label == kEachRecording ? "" : label});
  }
  return out;
}

// A number, or the name of another parameter.
void read_value(const YamlNode& node, int parameter, NamedParameters& parameters,
                RecordingTable::Row& row) {
  const Parameter& of = parameters.set[static_cast<std::size_t>(parameter)];
  const std::string what = fmt::format("'{}' of recording '{}'", of.name, row.recording);
  const std::string& text = text_of(node, what);
  const int source = place_of(parameters, text);
  if (source < 0) {
    if (is_name(text)) {
      throw InputError(node.at, fmt::format("{} is {}", what, in_quotes(text)),
                       "a number, or a parameter", did_you_mean(text, parameters.names));
    }
    Parameter there = of;
    there.value.setConstant(si_value(parse_quantity(text, node.at, what), of.unit, node.at, what));
    check_value(there, nullptr, node.at);
    row.numbers[parameter] = there.scalar();
    return;
  }
  const std::string& unit = parameters.set[static_cast<std::size_t>(source)].unit;
  if (source == parameter ||
      !same_dimension(unit_or_dimensionless(unit), unit_or_dimensionless(of.unit))) {
    throw InputError(node.at,
                     source == parameter
                         ? fmt::format("{} is itself", what)
                         : fmt::format("{} is {}, which is in {}", what, in_quotes(text),
                                       unit.empty() ? "no unit" : in_quotes(unit)),
                     "another parameter of the same unit");
  }
  parameters.used[static_cast<std::size_t>(source)] = true;
  row.sources[parameter] = source;
}

RecordingTable::Row read_row(const YamlNode& name, const YamlNode& body,
                             const std::vector<std::string>& labels, NamedParameters& parameters) {
  RecordingTable::Row row;
  row.recording = name.text;
  row.at = name.at;
  const std::string what = fmt::format("recording '{}'", name.text);
  check_mapping(body, what);
  for (std::size_t i = 0; i < body.keys.size(); ++i) {
    const YamlNode& key = body.keys[i];
    if (const int parameter = place_of(parameters, key.text); parameter >= 0) {
      read_value(body.items[i], parameter, parameters, row);
    } else if (std::find(labels.begin(), labels.end(), key.text) != labels.end()) {
      row.labels[key.text] = text_of(body.items[i], "a label");
    } else {
      std::vector<std::string> known = parameters.names;
      known.insert(known.end(), labels.begin(), labels.end());
      throw InputError(
          key.at, fmt::format("{} has {}", what, in_quotes(key.text)),
          fmt::format("parameters{}",
                      labels.empty() ? std::string()
                                     : fmt::format(", or a label: {}", fmt::join(labels, ", "))),
          did_you_mean(key.text, known));
    }
  }
  return row;
}

}  // namespace

RecordingTable read_recordings(const YamlNode& root, NamedParameters& parameters) {
  RecordingTable out;
  out.own = read_own(parameters);
  const YamlNode* table = find(root, "recordings");
  if (table == nullptr) return out;
  check_mapping(*table, "recordings");
  std::vector<std::string> labels;
  for (const auto& own : out.own) {
    if (!own.label.empty()) labels.push_back(own.label);
  }
  for (std::size_t i = 0; i < table->keys.size(); ++i) {
    out.rows.push_back(read_row(table->keys[i], table->items[i], labels, parameters));
  }
  return out;
}

std::vector<bool> differs(const RecordingTable& table, std::size_t parameters) {
  std::vector<bool> out(parameters, false);
  for (const auto& own : table.own) out[static_cast<std::size_t>(own.parameter)] = true;
  for (const auto& row : table.rows) {
    for (const auto& [parameter, value] : row.numbers) {
      out[static_cast<std::size_t>(parameter)] = true;
    }
    for (const auto& [parameter, source] : row.sources) {
      out[static_cast<std::size_t>(parameter)] = true;
    }
  }
  return out;
}

void bound_sources(const YamlNode& root, const RecordingTable& table, NamedParameters& parameters) {
  for (const auto& row : table.rows) {
    for (const auto& [parameter, number] : row.numbers) {
      const Parameter& of = parameters.set[static_cast<std::size_t>(parameter)];
      if (number >= of.min && number <= of.max) continue;
      Parameter there = of;
      there.value.setConstant(number);
      check_value(there, nullptr,
                  find(*find(*find(root, "recordings"), row.recording), of.name)->at);
    }
    for (const auto& [parameter, source] : row.sources) {
      const Parameter& of = parameters.set[static_cast<std::size_t>(parameter)];
      Parameter& there = parameters.set[static_cast<std::size_t>(source)];
      there.min = std::max(there.min, of.min);
      there.max = std::min(there.max, of.max);
      check_value(there, nullptr, find(*parameters.declared, there.name)->at);
    }
  }
}

}  // namespace identikal
