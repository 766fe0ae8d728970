#include "studies/axis_ticks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include <fmt/format.h>

namespace identikal {
namespace {

constexpr double kRounding = 1e-9;  // of a step: on the axis' end is on the axis

void check(double low, double high, int most) {
  if (!(low < high) || !std::isfinite(low) || !std::isfinite(high) || most < 1) {
    throw std::invalid_argument(fmt::format("axis from {} to {} with {} ticks", low, high, most));
  }
}

// The largest e with 10^e <= x.
int exponent_of(double x) { return static_cast<int>(std::floor(std::log10(x) + kRounding)); }

std::string power_of_ten(int exponent) {
  static const char* const kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out = exponent < 0 ? "10⁻" : "10";
  for (const char c : std::to_string(std::abs(exponent))) out += kDigits[c - '0'];
  return out;
}

std::string fixed(double v, int decimals) {
  std::string out = fmt::format("{:.{}f}", std::abs(v), decimals);
  return v < 0.0 ? "−" + out : out;
}

struct Step {
  double size;
  int exponent;  // of its power of ten
  int parts;     // that minor ticks cut it into
};

Step step_of(double extent, int most) {
  const int exponent = exponent_of(extent / most);
  for (const auto& [digit, parts] : {std::pair{1, 5}, {2, 4}, {5, 5}}) {
    const double size = digit * std::pow(10.0, exponent);
    if (extent <= most * size * (1.0 + kRounding)) return {size, exponent, parts};
  }
  return {std::pow(10.0, exponent + 1), exponent + 1, 5};
}

// Whole multiples of step in [low, high].
std::vector<double> multiples(double low, double high, double step) {
  std::vector<double> out;
  const double last = std::floor(high / step + kRounding);
  for (double k = std::ceil(low / step - kRounding); k <= last; k += 1.0) out.push_back(k * step);
  return out;
}

}  // namespace

AxisTicks linear_ticks(double low, double high, int most) {
  check(low, high, most);
  const Step step = step_of(high - low, most);
  const std::vector<double> major = multiples(low, high, step.size);
  double largest = 0.0;
  for (const double v : major) largest = std::max(largest, std::abs(v));
  const int exponent = largest > 0.0 ? exponent_of(largest) : 0;
  const bool plain = exponent < 5 && exponent >= -3;
  AxisTicks out;
  for (const double v : major) {
    std::string label;
    if (plain) {
      label = fixed(v, std::max(0, -step.exponent));
    } else if (v == 0.0) {
      label = "0";
    } else {
      label = fixed(v / std::pow(10.0, exponent), exponent - step.exponent) + "·" +
              power_of_ten(exponent);
    }
    out.major.push_back({v, label});
  }
  out.minor = multiples(low, high, step.size / step.parts);
  return out;
}

AxisTicks logarithmic_ticks(double low, double high, int most) {
  check(low, high, most);
  if (low <= 0.0) throw std::invalid_argument("a logarithmic axis begins above zero");
  const double first = std::log10(low), last = std::log10(high);
  const bool few = last - first < 2.0;
  const int every = std::max(1, static_cast<int>(std::ceil((last - first) / most)));
  AxisTicks out;
  for (int e = static_cast<int>(std::floor(first)); e <= last + kRounding; ++e) {
    for (int digit = 1; digit < 10; ++digit) {
      const double v = digit * std::pow(10.0, e);
      if (v < low * (1.0 - kRounding) || v > high * (1.0 + kRounding)) continue;
      if (few ? digit == 1 || digit == 2 || digit == 5 : digit == 1 && e % every == 0) {
        out.major.push_back({v, few ? fmt::format("{:g}", v) : power_of_ten(e)});
      } else if (every == 1 || digit == 1) {
        out.minor.push_back(v);
      }
    }
  }
  return out;
}

}  // namespace identikal
