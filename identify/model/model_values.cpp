#include "identify/model/model_values.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <system_error>

#include <fmt/format.h>

#include "lib/data/units.h"

namespace identikal {
namespace {

Unit known_unit(const std::string& text, const Location& at, const std::string& what) {
  const std::optional<Unit> unit = parse_unit(text);
  if (!unit) {
    const std::string nearest = nearest_unit(text);
    throw InputError(at, fmt::format("{} has the unknown unit {}", what, in_quotes(text)), "",
                     nearest.empty() ? "" : fmt::format("did you mean '{}'?", nearest));
  }
  return *unit;
}

// Throws unless both units measure the same kind of quantity.
void check_unit(const std::string& unit, const std::string& like, const Location& at,
                const std::string& what) {
  if (same_dimension(known_unit(unit, at, what), known_unit(like, at, what))) return;
  throw InputError(
      at, fmt::format("{} is in {}", what, unit.empty() ? "no unit" : in_quotes(unit)),
      like.empty() ? "a number without a unit, or an angle" : "a unit like '" + like + "'");
}

std::string in_unit_of(const Parameter& parameter, double value) {
  const double shown = unit_or_dimensionless(parameter.unit).from_si(value);
  return fmt::format("{:.6g}{}{}", shown, parameter.unit.empty() ? "" : " ", parameter.unit);
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::optional<Quantity> split_quantity(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  Quantity out;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), out.number);
  if (error != std::errc{} || !std::isfinite(out.number)) return std::nullopt;
  out.unit = trimmed(text.substr(static_cast<std::size_t>(rest - text.data())));
  const auto first = static_cast<unsigned char>(out.unit.empty() ? 'm' : out.unit.front());
  const bool may_be_unit =
      std::isalpha(first) != 0 || first >= 0x80 || first == '%' || out.unit.starts_with("1/");
  return may_be_unit ? std::optional(out) : std::nullopt;
}

std::optional<double> plain_number(std::string_view text) {
  const std::optional<Quantity> quantity = split_quantity(text);
  return quantity && quantity->unit.empty() ? std::optional(quantity->number) : std::nullopt;
}

Quantity parse_quantity(const std::string& text, const Location& at, const std::string& what) {
  const std::optional<Quantity> out = split_quantity(text);
  if (!out) {
    throw InputError(at, fmt::format("{} is {}", what, in_quotes(text)),
                     "a finite number, with or without a unit",
                     text.find(',') == std::string::npos ? "" : "write a decimal point");
  }
  return *out;
}

double si_value(const Quantity& quantity, const std::string& bare_unit, const Location& at,
                const std::string& what) {
  const std::string& unit = quantity.unit.empty() ? bare_unit : quantity.unit;
  check_unit(unit, bare_unit, at, what);
  const double value = known_unit(unit, at, what).to_si(quantity.number);
  if (!std::isfinite(value)) throw InputError(at, what + " is too large");
  return value;
}

double read_si(const YamlNode& node, const std::string& bare_unit, const std::string& what) {
  return si_value(parse_quantity(text_of(node, what), node.at, what), bare_unit, node.at, what);
}

double read_plain_number(const YamlNode& node, const std::string& what) {
  const std::optional<double> number = plain_number(text_of(node, what));
  if (!number) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)), "a finite number");
  }
  return *number;
}

const YamlNode& part_or_whole(const YamlNode& node, std::string_view key) {
  const YamlNode* part = find(node, key);
  return part == nullptr ? node : *part;
}

void check_value(const Parameter& parameter, const ParameterRule* rule, const Location& at) {
  const double value = parameter.scalar();
  const std::string found =
      fmt::format("parameter '{}' is {}", parameter.name, in_unit_of(parameter, value));
  if (rule != nullptr && rule->positive && !(value > 0.0)) {
    throw InputError(at, found, "a value above 0");
  }
  if (rule != nullptr && rule->allows != nullptr && !rule->allows(value)) {
    throw InputError(at, found, rule->expected);
  }
  if (value < parameter.min) {
    throw InputError(at, found, in_unit_of(parameter, parameter.min) + " (min) or above");
  }
  if (value > parameter.max) {
    throw InputError(at, found, in_unit_of(parameter, parameter.max) + " (max) or below");
  }
}

namespace {

// By what a search moves the parameter.
void read_scale(const YamlNode& node, const YamlNode& value, Parameter& out) {
  const bool log = word_of(node, "scale", {"linear", "log"}) == "log";
  out.scale = log ? SearchScale::logarithm : SearchScale::linear;
  if (!log) return;
  if (std::isinf(out.min)) out.min = 0.0;
  if (out.min < 0.0) {
    throw InputError(node.at,
                     fmt::format("scale log of {}, whose min is {}", in_quotes(out.name),
                                 in_unit_of(out, out.min)),
                     "min of 0 or above");
  }
  if (!(out.scalar() > 0.0)) {
    throw InputError(value.at,
                     fmt::format("scale log of {}, which is {}", in_quotes(out.name),
                                 in_unit_of(out, out.scalar())),
                     "a value above 0");
  }
}

}  // namespace

Parameter read_parameter(const std::string& name, const YamlNode& node, const ParameterRule* rule) {
  const std::string what = fmt::format("parameter '{}'", name);
  Parameter out;
  out.name = name;
  out.fixed = node.kind == YamlNode::Kind::scalar;
  if (node.kind == YamlNode::Kind::list) {
    throw InputError(node.at, what + " is a list", "a number, or {value, min, max}");
  }
  if (!out.fixed) {
    std::vector<std::string> keys = {"value", "min", "max", "fixed", "unit", "role", "prior"};
    if (rule == nullptr) keys.insert(keys.end(), {"per", "spread", "scale"});
    check_keys(node, what, keys);
    required(node, "value", what, "value: NUMBER, the start");
    if (const YamlNode* fixed = find(node, "fixed")) {
      out.fixed = word_of(*fixed, "fixed", {"true", "false"}) == "true";
    }
    if (const YamlNode* role = find(node, "role")) {
      word_of(*role, "role", {"process-noise", "measurement-noise"});
    }
  }
  const YamlNode& value = part_or_whole(node, "value");
  const Quantity start = parse_quantity(text_of(value, what), value.at, what);
  const YamlNode* unit = find(node, "unit");
  if (unit != nullptr && !start.unit.empty()) {
    throw InputError(unit->at, "the unit of " + what + " is given twice", "",
                     "write it with the value or as 'unit', not both");
  }
  out.unit = unit != nullptr ? text_of(*unit, "unit") : start.unit;
  if (out.unit.empty() && rule != nullptr) out.unit = rule->si_unit;
  const Location& unit_at = unit != nullptr ? unit->at : value.at;
  check_unit(out.unit, rule != nullptr ? rule->si_unit : out.unit, unit_at, what);

  out.value = Eigen::MatrixXd::Constant(1, 1, si_value(start, out.unit, value.at, what));
  for (const auto& [key, bound] : {std::pair{"min", &out.min}, std::pair{"max", &out.max}}) {
    if (const YamlNode* given = find(node, key)) {
      *bound = read_si(*given, out.unit, fmt::format("{} of {}", key, what));
    }
  }
  if (out.min >= out.max) {
    throw InputError(part_or_whole(node, "min").at,
                     fmt::format("min {} of {} is not below max {}", in_unit_of(out, out.min), what,
                                 in_unit_of(out, out.max)));
  }
  if (const YamlNode* scale = find(node, "scale")) read_scale(*scale, value, out);
  check_value(out, rule, value.at);
  if (const YamlNode* prior = find(node, "prior")) out.prior = read_prior(*prior, out.unit, what);
  // The equations divide by what must be positive: an optimiser has to stay clear of zero itself.
  if (rule != nullptr && rule->positive && !out.fixed && !(out.min > 0.0)) {
    out.min = 1e-3 * out.scalar();
  }
  return out;
}

namespace {

double read_factor(const YamlNode& node, const std::string& prior) {
  const double factor = read_plain_number(node, prior);
  if (factor > 1.0) return factor;
  throw InputError(node.at, fmt::format("factor of {} is {}", prior, describe(node)), "above 1");
}

// A data sheet's number: the standard deviation, within a factor.
Prior read_prior_of_variance(const YamlNode& node, const std::string& unit,
                             const std::string& prior) {
  check_keys(node, prior, {"sd", "factor"});
  const char* const example = "{sd: 0.1 deg, factor: 2}";
  const YamlNode& at = required(node, "sd", prior, example);
  const double factor = read_factor(required(node, "factor", prior, example), prior);
  const Quantity sd = parse_quantity(text_of(at, prior), at.at, prior);
  if (!(sd.number > 0.0)) {
    throw InputError(at.at, fmt::format("sd of {} is {}", prior, describe(at)), "above 0");
  }
  const Unit own = known_unit(unit, at.at, prior);
  if (sd.unit.empty()) {
    return {Prior::Kind::log_normal, own.scale * sd.number * sd.number, factor * factor};
  }
  const std::string square = "(" + sd.unit + ")^2";
  // A parameter in the sd's own unit is no variance; angles have no dimension to tell by.
  if (!unit.empty() && unit == sd.unit) {
    throw InputError(at.at,
                     fmt::format("sd of {} is in {}, and so is the parameter, which is then no "
                                 "variance",
                                 prior, unit),
                     "log-normal: {median: M, factor: F}");
  }
  if (!unit.empty()) check_unit(square, unit, at.at, prior);
  const double value = known_unit(sd.unit, at.at, prior).scale * sd.number;
  return {Prior::Kind::log_normal, value * value, factor * factor};
}

}  // namespace

Prior read_prior(const YamlNode& node, const std::string& unit, const std::string& what) {
  struct Form {
    const char* name;
    Prior::Kind kind;
    const char *first, *second;  // keys; none: a list
  };
  constexpr Form kForms[] = {{"uniform", Prior::Kind::uniform, nullptr, nullptr},
                             {"log-uniform", Prior::Kind::log_uniform, nullptr, nullptr},
                             {"normal", Prior::Kind::normal, "mean", "sd"},
                             {"log-normal", Prior::Kind::log_normal, "median", "factor"}};
  const std::string prior = "prior of " + what;
  if (find(node, "sd") != nullptr || find(node, "factor") != nullptr) {
    return read_prior_of_variance(node, unit, prior);
  }
  check_keys(node, prior, names_of(kForms));
  if (node.keys.size() != 1) {
    throw InputError(node.at, fmt::format("{} has {} forms", prior, node.keys.size()), "one");
  }
  const Form& form = *std::find_if(std::begin(kForms), std::end(kForms),
                                   [&](const Form& f) { return node.keys[0].text == f.name; });
  const YamlNode& body = node.items[0];
  Prior out{form.kind, 0.0, 0.0};
  if (form.first == nullptr) {
    if (body.kind != YamlNode::Kind::list || body.items.size() != 2) {
      throw InputError(body.at, fmt::format("{} {} is {}", form.name, prior, describe(body)),
                       fmt::format("{}: [LOW, HIGH]", form.name));
    }
    out.a = read_si(body.items[0], unit, prior);
    out.b = read_si(body.items[1], unit, prior);
    if (out.a >= out.b) throw InputError(body.at, prior + " is empty", "LOW below HIGH");
  } else {
    check_keys(body, prior, {form.first, form.second});
    const std::string example =
        fmt::format("{}: {{{}: ..., {}: ...}}", form.name, form.first, form.second);
    const YamlNode& second = required(body, form.second, prior, example);
    const bool factor = form.kind == Prior::Kind::log_normal;
    out.a = read_si(required(body, form.first, prior, example), unit, prior);
    out.b = factor ? read_factor(second, prior) : read_si(second, unit, prior);
    if (!(out.b > 0.0)) {
      throw InputError(second.at,
                       fmt::format("{} of {} is {}", form.second, prior, describe(second)),
                       "above 0");
    }
  }
  const bool logarithm =
      form.kind == Prior::Kind::log_uniform || form.kind == Prior::Kind::log_normal;
  if (logarithm && !(out.a > 0.0)) throw InputError(body.at, prior + " reaches 0", "above 0");
  return out;
}

namespace {

// A number with its unit in place of a column.
void read_pseudo_value(const YamlNode& item, const YamlNode& value, ChannelSource& channel) {
  for (const char* key : {"column", "scale", "offset", "delay"}) {
    const YamlNode* other = find(item, key);
    if (other == nullptr) continue;
    throw InputError(other->at,
                     fmt::format("{} of the pseudo-measurement {}", key, in_quotes(channel.name)),
                     "one of 'value' and 'column'");
  }
  const Quantity given = parse_quantity(text_of(value, "value"), value.at, "value");
  if (channel.unit.empty()) channel.unit = given.unit;
  channel.value = si_value(given, channel.unit, value.at, "value");
  channel.column.clear();
  channel.at = value.at;
}

void read_treatment(const YamlNode& item, ChannelSource& channel) {
  if (const YamlNode* scale = find(item, "scale")) {
    channel.scale = read_plain_number(*scale, "scale");
    if (channel.scale == 0.0) {
      throw InputError(scale->at, "scale is 0", "a number that leaves something, e.g. -1");
    }
  }
  if (const YamlNode* offset = find(item, "offset")) {
    const Quantity given = parse_quantity(text_of(*offset, "offset"), offset->at, "offset");
    channel.offset = given.number;
    if (!given.unit.empty() && given.unit != channel.unit) {
      check_unit(given.unit, channel.unit, offset->at, "offset");
      // A difference: the zero of a scale such as degC does not count.
      channel.offset *= known_unit(given.unit, offset->at, "offset").scale /
                        known_unit(channel.unit, offset->at, "offset").scale;
    }
  }
  if (const YamlNode* delay = find(item, "delay")) channel.delay = read_si(*delay, "s", "delay");
}

}  // namespace

std::vector<ChannelSource> read_channels(const YamlNode& node, const std::string& what,
                                         std::span<const ChannelRule> rules,
                                         const std::vector<std::string>& more_keys) {
  const std::vector<std::string> known = names_of(rules);
  const auto count = static_cast<Eigen::Index>(node.items.size());
  if (node.kind == YamlNode::Kind::mapping) {
    check_mapping(node, what);
    if (!rules.empty()) check_keys(node, what, known);
  } else if (node.kind != YamlNode::Kind::list) {
    throw InputError(node.at, fmt::format("{} is {}", what, describe(node)),
                     "a list of {name, column, unit}, or a mapping of name: {column, unit}");
  }
  if (count == 0 || count > kMaxSize) {
    throw InputError(node.at, fmt::format("{} has {} entries", what, count),
                     fmt::format("1 to {}", kMaxSize));
  }
  const bool named_by_key = node.kind == YamlNode::Kind::mapping;
  std::vector<std::string> keys = {"column", "unit", "scale", "offset", "delay"};
  if (!named_by_key) keys.insert(keys.begin(), "name");
  keys.insert(keys.end(), more_keys.begin(), more_keys.end());
  std::vector<ChannelSource> out;
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    const YamlNode& item = node.items[i];
    ChannelSource channel;
    check_keys(item, fmt::format("entry {} of {}", i + 1, what), keys);
    const YamlNode& name =
        named_by_key ? node.keys[i] : required(item, "name", what, "name: NAME of the channel");
    channel.name = text_of(name, "a name in " + what);
    if (!rules.empty()) {
      word_of(name, "a name in " + what, known);
      const auto rule = std::find(known.begin(), known.end(), channel.name) - known.begin();
      channel.si_unit = rules[rule].si_unit;
    }
    if (std::any_of(out.begin(), out.end(),
                    [&](const auto& c) { return c.name == channel.name; })) {
      throw InputError(name.at, fmt::format("{} names {} twice", what, in_quotes(channel.name)));
    }
    const YamlNode* column = find(item, "column");
    channel.column = column != nullptr ? text_of(*column, "column") : channel.name;
    channel.at = column != nullptr ? column->at : name.at;
    if (const YamlNode* unit = find(item, "unit")) {
      channel.unit = text_of(*unit, "unit");
      check_unit(channel.unit, rules.empty() ? channel.unit : channel.si_unit, unit->at,
                 in_quotes(channel.name));
    }
    if (const YamlNode* value = find(item, "value")) read_pseudo_value(item, *value, channel);
    read_treatment(item, channel);
    if (const YamlNode* wrap = find(item, "wrap")) {
      channel.wraps = word_of(*wrap, "wrap", {"true", "false"}) == "true";
      if (channel.wraps) check_unit(channel.unit, "rad", wrap->at, in_quotes(channel.name));
      if (channel.wraps && channel.delay != 0.0) {
        throw InputError(wrap->at, "an angle that wraps has a delay",
                         "one of the two: no value lies between two that are a turn apart");
      }
    }
    if (const YamlNode* sd = find(item, "sd");
        sd != nullptr && what == "outputs" && !channel.value) {
      throw InputError(
          sd->at, fmt::format("sd of the output {}, which has a column", in_quotes(channel.name)),
          "the noise of columns under 'noise', or as R; 'sd' beside a 'value'");
    }
    out.push_back(std::move(channel));
  }
  return out;
}

const YamlNode* own_sd(const YamlNode& outputs, std::size_t i) {
  return find(outputs.items[i], "sd");
}

}  // namespace identikal
