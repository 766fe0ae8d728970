#include "identify/vehicle/driven_range.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/quantile.h"
#include "lib/statistics/spectrum.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// What a quantity may do beyond its range before it counts.
struct Quantity {
  std::string_view name, unit;
  double share, least;
};
constexpr Quantity kSpeedRange{"vx", "m/s", 0.1, 0.0};
constexpr Quantity kAccelerationRange{"ay", "m/s^2", 1.0 / 6.0, 0.3};
constexpr Quantity kSideslipRange{"beta", "deg", 1.0 / 3.0, 1.0};
// A linear car answers to all frequencies alike.
constexpr Quantity kFrequencyRange{"steering frequency", "Hz", kInfinity, 0.0};
constexpr Quantity kQuantities[] = {kSpeedRange, kAccelerationRange, kSideslipRange,
                                    kFrequencyRange};

DrivenRange range_of(const Quantity& quantity, const std::vector<double>& values) {
  constexpr double kLeftOut = 0.005;  // at each end
  return {std::string(quantity.name), std::string(quantity.unit), quantile(values, kLeftOut),
          quantile(values, 1.0 - kLeftOut)};
}

// The frequency below which 95 % of the steering's power lies [Hz].
std::optional<double> steering_frequency(const VehicleRun& run) {
  constexpr Index kFewest = 64;
  constexpr double kPower = 0.95;
  constexpr int kTapers = 3;
  const auto longest =
      std::max_element(run.segments.begin(), run.segments.end(),
                       [](const auto& a, const auto& b) { return a.rows < b.rows; });
  if (longest == run.segments.end() || longest->rows < kFewest) return std::nullopt;
  // In blocks that a fast Fourier transform takes well.
  const Index rows = longest->rows - (longest->rows > 512 ? longest->rows % 256 : 0);
  const VectorXd angle = run.steering.segment(longest->first, rows);
  if (angle.maxCoeff() == angle.minCoeff()) return std::nullopt;
  const Spectrum spectrum = multitaper(angle.transpose(), kTapers);
  VectorXd power(spectrum.omega.size());
  for (Index k = 0; k < power.size(); ++k) power[k] = spectrum.S[k](0, 0).real();
  double below = 0.0;
  Index k = 0;
  while (k + 1 < power.size() && (below += power[k]) < kPower * power.sum()) ++k;
  return spectrum.omega[k] / (2.0 * std::numbers::pi * run.step);
}

const Quantity& quantity_of(const DrivenRange& range) {
  return *std::find_if(std::begin(kQuantities), std::end(kQuantities) - 1,
                       [&](const Quantity& each) { return each.name == range.quantity; });
}

// A speed has two ends; the others are as good to the left as to the right.
double beyond_by(const Quantity& quantity, double fitted) {
  return std::max(quantity.share * std::abs(fitted), quantity.least);
}

bool goes_beyond(const Quantity& quantity, const DrivenRange& fitted, const DrivenRange& here) {
  if (quantity.name == kSpeedRange.name) {
    return here.low < fitted.low - beyond_by(quantity, fitted.low) ||
           here.high > fitted.high + beyond_by(quantity, fitted.high);
  }
  const auto largest = [](const DrivenRange& range) { return std::max(-range.low, range.high); };
  return largest(here) > largest(fitted) + beyond_by(quantity, largest(fitted));
}

}  // namespace

std::vector<DrivenRange> driven_ranges(const VehicleProblem& problem, const VectorXd& z) {
  std::vector<double> speed, acceleration, sideslip;
  replay(problem, z, [&](Index, const Motion& motion, double vx) {
    speed.push_back(vx);
    acceleration.push_back(vx * motion.r);
    sideslip.push_back(kDegreesPerRadian * std::atan2(motion.vy, vx));
  });
  if (speed.empty()) return {};
  std::vector<DrivenRange> out{range_of(kSpeedRange, speed),
                               range_of(kAccelerationRange, acceleration),
                               range_of(kSideslipRange, sideslip)};
  if (const auto frequency = steering_frequency(*problem.run)) {
    out.push_back(
        {std::string(kFrequencyRange.name), std::string(kFrequencyRange.unit), 0.0, *frequency});
  }
  return out;
}

std::string beyond(const std::vector<DrivenRange>& fitted, const std::vector<DrivenRange>& here) {
  std::string out;
  for (const DrivenRange& own : fitted) {
    const auto same = std::find_if(here.begin(), here.end(), [&](const DrivenRange& each) {
      return each.quantity == own.quantity;
    });
    if (same == here.end() || !goes_beyond(quantity_of(own), own, *same)) continue;
    out += fmt::format("{}{} (fitted to {})", out.empty() ? "" : ", ", in_words(*same),
                       in_words(own).substr(own.quantity.size() + 1));
  }
  return out;
}

}  // namespace identikal
