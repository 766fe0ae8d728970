// Does ik_run() take whatever a program hands over?
#include "tests/interface/calls.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "interface/identikal.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace identikal {
namespace {

using testing::HasSubstr;

TEST(Calls, TuneAndWhatItGives) {
  const std::vector<double> y = walk(200);
  const Result tuned("tune", kLevel, {recording_of(y)}, R"({"starts": 1})");
  EXPECT_EQ(tuned.code, 0) << tuned.message();
  EXPECT_THAT(tuned.json(), HasSubstr("\"log_likelihood\""));
  std::size_t rows = 0, cols = 0;
  const double* measured = ik_result_series(tuned.handle, "measured", &rows, &cols);
  ASSERT_EQ(rows, y.size());
  ASSERT_EQ(cols, 1u);
  EXPECT_EQ(std::vector<double>(measured, measured + rows), y);
  EXPECT_EQ(ik_result_series(tuned.handle, "no such", &rows, &cols), nullptr);
  EXPECT_EQ(rows, 0u);
  EXPECT_THAT(ik_result_report_html(tuned.handle), HasSubstr("</html>"));
}

TEST(Calls, EveryMistakeIsOneLine) {
  const std::vector<double> y = walk(50);
  const ik_recording good = recording_of(y);
  ik_recording empty = good, none = good, two = good, infinite = good, backwards = good;
  empty.rows = 0;
  none.y = nullptr;
  two.ny = 2;
  two.rows = 25;
  std::vector<double> with_infinity = y;
  with_infinity[7] = std::numeric_limits<double>::infinity();
  infinite.y = with_infinity.data();
  std::vector<double> times(y.size(), 0.0);
  backwards.time = times.data();
  const char* const no_names[] = {nullptr};
  ik_recording nameless = good;
  nameless.names = no_names;
  ik_recording other_step = good;
  other_step.step = 0.5;
  ik_recording endless = good, foreign = good;
  endless.rows = std::numeric_limits<std::size_t>::max() / 2 + 1;
  endless.ny = 2;
  const char* const furlong[] = {"furlong"};
  foreign.units = furlong;
  const Result nothing("tune", kLevel, {});
  struct Case {
    const char *verb, *model, *options;
    std::vector<ik_recording> recordings;
    const char* says;
  };
  const Case cases[] = {
      {nullptr, kLevel, nullptr, {good}, "verb is NULL"},
      {"tun", kLevel, nullptr, {good}, "did you mean 'tune'"},
      {"info", kLevel, nullptr, {good}, "unknown verb 'info'"},
      {"tune", nullptr, nullptr, {good}, "model_yaml is NULL"},
      {"tune", "", nullptr, {good}, "<model>"},
      {"tune", "identikal: 1\nA: [[1]]\n", nullptr, {good}, "<model>"},
      {"tune", kLevel, nullptr, {}, "without a recording"},
      {"tune", kLevel, "[]", {good}, "no JSON object"},
      {"tune", kLevel, "{", {good}, "no JSON: they break at byte 2"},
      {"tune", kLevel, R"({"starts": 1e991})", {good}, "a number that is too large"},
      {"tune", kLevel, R"({"start": 1})", {good}, "unknown option 'start'"},
      {"tune", kLevel, R"({"json": true})", {good}, "unknown option 'json'"},
      {"tune", kLevel, R"({"starts": 0})", {good}, "a whole number from 1 to 1000"},
      {"tune", kLevel, R"({"starts": 1.5})", {good}, "a whole number from 1 to 1000"},
      {"tune", kLevel, R"({"starts": null})", {good}, "a text or a number"},
      {"tune", kLevel, R"({"iterate": 1})", {good}, "true or false"},
      {"tune", kLevel, R"({"range": ["1:2", "3:4"]})", {good}, "one value"},
      {"tune", kLevel, nullptr, {empty}, "has no rows"},
      {"tune", kLevel, nullptr, {none}, "y is NULL"},
      {"tune", kLevel, nullptr, {two}, "2 outputs and 0 inputs"},
      {"tune", kLevel, nullptr, {infinite}, "row 8 holds an infinite value"},
      {"tune", kLevel, nullptr, {backwards}, "0 s apart"},
      {"tune", kLevel, nullptr, {nameless}, "name 1 of 1 is NULL"},
      {"tune", kLevel, nullptr, {other_step}, "the model's step"},
      {"track", kLevel, nullptr, {good, good}, "with 2 recordings"},
      {"tune", kLevel, nullptr, {endless}, "are more than any memory"},
      {"tune", kLevel, nullptr, {foreign}, "the unit of 'y' is unknown: 'furlong'"},
      {"validate", kLevel, nullptr, {good}, "'validate' with a model"},
      {"compare", kLevel, nullptr, {good}, "'compare' with a model"},
      {"compare", nullptr, nullptr, {good}, "'compare' with 1 recordings"},
      {"validate", nullptr, nullptr, {good}, "0 previous results"},
      {"compare", nullptr, nullptr, {}, "0 previous results"},
  };
  for (const Case& c : cases) {
    const Result result(c.verb, c.model, c.recordings, c.options);
    EXPECT_EQ(result.code, 2) << c.says << ": " << result.message();
    EXPECT_THAT(result.message(), HasSubstr(c.says));
    EXPECT_EQ(result.message().find('\n'), std::string::npos) << result.message();
    EXPECT_EQ(result.json(), "");
  }
  EXPECT_EQ(ik_run("tune", kLevel, nullptr, 3, nullptr, 0, nullptr, nullptr, nullptr), 2);
  EXPECT_EQ(ik_run("tune", kLevel, &good, 1, nullptr, 3, nullptr, nullptr, nullptr), 2);
  EXPECT_STREQ(ik_result_json(nullptr), "");
  EXPECT_EQ(ik_result_series(nullptr, "time", nullptr, nullptr), nullptr);
  EXPECT_STREQ(ik_result_report_html(nullptr), "");
  ik_result_free(nullptr);
}

TEST(Calls, AFailedResultIsNoPreviousOne) {
  const std::vector<double> y = walk(50);
  const Result failed("tune", kLevel, {});
  const Result validated("validate", nullptr, {recording_of(y)}, nullptr, {failed.handle});
  EXPECT_EQ(validated.code, 2);
  EXPECT_THAT(validated.message(),
              HasSubstr("previous result 1 is of 'tune' and holds no estimate"));
  ik_filter* filter = nullptr;
  EXPECT_EQ(ik_filter_open(failed.handle, nullptr, &filter), 2);
  EXPECT_THAT(ik_filter_message(filter), HasSubstr("the result is of 'tune' and holds no model"));
  ik_filter_free(filter);
}

TEST(Calls, ACallbackStops) {
  const std::vector<double> y = walk(100);
  const ik_recording recording = recording_of(y);
  int calls = 0;
  ik_callbacks callbacks{};
  callbacks.size = sizeof callbacks;
  callbacks.user = &calls;
  callbacks.progress = [](void* user, const char* what, double, double) {
    ++*static_cast<int*>(user);
    return std::strlen(what) > 0 ? 0 : 1;
  };
  ik_result* result = nullptr;
  ik_run("tune", kLevel, &recording, 1, nullptr, 0, nullptr, &callbacks, &result);
  EXPECT_EQ(calls, 1);
  EXPECT_THAT(ik_result_message(result), HasSubstr("stopped by the caller"));
  ik_result_free(result);
  // Draws that are on their way are none of the posterior.
  const char* const three =
      "identikal: 1\nname: decay\ntime: {step: 1 s}\n"
      "parameters: {a: {value: 0.9, min: 0.1, max: 0.99},\n"
      "  q: {value: 1, min: 0}, r: {value: 1, min: 0}}\n"
      "A: [[a]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\noutputs: {y: {column: y}}\n";
  const int code = ik_run("tune", three, &recording, 1, nullptr, 0, R"({"method": "bayes"})",
                          &callbacks, &result);
  EXPECT_EQ(code, 3) << ik_result_message(result);
  EXPECT_THAT(ik_result_message(result), HasSubstr("stopped by the caller"));
  ik_result_free(result);
}

// Sample by sample as in one go.
TEST(Calls, AFilterTakesOneSampleAfterTheOther) {
  std::vector<double> y = walk(300);
  y[40] = y[41] = std::numeric_limits<double>::quiet_NaN();
  const Result tuned("tune", kLevel, {recording_of(y)}, R"({"starts": 1})");
  const Result recorded("filter", kLevel, {recording_of(y)}, nullptr, {tuned.handle});
  ASSERT_EQ(recorded.code, 0) << recorded.message();
  std::size_t rows = 0;
  const double* states = ik_result_series(recorded.handle, "states", &rows, nullptr);
  const double* deviations = ik_result_series(recorded.handle, "state_sd", nullptr, nullptr);
  ASSERT_EQ(rows, y.size());
  ik_filter* filter = nullptr;
  ASSERT_EQ(ik_filter_open(tuned.handle, nullptr, &filter), 0) << ik_filter_message(filter);
  EXPECT_EQ(ik_filter_states(filter), 1u);
  EXPECT_EQ(ik_filter_inputs(filter), 0u);
  EXPECT_EQ(ik_filter_outputs(filter), 1u);
  for (std::size_t t = 0; t < rows; ++t) {
    double state = 0.0, sd = 0.0, innovation = 0.0;
    ASSERT_EQ(ik_filter_step(filter, &y[t], nullptr, &state, &sd, &innovation), 0);
    EXPECT_NEAR(state, states[t], 1e-12 * std::abs(states[t]));
    EXPECT_NEAR(sd, deviations[t], 1e-12 * sd);
    EXPECT_EQ(std::isnan(innovation), t == 0 || std::isnan(y[t])) << t;
  }
  EXPECT_EQ(ik_filter_step(filter, nullptr, nullptr, nullptr, nullptr, nullptr), 2);
  EXPECT_EQ(ik_filter_step(filter, y.data(), nullptr, nullptr, nullptr, nullptr), 0);
  ik_filter_free(filter);
}

TEST(Calls, WhatIsNoFilterIsNotOpened) {
  ik_filter* filter = nullptr;
  EXPECT_EQ(ik_filter_open(nullptr, nullptr, &filter), 2);
  EXPECT_THAT(ik_filter_message(filter), HasSubstr("neither a result nor a model"));
  EXPECT_EQ(ik_filter_step(filter, nullptr, nullptr, nullptr, nullptr, nullptr), 2);
  EXPECT_EQ(ik_filter_states(filter), 0u);
  ik_filter_free(filter);
  EXPECT_EQ(ik_filter_open(nullptr, "identikal: 1\n", &filter), 2);
  EXPECT_THAT(ik_filter_message(filter), HasSubstr("<model>"));
  ik_filter_free(filter);
  EXPECT_EQ(ik_filter_open(nullptr, kLevel, nullptr), 2);
  ik_filter_free(nullptr);
}

// What several threads compute is what one computes, to the last bit.
TEST(Calls, ThreadsAgree) {
  const char* const verbs[] = {"tune", "check", "filter", "bound", "track", "simulate"};
  const char* const options[] = {
      R"({"starts": 1})",     nullptr,          nullptr, R"({"rows": 50})",
      R"({"particles": 20})", R"({"rows": 20})"};
  constexpr int kThreads = 8, kJobs = 6;
  const std::vector<double> y = walk(60);
  const auto job = [&](int i) {
    const int verb = i % 6;
    const bool recorded = verb != 3 && verb != 5;
    const Result result(
        verbs[verb], kLevel,
        recorded ? std::vector<ik_recording>{recording_of(y)} : std::vector<ik_recording>{},
        options[verb]);
    const std::string json = result.json();
    return std::to_string(result.code) + json.substr(0, json.find("timing_s"));
  };
  std::vector<std::string> serial;
  for (int i = 0; i < kJobs; ++i) serial.push_back(job(i));
  std::vector<std::thread> threads;
  std::vector<int> wrong(kThreads, 0);
  for (int thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&, thread] {
      for (int i = 0; i < kJobs; ++i) wrong[thread] += job(i + thread) != serial[(i + thread) % 6];
    });
  }
  for (std::thread& each : threads) each.join();
  for (int thread = 0; thread < kThreads; ++thread) EXPECT_EQ(wrong[thread], 0) << thread;
}

}  // namespace
}  // namespace identikal
