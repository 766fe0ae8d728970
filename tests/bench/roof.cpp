#include "tests/bench/roof.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/bench/roof.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace identikal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Returns operations done; the sum keeps the compiler from dropping them.
double MultiplyAdd(long rounds, double* sink) {
  const hn::ScalableTag<double> d;
  constexpr int kChains = 12;  // latency times throughput of two units, and some
  decltype(hn::Zero(d)) x[kChains];
  for (int i = 0; i < kChains; ++i) x[i] = hn::Set(d, 1.0 + 0.1 * i);
  const auto a = hn::Set(d, 0.999999), b = hn::Set(d, 1e-6);
  for (long r = 0; r < rounds; ++r) {
    for (int i = 0; i < kChains; ++i) x[i] = hn::MulAdd(x[i], a, b);
  }
  double sum = 0.0;
  for (int i = 0; i < kChains; ++i) sum += hn::GetLane(x[i]);
  *sink += sum;
  return 2.0 * kChains * static_cast<double>(hn::Lanes(d)) * static_cast<double>(rounds);
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace identikal {

HWY_EXPORT(MultiplyAdd);

namespace {
double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
}  // namespace

double fma_roof() {
  [[maybe_unused]] static volatile double sink = 0.0;
  double best = 0.0, sum = 0.0;
  for (int repeat = 0; repeat < 20; ++repeat) {
    const double begin = seconds();
    const double done = HWY_DYNAMIC_DISPATCH(MultiplyAdd)(1000000, &sum);
    best = std::max(best, done / (seconds() - begin));
  }
  sink = sum;
  return best;
}

double copy_roof() {
  std::vector<char> from(std::size_t{1} << 27, 1), to(from.size());
  double best = 0.0;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const double begin = seconds();
    std::memcpy(to.data(), from.data(), from.size());
    best = std::max(best, static_cast<double>(from.size()) / (seconds() - begin));
  }
  return best;
}

}  // namespace identikal
#endif
