#include "identify/model/internal/recordings_form.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/model_values.h"
#include "identify/model/own_parameters.h"
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

namespace {

const char* const kSpreadName = "sd_";

// The standard deviation between the values of a parameter, as a parameter.
Parameter spread_of(const Parameter& of, const YamlNode& node) {
  const std::string what = "spread of parameter " + in_quotes(of.name);
  Parameter out;
  out.name = kSpreadName + of.name;
  const bool relative = varies_by_logarithm(of);
  const Quantity given = parse_quantity(text_of(node, what), node.at, what);
  out.unit = relative ? "" : of.unit;
  double value = si_value(given, out.unit, node.at, what);
  if (const Unit unit = unit_or_dimensionless(out.unit); unit.offset != 0.0) {
    // A difference: the zero of a scale such as degC does not count.
    value = given.unit.empty() ? unit.scale * given.number
                               : parse_unit(given.unit)->scale * given.number;
    out.unit = "K";
  }
  if (!(value > 0.0)) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)), "above 0, the start",
                     relative ? "of a parameter that cannot be negative it is that of the "
                                "logarithm: 0.2 is about 20 %"
                              : "");
  }
  out.value = Eigen::MatrixXd::Constant(1, 1, value);
  out.min = 0.0;
  out.fixed = true;  // no likelihood of single recordings knows it
  return out;
}

}  // namespace

void add_spreads(const YamlNode& root, Model& model) {
  if (const YamlNode* spreads = find(root, "spreads")) {
    model.recordings.correlated =
        word_of(*spreads, "spreads", {"independent", "correlated"}) == "correlated";
  }
  const YamlNode* declared = find(root, "parameters");
  for (std::size_t i = 0; declared != nullptr && i < declared->keys.size(); ++i) {
    const YamlNode& body = declared->items[i];
    const YamlNode* spread = body.kind == YamlNode::Kind::mapping ? find(body, "spread") : nullptr;
    if (spread == nullptr) continue;
    const std::string& name = declared->keys[i].text;
    const int parameter = find_parameter(model.parameters, name);
    const auto own = std::find_if(model.recordings.own.begin(), model.recordings.own.end(),
                                  [&](const auto& each) { return each.parameter == parameter; });
    const Parameter& of = model.parameters[static_cast<std::size_t>(parameter)];
    if (own == model.recordings.own.end() || of.fixed) {
      throw InputError(
          spread->at, fmt::format("spread of parameter {}", in_quotes(name)),
          of.fixed ? "of one that is estimated" : "per: recording, or a label, with it");
    }
    if (of.prior.kind != Prior::Kind::none) {
      throw InputError(spread->at, fmt::format("parameter {} has a prior", in_quotes(name)),
                       "one of 'prior' and 'spread'");
    }
    if (varies_by_logarithm(of) && !(of.scalar() > 0.0)) {
      throw InputError(body.at, fmt::format("parameter {} starts at 0", in_quotes(name)),
                       "above 0: its logarithm varies between recordings");
    }
    Parameter added = spread_of(of, *spread);
    if (find_parameter(model.parameters, added.name) >= 0) {
      throw InputError(declared->keys[i].at,
                       fmt::format("{} is a parameter, and what the spread of {} is called",
                                   in_quotes(added.name), in_quotes(name)),
                       "another name of one of them");
    }
    own->spread = static_cast<int>(model.parameters.size());
    model.parameters.push_back(std::move(added));
  }
  if (const YamlNode* spreads = find(root, "spreads"); spreads && !has_population(model)) {
    throw InputError(spreads->at, "'spreads', and no parameter has a spread",
                     "per: recording, spread: NUMBER of parameters");
  }
}

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
