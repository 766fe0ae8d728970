// Is every misuse by a program named, with both sizes, before anything reads memory that is not there?
#include "identify/model/check.h"

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/run.h"
#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "identify/noise/als.h"
#include "identify/noise/auto.h"
#include "identify/noise/bayes.h"
#include "identify/noise/ml.h"
#include "identify/noise/track.h"
#include "identify/optimality/bound.h"
#include "identify/optimality/check.h"
#include "identify/optimality/compare_filters.h"
#include "identify/simulation/simulate.h"
#include "identify/survey/survey.h"
#include "identify/vehicle/fit.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::HasSubstr;

// One state that is moved by an input, and its recording.
struct Case {
  Model model = linear_model()
                    .A(0.9)
                    .B(0.5)
                    .C(1)
                    .process_noise(variance("q"))
                    .measurement_noise(variance("r"));
  Dataset data;

  Case() {
    Random random(1);
    const VectorXd y = random.normal(200), u = random.normal(200);
    data = recording(model, y, 1.0, u);
  }
};

const std::pair<const char*, std::function<void(const Case&)>> kJobs[] = {
    {"tune_ml", [](const Case& c) { tune_ml(c.model, {c.data}); }},
    {"tune_als", [](const Case& c) { tune_als(c.model, {c.data}); }},
    {"tune_auto", [](const Case& c) { tune_auto(c.model, {c.data}); }},
    {"tune_bayes", [](const Case& c) { tune_bayes(c.model, {c.data}); }},
    {"track", [](const Case& c) { track(c.model, c.data); }},
    {"check", [](const Case& c) { check(c.model, {c.data}); }},
    {"filter", [](const Case& c) { filter_recordings(c.model, {c.data}, {}); }}};

// Every job refuses the case in these words.
void expect_refused(const std::function<void(Case&)>& spoil, const std::string& words) {
  Case spoilt;
  spoil(spoilt);
  for (const auto& [name, job] : kJobs) {
    try {
      job(spoilt);
      ADD_FAILURE() << name << " took what should be refused: " << words;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(words)) << name;
    }
  }
}

TEST(Check, AProperCaseIsTaken) {
  const Case proper;
  EXPECT_NO_THROW(check_recording(proper.model, proper.data));
  EXPECT_NO_THROW(check_model(checked(proper.model, {proper.data})));
}

TEST(Check, ParametersNeedValues) {
  expect_refused([](Case& c) { c.model.parameters[0].value.resize(0, 0); },
                 "parameter 'q' has no value");
  expect_refused([](Case& c) { c.model.parameters[0].value(0, 0) = std::nan(""); },
                 "parameter 'q' is not finite");
  expect_refused(
      [](Case& c) {
        Parameter unused = c.model.parameters[0];
        unused.name = "extra";
        c.model.parameters.push_back(unused);
      },
      "parameter 'extra' is free, and nothing in the model uses it");
}

TEST(Check, TimeGoesWithTheSamples) {
  expect_refused([](Case& c) { c.data.time.conservativeResize(300); }, "300 times for 200 samples");
  expect_refused([](Case& c) { c.data.time.conservativeResize(100); }, "100 times for 200 samples");
  expect_refused([](Case& c) { c.data.time.resize(0); }, "200 samples and no time");
  expect_refused([](Case& c) { c.data.dt = 0.0; }, "sampling period is 0 s");
  expect_refused([](Case& c) { c.data.time[7] = c.data.time[6]; }, "expected times that rise");
  expect_refused([](Case& c) { c.data.time[7] = std::nan(""); }, "is not finite");
  expect_refused([](Case& c) { c.model.time.step = 0.1; },
                 "sampled every 1 s, the model every 0.1 s");
  expect_refused([](Case& c) { c.data.time.tail(100).array() += 50.0; },
                 "samples 100 and 101 are 51 s apart, and the sampling period is 1 s");
  expect_refused([](Case& c) { c.data.dt = 2.0; },
                 "samples 1 and 2 are 1 s apart, and the sampling period is 2 s");
}

TEST(Check, ChannelsGoWithTheModel) {
  expect_refused([](Case& c) { c.data.y = MatrixXd::Zero(2, 200); },
                 "the recording has 2 outputs, the model 1");
  expect_refused([](Case& c) { c.data.y.resize(0, 200); }, "no outputs");
  expect_refused([](Case& c) { c.data.outputs.clear(); }, "names 0 outputs and has 1");
  expect_refused([](Case& c) { c.data.u.resize(0, 200); }, "has 0 inputs, the model 1");
  expect_refused([](Case& c) { c.data.u = MatrixXd::Zero(1, 150); },
                 "150 samples of its inputs and 200 of its outputs");
  expect_refused([](Case& c) { c.data.u(0, 5) = std::numeric_limits<double>::infinity(); },
                 "a sample of the inputs is infinite");
  expect_refused([](Case& c) { c.data.y(0, 5) = -std::numeric_limits<double>::infinity(); },
                 "a sample of the outputs is infinite");
}

TEST(Check, MatricesHaveTheirSizes) {
  expect_refused([](Case& c) { as_linear(c.model).A.constant(0, 0) = std::nan(""); },
                 "A has an entry that is not finite");
  expect_refused([](Case& c) { as_linear(c.model).A.constant.resize(0, 0); }, "A is 0 x 0");
  expect_refused([](Case& c) { as_linear(c.model).C.constant.resize(1, 3); },
                 "C is 1 x 3; expected 1 x 1");
  expect_refused([](Case& c) { as_linear(c.model).Q.entries[0].row = 4; },
                 "Q is 1 x 1, and an entry is given for row 5, column 1");
  expect_refused([](Case& c) { as_linear(c.model).Q.entries[0].parameter = 9; },
                 "Q refers to parameter 10 of 2");
  expect_refused([](Case& c) { as_linear(c.model).S.constant(0, 0) = 5.0; }, "Q, R and S");
  expect_refused(
      [](Case& c) {
        LinearModel& m = as_linear(c.model);
        m.A.constant = 0.5 * MatrixXd::Identity(2, 2);
        m.B.constant.setZero(2, 1);
        m.C.constant.setOnes(1, 2);
        m.G.constant = MatrixXd::Identity(2, 2);
        m.S.constant.setZero(2, 1);
        m.Q.constant = (MatrixXd(2, 2) << 0, 0.5, 0, 1).finished();
      },
      "Q is not symmetric");
}

TEST(Check, MatricesLeftEmptyHaveTheirDefaults) {
  Case c;
  as_linear(c.model).D.constant.resize(0, 0);
  as_linear(c.model).G.constant.resize(0, 0);
  as_linear(c.model).S.constant.resize(0, 0);
  EXPECT_EQ(tune_ml(c.model, {c.data}).objective.log_likelihood,
            tune_ml(Case().model, {c.data}).objective.log_likelihood);
}

TEST(Check, JobsWithoutOutputsLookAtModelAndInputs) {
  const auto refused = [](const std::function<void(Case&)>& spoil, const std::string& words) {
    Case c;
    c.data.y.resize(0, 0);
    c.data.outputs.clear();
    spoil(c);
    BoundOptions options;
    options.samples = 200;
    const std::pair<const char*, std::function<void()>> jobs[] = {
        {"bound", [&] { bound_of(c.model, options, &c.data); }},
        {"simulate", [&] { simulate_linear(c.model, 200, &c.data, 1); }}};
    for (const auto& [name, job] : jobs) {
      try {
        job();
        EXPECT_EQ(words, "") << name << " took what should be refused";
      } catch (const std::invalid_argument& error) {
        EXPECT_EQ(error.what(), words) << name;
      }
    }
  };
  refused([](Case&) {}, "");
  refused([](Case& c) { c.data.u = MatrixXd::Zero(2, 200); },
          "the recording has 2 inputs, the model 1");
  refused([](Case& c) { c.data.u = MatrixXd::Zero(1, 150); },
          "the recording has 150 samples of its inputs and 200 times");
  refused([](Case& c) { c.data.time.resize(0); },
          "the recording of the inputs has no samples, or no time");
  refused([](Case& c) { c.data.time[7] = c.data.time[6]; },
          "time 6 s follows 6 s; expected times that rise");
  refused([](Case& c) { as_linear(c.model).C.constant.resize(1, 3); },
          "C is 1 x 3; expected 1 x 1 (outputs x states)");
  refused([](Case& c) { c.model.parameters[0].value.resize(0, 0); }, "parameter 'q' has no value");
}

TEST(Check, ASurveyCountsTimesAndValues) {
  VehicleSignal signal;
  signal.column = "yaw";
  signal.time = VectorXd::LinSpaced(300, 0.0, 3.0);
  signal.value = VectorXd::Zero(200);
  VehicleSignals signals;
  signals.signals = {signal};
  try {
    survey(signals);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "signal 'yaw' has 300 times and 200 values");
  }
}

TEST(Check, RecordingsShareOnePeriod) {
  Case c;
  Dataset other = c.data;
  other.dt = 0.5;
  other.time *= 0.5;
  try {
    tune_ml(c.model, {c.data, other});
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "recording 2 is sampled every 0.5 s, the first every 1 s");
  }
  EXPECT_THROW(compare_filters({c.model, c.model}, {{c.data}}), std::invalid_argument);
  EXPECT_THROW(tune_ml(vehicle_model()
                           .known("m", 1)
                           .known("a", 1)
                           .known("b", 1)
                           .known("steering_ratio", 1)
                           .parameter("Iz", 1)
                           .parameter("Cf", 1)
                           .parameter("Cr", 1)
                           .output("r"),
                       {c.data}),
               std::invalid_argument);
}

TEST(Check, StartsAreCounted) {
  const Case c;
  for (const int starts : {-1, -3}) {
    NoiseMlOptions options;
    options.starts = starts;
    EXPECT_THROW(tune_ml(c.model, {c.data}, options), std::invalid_argument);
  }
  const Model car = vehicle_model()
                        .known("m", 1446)
                        .known("a", 1)
                        .known("b", 1.5)
                        .known("steering_ratio", 21)
                        .parameter("Iz", 2000)
                        .parameter("Cf", 8e4)
                        .parameter("Cr", 8e4)
                        .output("r");
  VehicleFitOptions options;
  options.search.starts = 0;
  const Dataset drive = recording(car, MatrixXd::Zero(1, 50), 0.1, MatrixXd::Ones(2, 50));
  EXPECT_THROW(fit_vehicle(car, {drive}, options), std::invalid_argument);
  EXPECT_THROW(tune_ml(c.model, {}), std::invalid_argument);
}

TEST(Recording, TimesThatLackRowsGetMissingSamples) {
  const Case c;
  VectorXd y = c.data.y.row(0).head(20), u = c.data.u.row(0).head(20), times(20);
  for (Index k = 0; k < 20; ++k) times[k] = static_cast<double>(k < 10 ? k : k + 5);
  Model model = c.model;
  const Dataset data = recording(model, y, times, u);
  EXPECT_EQ(data.size(), 25);
  EXPECT_EQ(data.absent.size(), 5u);
  EXPECT_TRUE(std::isnan(data.y(0, 12)));
  times[15] += 0.4;
  EXPECT_THROW(recording(model, y, times, u), std::invalid_argument);
  const std::vector<double> twice(20, 1.0);
  EXPECT_THROW(recording(model, {{"y", twice}, {"y", twice}, {"u", twice}}, 1.0),
               std::invalid_argument);
}

TEST(Recording, SizesAreNamed) {
  const Case c;
  const auto refused = [](const std::function<void()>& call, const std::string& words) {
    try {
      call();
      ADD_FAILURE() << words;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  };
  const std::vector<double> y(20, 1.0), u(10, 1.0);
  refused([&] { recording(c.model, y, 1.0, u); }, "10 samples of its inputs and 20 of its outputs");
  refused([&] { recording(c.model, y, 1.0); }, "the recording has 0 inputs, the model 1");
  refused([&] { recording(c.model, {{"y", y}}, 1.0); }, "no channel 'u'");
  refused(
      [&] {
        recording(c.model, {{"y", y}, {"u", y}}, VectorXd::LinSpaced(5, 0, 1));
      },
      "5 times for 20 samples");
  refused([&] { recording(c.model, y, 0.0, y); }, "sampling period is 0 s");
}

}  // namespace
}  // namespace identikal
