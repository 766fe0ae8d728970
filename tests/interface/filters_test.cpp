// Is every filter of ik_filter_open(), sample by sample, what its verb is over the whole recording?
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "interface/identikal.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/interface/calls.h"

namespace identikal {
namespace {

using testing::HasSubstr;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;

struct Filter {
  ik_filter* handle = nullptr;
  int code = -1;
  std::vector<double> state, sd, innovation, value, value_sd;
  Filter(const Filter&) = delete;
  Filter& operator=(const Filter&) = delete;
  Filter(const ik_result* result, const char* model) {
    code = ik_filter_open(result, model, &handle);
    state.resize(ik_filter_states(handle));
    sd = state;
    innovation.resize(ik_filter_outputs(handle));
    value.resize(ik_filter_parameters(handle, nullptr, nullptr));
    value_sd = value;
  }
  ~Filter() { ik_filter_free(handle); }
  int step(const double* y, const double* u) {
    const int out = ik_filter_step(handle, y, u, state.data(), sd.data(), innovation.data());
    ik_filter_parameters(handle, value.data(), value_sd.data());
    return out;
  }
  std::string message() const { return ik_filter_message(handle); }
};

// Equal to 1e-12 of the size; NaN has to meet NaN.
void expect_same(const std::vector<double>& ours, const double* theirs, double size,
                 std::size_t t) {
  for (std::size_t i = 0; i < ours.size(); ++i) {
    EXPECT_EQ(std::isnan(ours[i]), std::isnan(theirs[i])) << "entry " << i << " of sample " << t;
    if (std::isnan(ours[i]) || std::isnan(theirs[i])) continue;
    EXPECT_NEAR(ours[i], theirs[i], 1e-12 * (std::abs(theirs[i]) + size)) << i << " at " << t;
  }
}

// v(t) = u(t) + u(t-1) / 2 + 0.6 v(t-1) + noise, with gaps in both.
struct Driven {
  std::vector<double> u, v;  // deg, km/h
};
Driven driven(std::size_t rows, double gain_after) {
  const std::vector<double> noise = walk(2 * rows + 1);
  Driven out{std::vector<double>(rows), std::vector<double>(rows)};
  for (std::size_t t = 0; t < rows; ++t) {
    out.u[t] = 20.0 * (noise[t + 1] - noise[t]);
    const double gain = t < rows / 2 ? 1.0 : gain_after;
    out.v[t] = gain * out.u[t] + (t > 0 ? 0.5 * out.u[t - 1] + 0.6 * out.v[t - 1] : 0.0) +
               noise[rows + t + 1] - noise[rows + t];
  }
  out.v[30] = out.v[31] = out.u[77] = kMissing;
  return out;
}

std::string regression(const std::string& settings) {
  return "identikal: 1\nmodel: regression\ntime: {step: 0.1 s}\ninputs: {steer: {unit: deg}}\n"
         "outputs: {v: {unit: km/h}}\nregression: {" +
         settings + "}\n";
}

void expect_as_tracked(Filter& filter, const Result& tracked, const Driven& d) {
  const std::vector<double> coefficients = tracked.series("tracked"),
                            errors = tracked.series("tracked_sd"),
                            innovations = tracked.series("innovations");
  const std::size_t n = filter.state.size();
  ASSERT_EQ(coefficients.size(), n * d.v.size());
  for (std::size_t t = 0; t < d.v.size(); ++t) {
    const double y = d.v[t] / 3.6, u = d.u[t] * kPi / 180.0;
    ASSERT_EQ(filter.step(&y, &u), 0);
    expect_same(filter.state, &coefficients[n * t], 1.0, t);
    expect_same(filter.sd, &errors[n * t], 1.0, t);
    filter.innovation[0] *= 3.6;
    expect_same(filter.innovation, &innovations[t], 100.0, t);
  }
}

TEST(Filters, ARegressionIsTheTrackedOne) {
  for (const char* settings :
       {"", "inputs: 2, feedback: 1, forgetting: 0.98, delta: 0.01",
        "inputs: 2, feedback: 1, forgetting: variable, memory: 50, reset: true",
        "inputs: 1, feedback: 2, forgetting: 0.99, reset: true"}) {
    const Driven d = driven(400, 3.0);
    const std::string model = regression(settings);
    ik_recording recording = recording_of(d.v);
    recording.u = d.u.data();
    recording.nu = 1;
    const Result tracked("track", model.c_str(), {recording});
    ASSERT_FALSE(tracked.json().empty()) << tracked.message();
    Filter filter(tracked.handle, nullptr);
    ASSERT_EQ(filter.code, 0) << filter.message();
    EXPECT_EQ(ik_filter_inputs(filter.handle), 1u);
    EXPECT_TRUE(filter.value.empty());
    expect_as_tracked(filter, tracked, d);
  }
}

TEST(Filters, ARegressionThatLeavesNothingOpenNeedsNoRecording) {
  const std::string model =
      regression("inputs: 2, feedback: 1, forgetting: 0.98, delta: 0.01, reset: true");
  const Driven d = driven(300, 1.0);
  ik_recording recording = recording_of(d.v);
  recording.u = d.u.data();
  recording.nu = 1;
  const Result tracked("track", model.c_str(), {recording});
  Filter filter(nullptr, model.c_str());
  ASSERT_EQ(filter.code, 0) << filter.message();
  expect_as_tracked(filter, tracked, d);
  const double infinite = std::numeric_limits<double>::infinity();
  const std::vector<double> before = filter.state;
  EXPECT_EQ(filter.step(&infinite, &infinite), 1);
  EXPECT_EQ(filter.state, before);
  const Filter open(nullptr, regression("inputs: 2, feedback: 1, delta: 1").c_str());
  EXPECT_EQ(open.code, 2);
  EXPECT_THAT(open.message(), HasSubstr("'forgetting' of the regression is left to a recording"));
}

// Two states of which a diffuse start knows nothing; the noise of the measurement grows.
const char* const kTracker = R"(
identikal: 1
time: {kind: discrete, step: 1 s}
outputs: {y: {}}
parameters:
  q: {value: 0.1, min: 0, max: 1e6}
  r: {value: 0.5, min: 0, max: 1e6}
A: [[1, 1], [0, 0.9]]
C: [[1, 0]]
Q: [[0, 0], [0, q]]
R: [[r]]
initial: diffuse
)";

// Of that noise; from the middle on the error of measurement is `growth` times as large.
std::vector<double> measured(std::size_t rows, double growth) {
  unsigned state = 12345;
  const auto noise = [&](double variance) {
    state = 1664525u * state + 1013904223u;
    const double uniform = static_cast<double>(state >> 8) / (1u << 24) - 0.5;
    return uniform * std::sqrt(12.0 * variance);
  };
  std::vector<double> out(rows);
  double position = 100.0, speed = 0.0;
  for (std::size_t t = 0; t < rows; ++t) {
    out[t] = position + (t < rows / 2 ? 1.0 : growth) * noise(0.5);
    position += speed;
    speed = 0.9 * speed + noise(0.1);
  }
  out[0] = out[40] = out[41] = out[rows - 20] = kMissing;
  return out;
}

void expect_as_tracked(Filter& filter, const Result& tracked, const std::vector<double>& y,
                       std::size_t begin) {
  const std::vector<double> noise = tracked.series("tracked"),
                            errors = tracked.series("tracked_sd"),
                            innovations = tracked.series("innovations");
  const std::size_t k = filter.value.size();
  ASSERT_EQ(noise.size(), k * y.size());
  for (std::size_t t = 0; t < y.size(); ++t) {
    ASSERT_EQ(filter.step(&y[t], nullptr), 0);
    expect_same(filter.value, &noise[k * t], 0.0, t);
    expect_same(filter.value_sd, &errors[k * t], 0.0, t);
    expect_same(filter.innovation, &innovations[t], std::isnan(y[t]) ? 0.0 : std::abs(y[t]), t);
    EXPECT_TRUE(t < begin || (std::isfinite(filter.state[0]) && filter.sd[0] > 0.0)) << t;
  }
}

TEST(Filters, NoiseThatIsLearntIsTheTrackedOne) {
  const std::vector<double> y = measured(600, 10.0);
  const ik_recording recording = recording_of(y);
  for (const char* options :
       {R"({"adaptive": true, "particles": 60, "seed": 3})", R"({"particles": 60})"}) {
    const Result tracked("track", kTracker, {recording}, options);
    ASSERT_FALSE(tracked.json().empty()) << tracked.message();
    Filter filter(tracked.handle, nullptr);
    ASSERT_EQ(filter.code, 0) << filter.message();
    ASSERT_EQ(filter.value.size(), 2u);
    EXPECT_STREQ(ik_filter_parameter_name(filter.handle, 0), "q");
    EXPECT_STREQ(ik_filter_parameter_name(filter.handle, 1), "r");
    EXPECT_STREQ(ik_filter_parameter_name(filter.handle, 2), "");
    expect_as_tracked(filter, tracked, y, 4);
    // A hundred times the variance of the measurement: it is found and learnt.
    EXPECT_GT(filter.value[1], 10.0) << options;
    EXPECT_TRUE(std::isfinite(filter.value_sd[1])) << options;
  }
}

// While nothing changes the adaptive filter is the Kalman filter of the model file's noise.
TEST(Filters, WithoutAChangeTheAdaptiveFilterIsTheKalmanFilter) {
  const std::vector<double> y = measured(300, 1.0);
  const ik_recording recording = recording_of(y);
  const Result tracked("track", kTracker, {recording}, R"({"adaptive": true})");
  ASSERT_FALSE(tracked.json().empty()) << tracked.message();
  ASSERT_THAT(tracked.message(), HasSubstr("the noise of the model file stands"));
  Filter adaptive(tracked.handle, nullptr), kalman(nullptr, kTracker);
  ASSERT_EQ(adaptive.code, 0) << adaptive.message();
  for (std::size_t t = 0; t < y.size(); ++t) {
    ASSERT_EQ(adaptive.step(&y[t], nullptr), 0);
    ASSERT_EQ(kalman.step(&y[t], nullptr), 0);
    expect_same(adaptive.state, kalman.state.data(), 100.0, t);
    expect_same(adaptive.sd, kalman.sd.data(), 1.0, t);
    EXPECT_DOUBLE_EQ(adaptive.value[0], 0.1);
    EXPECT_TRUE(std::isnan(adaptive.value_sd[0]));
  }
}

TEST(Filters, AVehicleIsTrackedOverARecordingAlone) {
  const Filter filter(nullptr, "identikal: 1\nmodel: single-track\ntime: {column: t}\n");
  EXPECT_EQ(filter.code, 2);
  EXPECT_FALSE(filter.message().empty());
}

}  // namespace
}  // namespace identikal
