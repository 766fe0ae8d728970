// Numbers with units, parameters and channels as a model file writes them, whatever the model's
// form.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "identify/model/yaml_reader.h"
#include "lib/data/dataset.h"
#include "lib/model/parameter.h"

namespace identikal {

/// Beyond this a model is a mistake, and a covariance that it asks for might not fit into memory.
inline constexpr Eigen::Index kMaxSize = 200;

std::string_view trimmed(std::string_view text);

/// A number as written, and its unit; an empty unit means that none was written.
struct Quantity {
  double number = 0.0;
  std::string unit;
};

/// Nothing when the text does not begin with a finite number, or goes on with what cannot be a
/// unit.
std::optional<Quantity> split_quantity(std::string_view text);
std::optional<double> plain_number(std::string_view text);

/// split_quantity, or an error that begins with `what`.
Quantity parse_quantity(const std::string& text, const Location& at, const std::string& what);

/// In SI. A number without a unit is in `bare_unit`; any unit must be of that kind.
///
/// Example:
///
///     const Location at{"car.yaml", 12, 7};
///     const Quantity stiffness = parse_quantity("80 kN/rad", at, "Cf");
///     const double si = si_value(stiffness, "N/rad", at, "Cf");  // 80000
double si_value(const Quantity& quantity, const std::string& bare_unit, const Location& at,
                const std::string& what);
double read_si(const YamlNode& node, const std::string& bare_unit, const std::string& what);
double read_plain_number(const YamlNode& node, const std::string& what);

/// The value of the key when the node is a mapping that has it, else the node: where to point to
/// when {value, min, max} may be short for just the value.
const YamlNode& part_or_whole(const YamlNode& node, std::string_view key);

/// What a parameter of a built-in model is.
struct ParameterRule {
  const char* name;
  const char* si_unit;
  bool positive;
  double fallback;  ///< taken as known when the file does not name it; NaN: the file must name it
  bool (*allows)(double) = nullptr;  ///< whether a value may be so, in SI; null: any
  const char* expected = "";         ///< the same in words
};

/// Throws unless the value lies inside the parameter's bounds and is what its rule allows.
/// @param rule  nullptr: none
void check_value(const Parameter& parameter, const ParameterRule* rule, const Location& at);

/// A number (then fixed), or {value, min, max, fixed, unit, role}.
/// @param rule  nullptr: any unit, any sign
Parameter read_parameter(const std::string& name, const YamlNode& node, const ParameterRule* rule);

/// {uniform: [LOW, HIGH]}, {log-uniform: [LOW, HIGH]}, {normal: {mean, sd}} or {log-normal:
/// {median, factor}}; numbers in `unit` unless they carry one. {sd, factor} is for variances: the
/// standard deviation is log-normal, so that the variance is with sd^2 and factor^2; a bare sd is in
/// the root of `unit`. Throws unless LOW < HIGH, sd > 0, factor > 1, and what a logarithm is taken
/// of is above 0.
Prior read_prior(const YamlNode& node, const std::string& unit, const std::string& what);

/// What a channel of a built-in model is.
struct ChannelRule {
  const char* name;
  const char* si_unit;
};
/// A list of {name, column, unit, scale, offset, delay}, or a mapping of name: {column, ...}; a
/// column that is not named is called as the channel. An offset with a unit needs the channel's
/// `unit`, which it is converted to.
/// @param rules        the names that may occur; none: any name, any unit
/// @param more_keys    that a channel may have, and the caller reads
std::vector<ChannelSource> read_channels(const YamlNode& node, const std::string& what,
                                         std::span<const ChannelRule> rules,
                                         const std::vector<std::string>& more_keys = {});

/// What an output may have beside the keys of channels: a pseudo-measurement's number and standard
/// deviation, and the condition under which rows count (output_conditions.h).
inline const std::vector<std::string> kOutputKeys = {"value", "sd", "when"};
/// The standard deviation that output number `i` says itself, or nullptr.
const YamlNode* own_sd(const YamlNode& outputs, std::size_t i);

template <typename Rules>
std::vector<std::string> names_of(const Rules& rules) {
  std::vector<std::string> names;
  for (const auto& rule : rules) names.emplace_back(rule.name);
  return names;
}

}  // namespace identikal
