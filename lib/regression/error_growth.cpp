#include "lib/regression/error_growth.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr Index kScaleErrors = 20;  // that only tell the variance
constexpr double kNothingYet = -kInfinity;

void begin_statistic(ErrorGrowth& test) {
  test.log_statistic.fill(kNothingYet);
  test.cumulative.fill(0.0);
  test.squares_since.fill(0.0);
  test.since.fill(0);
  test.settling = test.settle;
}

}  // namespace

ErrorGrowth start_error_growth(double samples_per_false_alarm, Index settle) {
  if (!(samples_per_false_alarm > 1.0) || settle < 0) {
    throw std::invalid_argument("start_error_growth: option out of range");
  }
  ErrorGrowth test;
  test.samples_per_false_alarm = samples_per_false_alarm;
  test.settle = settle;
  test.log_alarm = kNothingYet;
  begin_statistic(test);
  return test;
}

bool update(ErrorGrowth& test, double error) {
  if (test.settling > 0) {
    --test.settling;
    test.log_alarm = kNothingYet;
    return false;
  }
  const double square = error * error;
  if (test.errors < kScaleErrors || !(test.squares > 0.0)) {
    test.squares += square;
    ++test.errors;
    return false;
  }
  const auto nu = static_cast<double>(test.errors);
  double mean = 0.0, largest = kNothingYet;
  std::size_t best = 0;
  for (std::size_t i = 0; i < kGrowth.size(); ++i) {
    const double r = kGrowth[i];
    const double evidence = 0.5 * ((nu + 1.0) * (std::log1p(square / test.squares) -
                                                 std::log1p(square / (r * test.squares))) -
                                   std::log(r));
    double& S = test.log_statistic[i];
    S = (S > 0.0 ? S + std::log1p(std::exp(-S)) : std::log1p(std::exp(S))) + evidence;
    largest = std::max(largest, S);
    // Where the cumulative sum was lowest the growth most likely began.
    if (!(test.cumulative[i] > 0.0)) {
      test.cumulative[i] = test.squares_since[i] = 0.0;
      test.since[i] = 0;
    }
    test.cumulative[i] += evidence;
    test.squares_since[i] += square;
    ++test.since[i];
    if (test.cumulative[i] > test.cumulative[best]) best = i;
  }
  for (const double S : test.log_statistic) mean += std::exp(S - largest);
  test.log_alarm = largest + std::log(mean / static_cast<double>(kGrowth.size()));
  test.squares += square;
  ++test.errors;
  test.age = test.since[best];
  if (test.log_alarm < std::log(test.samples_per_false_alarm)) return false;
  // What the errors were like before; never less than what told the variance at first.
  const Index before = test.errors - test.since[best];
  if (before >= kScaleErrors) {
    test.squares -= test.squares_since[best];
    test.errors = before;
  }
  begin_statistic(test);
  return true;
}

}  // namespace identikal
