#include "identify/noise/likelihood_profile.h"

#include <algorithm>
#include <cmath>

namespace identikal {
namespace {

constexpr double kDeepEnough = 7.7;     // twice the 95 % quantile of chi-square with 1 degree
constexpr double kFirstStep = 0.35;     // standard errors
constexpr int kMostPointsOfASide = 14;  // on a side
constexpr double kEvenDrop = 0.5;       // of sqrt(drop) from point to point

}  // namespace

LikelihoodProfile walk_profile(
    double at, double se, double lower, double upper,
    const std::function<std::optional<double>(double value, bool turned)>& drop) {
  LikelihoodProfile out;
  for (const double sign : {-1.0, 1.0}) {
    std::vector<double> values, drops;
    const double bound = sign < 0.0 ? lower : upper;
    double value = at, root = 0.0, step = kFirstStep * se;
    for (int k = 0; k < kMostPointsOfASide && value != bound && root * root < kDeepEnough; ++k) {
      double next = value + sign * step;
      if (sign * (next - bound) > 0.0) next = bound;
      const std::optional<double> fallen = drop(next, k == 0);
      if (!fallen || !std::isfinite(*fallen)) break;
      values.push_back(next);
      drops.push_back(*fallen);
      // The root of the drop is close to linear: points come evenly spaced in it.
      const double slope = (std::sqrt(*fallen) - root) / std::abs(next - value);
      root = std::sqrt(*fallen);
      value = next;
      step = slope > 0.0 ? std::clamp(kEvenDrop / slope, 0.5 * step, 2.0 * step) : 2.0 * step;
    }
    if (sign < 0.0) {
      std::reverse(values.begin(), values.end());
      std::reverse(drops.begin(), drops.end());
    }
    out.value.insert(out.value.end(), values.begin(), values.end());
    out.drop.insert(out.drop.end(), drops.begin(), drops.end());
    if (sign < 0.0) {
      out.value.push_back(at);
      out.drop.push_back(0.0);
    }
  }
  return out;
}

}  // namespace identikal
