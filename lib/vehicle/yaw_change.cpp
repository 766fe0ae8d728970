#include "lib/vehicle/yaw_change.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "lib/base/constants.h"
#include "lib/base/median.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSteady = 0.15;  // swings of a period of 20 s have it
constexpr int kFewest = 4, kFewestLevels = 5;
constexpr double kGap = 3.0;  // [sampling periods]

/// Mean of the samples of a block, and the variance that noise leaves it.
struct Block {
  double mean = kNaN, noise = 0.0;
};

Block block_of(const Eigen::Ref<const VectorXd>& r) {
  const Index n = r.size();
  Block out{r.mean()};
  if (n < 3) return out;
  const VectorXd x = VectorXd::LinSpaced(n, -1.0, 1.0);
  const double slope = x.dot(r) / x.squaredNorm();
  const double scatter =
      (r - slope * x).array().square().sum() - static_cast<double>(n) * out.mean * out.mean;
  out.noise = std::max(0.0, scatter) / static_cast<double>(n * (n - 2));
  return out;
}

/// The least step between two values; 0 of few: they are no scale of a sensor.
double least_step(const VectorXd& r) {
  std::vector<double> values;
  for (const double x : r) {
    if (std::isfinite(x)) values.push_back(x);
  }
  std::sort(values.begin(), values.end());
  double out = kInfinity;
  int levels = 1;
  for (std::size_t i = 1; i < values.size(); ++i) {
    if (!(values[i] > values[i - 1])) continue;
    out = std::min(out, values[i] - values[i - 1]);
    ++levels;
  }
  return levels < kFewestLevels ? 0.0 : out;
}

/// Rows that a block from `first` on goes over without a gap or a missing sample; less than `n`:
/// there is none.
Index unbroken_rows(const VectorXd& time, const VectorXd& r, double usual, Index first, Index n) {
  Index k = first;
  while (k < first + n && std::isfinite(r[k])) {
    if (k > first && !(time[k] > time[k - 1] && time[k] - time[k - 1] < kGap * usual)) break;
    ++k;
  }
  return k - first;
}

}  // namespace

double yaw_change(const VectorXd& time, const VectorXd& r, double block) {
  const Index N = time.size();
  if (N < 2) return kNaN;
  const VectorXd steps = time.tail(N - 1) - time.head(N - 1);
  const double usual = median(std::vector<double>(steps.begin(), steps.end()));
  if (!(usual > 0.0)) return kNaN;
  const auto n = std::max<Index>(1, std::llround(block / usual));
  const double of_steps = std::pow(least_step(r), 2) / 12.0;
  double size = 0.0, change = 0.0;
  int blocks = 0;
  Block last;
  Index end = -1;  // of the last block
  for (Index k = 0; k + n <= N;) {
    const Index rows = unbroken_rows(time, r, usual, k, n);
    if (rows < n) {
      k += std::max<Index>(rows, 1);
      continue;
    }
    const Block here = block_of(r.segment(k, n));
    size += here.mean * here.mean;
    if (k == end && time[k] - time[k - 1] < kGap * usual && time[k] > time[k - 1]) {
      change += std::pow(here.mean - last.mean, 2) - here.noise - last.noise - 2.0 * of_steps;
    }
    last = here;
    ++blocks;
    k = end = k + n;
  }
  if (blocks < kFewest || !(size > 0.0)) return kNaN;
  return std::sqrt(std::max(0.0, change) / size);
}

bool turns_steadily(const VectorXd& time, const VectorXd& r) {
  return yaw_change(time, r, 0.5) < kSteady && yaw_change(time, r, 0.125) < 0.5 * kSteady;
}

}  // namespace identikal
