// Does ik_filter_step() allocate? A program of its own.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "interface/identikal.h"
#include <gtest/gtest.h>

#include "tests/interface/calls.h"
#include "tests/support/counted_malloc.h"

namespace identikal {
namespace {

// Samples [from, to) that asked for memory.
int samples_that_allocate(ik_filter* filter, const std::vector<double>& y, std::size_t from,
                          std::size_t to) {
  std::vector<double> state(ik_filter_states(filter)), sd = state;
  int out = 0;
  double innovation = 0.0;
  for (std::size_t t = from; t < to; ++t) {
    const double u = std::sin(static_cast<double>(t * t));
    const double missing = std::numeric_limits<double>::quiet_NaN();
    int code = -1;
    out += allocations_of([&] {
             code = ik_filter_step(filter, t % 50 == 49 ? &missing : &y[t], &u, state.data(),
                                   sd.data(), &innovation);
           }) > 0;
    EXPECT_EQ(code, 0);
  }
  return out;
}

TEST(FilterAllocation, NoneByARegression) {
  for (const char* forgetting : {"0.98", "variable"}) {
    const std::string model =
        std::string(
            "identikal: 1\nmodel: regression\ntime: {step: 0.1 s}\ninputs: {u: {}}\n"
            "outputs: {y: {}}\nregression: {inputs: 4, feedback: 3, delta: 0.01, "
            "reset: true, forgetting: ") +
        forgetting + "}\n";
    ik_filter* filter = nullptr;
    ASSERT_EQ(ik_filter_open(nullptr, model.c_str(), &filter), 0) << ik_filter_message(filter);
    EXPECT_EQ(samples_that_allocate(filter, walk(2000), 0, 2000), 0);
    ik_filter_free(filter);
  }
}

TEST(FilterAllocation, NoneByAKalmanFilter) {
  ik_filter* filter = nullptr;
  ASSERT_EQ(ik_filter_open(nullptr, kLevel, &filter), 0) << ik_filter_message(filter);
  const std::vector<double> y = walk(2000);
  samples_that_allocate(filter, y, 0, 3);
  EXPECT_EQ(samples_that_allocate(filter, y, 3, 2000), 0);
  ik_filter_free(filter);
}

// Where noise is learnt: as the samples kept double, and where the draws are renewed.
TEST(FilterAllocation, RarelyByNoiseThatIsLearnt) {
  const std::vector<double> y = walk(2000);
  struct Case {
    const char* options;
    int most;  // samples, of 2000
  };
  for (const Case& c : {Case{R"({"adaptive": true, "set": ["q=0.083", "r=0.333"]})", 3},
                        Case{R"({"particles": 100})", 100}}) {
    const Result tracked("track", kLevel, {recording_of(y)}, c.options);
    ik_filter* filter = nullptr;
    ASSERT_EQ(ik_filter_open(tracked.handle, nullptr, &filter), 0) << ik_filter_message(filter);
    samples_that_allocate(filter, y, 0, 3);
    const int some = samples_that_allocate(filter, y, 3, 2000);
    RecordProperty("samples", some);
    EXPECT_LE(some, c.most) << c.options;
    ik_filter_free(filter);
  }
}

}  // namespace
}  // namespace identikal
