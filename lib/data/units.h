// Units at the edge: what a unit written in a file or a model means in SI.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace identikal {

/// Of metre, kilogram, second, ampere, kelvin and mole, fractions too.
using Exponents = std::array<double, 6>;

/// value in SI = scale * value + offset. Angles are without dimension, as in the SI (so N/rad and N
/// agree, 1/s and rad/s too).
struct Unit {
  double scale = 1.0;
  double offset = 0.0;
  Exponents dimension{};

  double to_si(double value) const { return scale * value + offset; }
  double from_si(double value) const { return (value - offset) / scale; }
};

/// Parses a unit: a product or quotient, from left to right, of units of the table in units.cpp
/// with powers, parentheses and numbers, e.g. "deg", "km/h", "kg m^2", "kg*m2", "N/(rad s)",
/// "m/s**2", "1/s", "1e8 m^3", "m^2.5/s", "m^(1/2)", "degC" (its offset counts only when it stands
/// alone). "g" is
/// standard gravity and "min" the minute. "", "-" and "1" are dimensionless. Case counts, but a
/// name in capitals ("KPH", "DEG") is known where it leaves no doubt.
///
/// Example:
///
///     const std::optional<Unit> unit = parse_unit("km/h");
///     if (unit) std::printf("%g m/s\n", unit->to_si(60.0));  // 16.6667
///
/// @return nothing when the text is not a unit.
std::optional<Unit> parse_unit(std::string_view text);

/// parse_unit(), and where the text is not a unit the one without dimension and of scale 1: numbers
/// are then taken as they stand. For units that were checked when they were read, and for columns
/// that may carry any text.
Unit unit_or_dimensionless(std::string_view text);

/// The SI unit of the same kind, as "m kg s^-2"; empty when it has no dimension.
std::string si_unit(const Unit& unit);

/// The known unit whose name is nearest to `text`; empty when none is near.
std::string nearest_unit(std::string_view text);

/// True when both measure the same kind of quantity, so that one converts into the other.
bool same_dimension(const Unit& a, const Unit& b);

}  // namespace identikal
