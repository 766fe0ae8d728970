#include "lib/data/units.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>
#include <vector>

#include "lib/base/constants.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

struct NamedUnit {
  std::string_view name;
  Unit unit;
};

constexpr Exponents kNumber{};
constexpr Exponents kLength{1};
constexpr Exponents kMassOnly{0, 1};
constexpr Exponents kTime{0, 0, 1};
constexpr Exponents kCurrent{0, 0, 0, 1};
constexpr Exponents kTemperature{0, 0, 0, 0, 1};
constexpr Exponents kSpeed{1, 0, -1};
constexpr Exponents kAcceleration{1, 0, -2};
constexpr Exponents kRate{0, 0, -1};
constexpr Exponents kForce{1, 1, -2};
constexpr Exponents kEnergy{2, 1, -2};
constexpr Exponents kPower{2, 1, -3};
constexpr Exponents kVoltage{2, 1, -3, -1};
constexpr Exponents kCharge{0, 0, 1, 1};
constexpr Exponents kResistance{2, 1, -3, -2};
constexpr Exponents kCapacitance{-2, -1, 4, 2};
constexpr Exponents kPressure{-1, 1, -2};
constexpr Exponents kInductance{2, 1, -2, -2};
constexpr Exponents kVolume{3};
constexpr Exponents kAmount{0, 0, 0, 0, 0, 1};

constexpr double kMile = 1609.344;

// "g" is standard gravity, never the gram: vehicle files give accelerations in it and masses in kg.
// "min" is the minute. "rps" is left out on purpose: some write it for rad/s, some for rev/s.
// "nm" is there so that "NM" stays ambiguous and is refused rather than read as one of the two; MW,
// MV, MOhm, MN and MH so that capitals mean mega, and mHz so that small letters mean milli.
// "mg" is left out too: milligram to some, a thousandth of gravity to others. MJ, mPa and mF as above.
// "H" alone is the hour of "KM/H", never the henry: write 1000 mH, or V s/A.
constexpr NamedUnit kUnits[] = {
    {"%", {0.01, 0.0, kNumber}},
    {"percent", {0.01, 0.0, kNumber}},
    {"ppm", {1e-6, 0.0, kNumber}},
    {"rad", {1.0, 0.0, kNumber}},
    {"mrad", {1e-3, 0.0, kNumber}},
    {"deg", {kDegree, 0.0, kNumber}},
    {"degree", {kDegree, 0.0, kNumber}},
    {"degrees", {kDegree, 0.0, kNumber}},
    {"arcmin", {kDegree / 60.0, 0.0, kNumber}},
    {"arcsec", {kDegree / 3600.0, 0.0, kNumber}},
    {"rev", {2.0 * std::numbers::pi, 0.0, kNumber}},
    {"m", {1.0, 0.0, kLength}},
    {"nm", {1e-9, 0.0, kLength}},
    {"um", {1e-6, 0.0, kLength}},
    {"mm", {1e-3, 0.0, kLength}},
    {"cm", {1e-2, 0.0, kLength}},
    {"km", {1e3, 0.0, kLength}},
    {"in", {0.0254, 0.0, kLength}},
    {"ft", {0.3048, 0.0, kLength}},
    {"mi", {kMile, 0.0, kLength}},
    {"s", {1.0, 0.0, kTime}},
    {"sec", {1.0, 0.0, kTime}},
    {"seconds", {1.0, 0.0, kTime}},
    {"ms", {1e-3, 0.0, kTime}},
    {"us", {1e-6, 0.0, kTime}},
    {"ns", {1e-9, 0.0, kTime}},
    {"min", {60.0, 0.0, kTime}},
    {"minutes", {60.0, 0.0, kTime}},
    {"h", {3600.0, 0.0, kTime}},
    {"hr", {3600.0, 0.0, kTime}},
    {"hours", {3600.0, 0.0, kTime}},
    {"d", {86400.0, 0.0, kTime}},
    {"day", {86400.0, 0.0, kTime}},
    {"days", {86400.0, 0.0, kTime}},
    {"week", {604800.0, 0.0, kTime}},
    {"weeks", {604800.0, 0.0, kTime}},
    {"kg", {1.0, 0.0, kMassOnly}},
    {"t", {1e3, 0.0, kMassOnly}},
    {"lb", {0.45359237, 0.0, kMassOnly}},
    {"g", {9.80665, 0.0, kAcceleration}},
    {"mps", {1.0, 0.0, kSpeed}},
    {"kph", {1.0 / 3.6, 0.0, kSpeed}},
    {"kmh", {1.0 / 3.6, 0.0, kSpeed}},
    {"kmph", {1.0 / 3.6, 0.0, kSpeed}},
    {"mph", {kMile / 3600.0, 0.0, kSpeed}},
    {"kn", {1852.0 / 3600.0, 0.0, kSpeed}},
    {"Hz", {1.0, 0.0, kRate}},
    {"mHz", {1e-3, 0.0, kRate}},
    {"kHz", {1e3, 0.0, kRate}},
    {"MHz", {1e6, 0.0, kRate}},
    {"GHz", {1e9, 0.0, kRate}},
    {"rpm", {2.0 * std::numbers::pi / 60.0, 0.0, kRate}},
    {"dps", {kDegree, 0.0, kRate}},
    {"mN", {1e-3, 0.0, kForce}},
    {"N", {1.0, 0.0, kForce}},
    {"kN", {1e3, 0.0, kForce}},
    {"MN", {1e6, 0.0, kForce}},
    {"Nm", {1.0, 0.0, kEnergy}},
    {"kNm", {1e3, 0.0, kEnergy}},
    {"J", {1.0, 0.0, kEnergy}},
    {"mJ", {1e-3, 0.0, kEnergy}},
    {"kJ", {1e3, 0.0, kEnergy}},
    {"MJ", {1e6, 0.0, kEnergy}},
    {"GJ", {1e9, 0.0, kEnergy}},
    {"Wh", {3600.0, 0.0, kEnergy}},
    {"kWh", {3.6e6, 0.0, kEnergy}},
    {"MWh", {3.6e9, 0.0, kEnergy}},
    {"mW", {1e-3, 0.0, kPower}},
    {"W", {1.0, 0.0, kPower}},
    {"kW", {1e3, 0.0, kPower}},
    {"MW", {1e6, 0.0, kPower}},
    {"GW", {1e9, 0.0, kPower}},
    {"uA", {1e-6, 0.0, kCurrent}},
    {"mA", {1e-3, 0.0, kCurrent}},
    {"A", {1.0, 0.0, kCurrent}},
    {"kA", {1e3, 0.0, kCurrent}},
    {"Ah", {3600.0, 0.0, kCharge}},
    {"mAh", {3.6, 0.0, kCharge}},
    {"uV", {1e-6, 0.0, kVoltage}},
    {"mV", {1e-3, 0.0, kVoltage}},
    {"V", {1.0, 0.0, kVoltage}},
    {"kV", {1e3, 0.0, kVoltage}},
    {"MV", {1e6, 0.0, kVoltage}},
    {"mOhm", {1e-3, 0.0, kResistance}},
    {"Ohm", {1.0, 0.0, kResistance}},
    {"kOhm", {1e3, 0.0, kResistance}},
    {"MOhm", {1e6, 0.0, kResistance}},
    {"F", {1.0, 0.0, kCapacitance}},
    {"mF", {1e-3, 0.0, kCapacitance}},
    {"MF", {1e6, 0.0, kCapacitance}},
    {"uF", {1e-6, 0.0, kCapacitance}},
    {"nF", {1e-9, 0.0, kCapacitance}},
    {"pF", {1e-12, 0.0, kCapacitance}},
    {"uH", {1e-6, 0.0, kInductance}},
    {"mH", {1e-3, 0.0, kInductance}},
    {"MH", {1e6, 0.0, kInductance}},
    {"l", {1e-3, 0.0, kVolume}},
    {"dl", {1e-4, 0.0, kVolume}},
    {"ml", {1e-6, 0.0, kVolume}},
    {"mL", {1e-6, 0.0, kVolume}},
    {"Ml", {1e3, 0.0, kVolume}},
    {"Pa", {1.0, 0.0, kPressure}},
    {"hPa", {100.0, 0.0, kPressure}},
    {"kPa", {1e3, 0.0, kPressure}},
    {"mPa", {1e-3, 0.0, kPressure}},
    {"MPa", {1e6, 0.0, kPressure}},
    {"atm", {101325.0, 0.0, kPressure}},
    {"mbar", {100.0, 0.0, kPressure}},
    {"bar", {1e5, 0.0, kPressure}},
    {"psi", {6894.757293168361, 0.0, kPressure}},
    {"K", {1.0, 0.0, kTemperature}},
    {"degC", {1.0, 273.15, kTemperature}},
    {"degF", {5.0 / 9.0, 459.67 * 5.0 / 9.0, kTemperature}},
    {"mol", {1.0, 0.0, kAmount}},
    {"umol", {1e-6, 0.0, kAmount}},
    {"mmol", {1e-3, 0.0, kAmount}},
    {"kmol", {1e3, 0.0, kAmount}},
};

// Beyond this a text is not a unit; it also bounds the depth of parentheses.
constexpr std::size_t kMaxLength = 100;
constexpr double kMaxPower = 20.0;
// Fractions such as 1/3 are rounded; powers that a unit can mean are far coarser.
constexpr double kSamePower = 1e-9;

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::optional<Unit> look_up(std::string_view name) {
  for (const NamedUnit& known : kUnits) {
    if (known.name == name) return known.unit;
  }
  // A single small letter is more often a quantity (n, v, a, k) than a unit in the wrong case.
  if (name.size() == 1 && name[0] >= 'a' && name[0] <= 'z') return std::nullopt;
  const std::string wanted = lower_case(name);
  std::optional<Unit> found;
  for (const NamedUnit& known : kUnits) {
    if (lower_case(known.name) != wanted) continue;
    if (found) return std::nullopt;  // "KN" may be kilonewton or knot
    found = known.unit;
  }
  return found;
}

// Writes the signs that files use beyond ASCII in the one spelling that the parser knows.
std::string to_ascii(std::string_view text) {
  static constexpr std::pair<std::string_view, std::string_view> kSigns[] = {
      {"**", "^"},
      {"\u00B0", "deg"},
      {"\u00BA", "deg"},
      {"\u00B5", "u"},
      {"\u03BC", "u"},
      {"\u00B7", "*"},
      {"\u22C5", "*"},
      {"\u00D7", "*"},
      {"\u2212", "-"},
      {"\u00B9", "^1"},
      {"\u00B2", "^2"},
      {"\u00B3", "^3"},
      {"\u2126", "Ohm"},
      {"\u03A9", "Ohm"},
      {"\u2074", "^4"},
      {"\u207B\u00B9", "^-1"},
      {"\u207B\u00B2", "^-2"},
      {"\u207B\u00B3", "^-3"},
  };
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    bool replaced = false;
    for (const auto& [sign, ascii] : kSigns) {
      if (text.substr(i, sign.size()) != sign) continue;
      out += ascii;
      i += sign.size();
      replaced = true;
      break;
    }
    if (!replaced) out += text[i++];
  }
  return out;
}

Unit power(const Unit& base, double exponent) {
  Unit out;
  out.scale = std::pow(base.scale, exponent);
  for (std::size_t i = 0; i < out.dimension.size(); ++i)
    out.dimension[i] = base.dimension[i] * exponent;
  return out;
}

// An offset (degC) does not apply to a product: there a degree Celsius is a kelvin.
Unit product(const Unit& a, const Unit& b, double exponent_of_b) {
  Unit out = power(b, exponent_of_b);
  out.scale *= a.scale;
  for (std::size_t i = 0; i < out.dimension.size(); ++i) out.dimension[i] += a.dimension[i];
  return out;
}

bool is_sane(const Unit& unit) {
  const auto too_large = [](double exponent) { return std::abs(exponent) > 1000.0; };
  return std::isfinite(unit.scale) && unit.scale > 0.0 &&
         std::none_of(unit.dimension.begin(), unit.dimension.end(), too_large);
}

// expression = factor { ("*" | "/" | blank) factor };  factor = (number | name | "(" expression
// ")") [exponent]. Quotients are taken from left to right, as written.
class UnitParser {
 public:
  explicit UnitParser(std::string_view text) : text_(text) {}

  std::optional<Unit> parse() {
    const std::optional<Unit> unit = expression();
    return pos_ == text_.size() ? unit : std::nullopt;
  }

 private:
  char peek() const { return pos_ < text_.size() ? text_[pos_] : '\0'; }

  void skip_blanks() {
    while (peek() == ' ' || peek() == '\t') ++pos_;
  }

  std::optional<Unit> expression() {
    std::optional<Unit> result = factor();
    for (skip_blanks(); result && pos_ < text_.size() && peek() != ')'; skip_blanks()) {
      const double exponent = peek() == '/' ? -1.0 : 1.0;
      if (peek() == '/' || peek() == '*') ++pos_;
      const std::optional<Unit> next = factor();
      if (!next) return std::nullopt;
      result = product(*result, *next, exponent);
      if (!is_sane(*result)) return std::nullopt;
    }
    return result;
  }

  std::optional<Unit> factor() {
    skip_blanks();
    std::optional<Unit> base;
    bool named = false;
    if (peek() == '(') {
      ++pos_;
      base = expression();
      if (peek() != ')') return std::nullopt;
      ++pos_;
    } else if (is_digit(peek())) {
      Unit number;
      const char* end = text_.data() + text_.size();
      const auto [stop, error] = std::from_chars(text_.data() + pos_, end, number.scale);
      if (error != std::errc{}) return std::nullopt;
      pos_ = static_cast<std::size_t>(stop - text_.data());
      base = number;
    } else {
      const std::size_t begin = pos_;
      while (is_letter(peek()) || peek() == '%') ++pos_;
      base = look_up(text_.substr(begin, pos_ - begin));
      named = true;
    }
    if (!base) return std::nullopt;

    const std::size_t after_base = pos_;
    skip_blanks();
    if (peek() == '^') {
      ++pos_;
      skip_blanks();
    } else {
      // Without a sign the exponent must touch its unit: "m2", "s-1".
      pos_ = after_base;
      const bool negative = peek() == '-' && pos_ + 1 < text_.size() && is_digit(text_[pos_ + 1]);
      if (!named || !(negative || is_digit(peek()))) {
        return is_sane(*base) ? base : std::nullopt;
      }
    }
    const std::optional<double> exponent = peek() == '(' ? fraction() : decimal();
    if (!exponent || std::abs(*exponent) > kMaxPower) return std::nullopt;
    const Unit raised = power(*base, *exponent);
    return is_sane(raised) ? std::optional(raised) : std::nullopt;
  }

  // "2", "-1", "2.5"; without an exponent of its own, so that "m2e" is no unit.
  std::optional<double> decimal() {
    double value = 0.0;
    const char* end = text_.data() + text_.size();
    const auto [stop, error] =
        std::from_chars(text_.data() + pos_, end, value, std::chars_format::fixed);
    if (error != std::errc{} || !std::isfinite(value)) return std::nullopt;
    pos_ = static_cast<std::size_t>(stop - text_.data());
    return value;
  }

  // "(5/2)", "(-1)"
  std::optional<double> fraction() {
    ++pos_;
    std::optional<double> value = decimal();
    if (value && peek() == '/') {
      ++pos_;
      const std::optional<double> below = decimal();
      if (!below || *below == 0.0) return std::nullopt;
      *value /= *below;
    }
    if (!value || peek() != ')') return std::nullopt;
    ++pos_;
    return value;
  }

  std::string_view text_;
  std::size_t pos_ = 0;
};

}  // namespace

std::optional<Unit> parse_unit(std::string_view text) {
  if (text.size() > kMaxLength) return std::nullopt;
  const std::string ascii = to_ascii(text);
  const std::size_t begin = ascii.find_first_not_of(" \t");
  if (begin == std::string::npos) return Unit{};
  const std::size_t end = ascii.find_last_not_of(" \t");
  const std::string_view trimmed = std::string_view(ascii).substr(begin, end - begin + 1);
  if (trimmed == "-") return Unit{};
  return UnitParser(trimmed).parse();
}

Unit unit_or_dimensionless(std::string_view text) { return parse_unit(text).value_or(Unit{}); }

std::string si_unit(const Unit& unit) {
  constexpr std::array<const char*, 6> kNames{"m", "kg", "s", "A", "K", "mol"};
  std::string out;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    const double power = unit.dimension[i];
    if (std::abs(power) <= kSamePower) continue;
    out += (out.empty() ? "" : " ") + std::string(kNames[i]);
    if (std::abs(power - 1.0) <= kSamePower) continue;
    char text[32];
    std::snprintf(text, sizeof text, "^%.6g", power);
    out += text;
  }
  return out;
}

std::string nearest_unit(std::string_view text) {
  std::vector<std::string> names{"m/s",   "km/h",   "m/s^2", "rad/s", "deg/s",
                                 "N/rad", "kg m^2", "1/s",   "m^2",   "m^3"};
  for (const NamedUnit& known : kUnits) names.emplace_back(known.name);
  return nearest_name(text, names);
}

bool same_dimension(const Unit& a, const Unit& b) {
  return std::equal(a.dimension.begin(), a.dimension.end(), b.dimension.begin(),
                    [](double x, double y) { return std::abs(x - y) <= kSamePower; });
}

}  // namespace identikal
