// What a filter's states are expected to lose is what they lose in simulations whose truth is known,
// and the status follows it.
#include "identify/noise/expected_errors.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/model/extension.h"
#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;

const char* const kLevel = R"(identikal: 1
name: level
time: {kind: discrete, step: 1 s, column: t}
parameters: {q: {value: 0.01, min: 0}, r: {value: 0.29, min: 0}}
states: [x]
dynamics: {x: x}
outputs: {y: {column: y, equals: x}}
noise: {process: {kind: per-sample, variance: {x: q}}, measurement: {variance: {y: r}}}
initial: {mean: {x: 0}, sd: {x: 1}}
)";
constexpr double kKept = 0.9;  // of the sensor's error, from sample to sample

struct DrivenRecording {
  Dataset recording;
  Eigen::VectorXd truth;
};

// A level whose sensor has white noise of variance 0.04 and an error that lasts, of deviation
// `lasting`.
DrivenRecording simulated(double lasting, Index rows, std::uint64_t seed) {
  Random random(seed);
  DrivenRecording out;
  Dataset& data = out.recording;
  data.name = "drive";
  data.dt = 1.0;
  data.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1));
  data.y.resize(1, rows);
  data.u.resize(0, rows);
  data.outputs = {{"y", ""}};
  out.truth.resize(rows);
  double x = random.normal(), error = lasting * random.normal();
  for (Index t = 0; t < rows; ++t) {
    out.truth[t] = x;
    data.y(0, t) = x + error + 0.2 * random.normal();
    x += 0.1 * random.normal();
    error = kKept * error + lasting * std::sqrt(1.0 - kKept * kKept) * random.normal();
  }
  return out;
}

Model with_lasting_error(const YamlNode& root, double deviation) {
  Model out = model_of(extended(root, {ExtensionKind::lasting_error, {"y"}, {0.5}}, 1.0), "more");
  const auto set = [&](const std::string& name, double value) {
    out.parameters[static_cast<std::size_t>(find_parameter(out.parameters, name))].value(0, 0) =
        value;
  };
  set("r", 0.04);
  set("sd_y", deviation);
  set("tau_y", -1.0 / std::log(kKept));
  return out;
}

TEST(ExpectedErrors, AreThoseOfTheSimulation) {
  const YamlNode root = parse_yaml(kLevel, "level.yaml");
  const Model model = model_of(root, "level.yaml");
  const DrivenRecording drive = simulated(0.5, 40000, 1);
  const Model right = with_lasting_error(root, 0.5);
  const auto expected = errors_if_right(model, right, {drive.recording});
  ASSERT_TRUE(expected);
  const FilterResult own = run_filter(model, model.parameters, drive.recording);
  const FilterResult best = run_filter(right, right.parameters, drive.recording);
  double squares = 0.0, least = 0.0, nees = 0.0;
  for (Index t = 8000; t < drive.truth.size(); ++t) {
    const auto at = static_cast<std::size_t>(t);
    const double e = own.x_filt(0, t) - drive.truth[t], b = best.x_filt(0, t) - drive.truth[t];
    squares += e * e;
    least += b * b;
    nees += e * e / own.P_filt[at](0, 0);
  }
  const double rows = static_cast<double>(drive.truth.size() - 8000);
  EXPECT_GT(nees / rows, 1.5);
  EXPECT_NEAR(expected->nees, nees / rows, 0.1 * nees / rows);
  const double found = std::sqrt(squares / least) - 1.0;
  EXPECT_GT(found, 0.01);
  EXPECT_NEAR(expected->excess, found, 0.25 * found);
  EXPECT_EQ(expected->worst_state, "x");
}

NoiseEstimate judged(const DrivenRecording& drive, const ExpectedErrorsOptions& further = {}) {
  const YamlNode root = parse_yaml(kLevel, "level.yaml");
  const Model model = model_of(root, "level.yaml");
  NoiseMlOptions options;
  options.starts = 1;
  options.profiles = false;
  NoiseEstimate out = tune_ml(model, {drive.recording}, options);
  judge_by_expected_errors(root, model, {drive.recording}, out, further);
  return out;
}

bool has(const NoiseEstimate& estimate, FindingCode code, Severity severity) {
  return std::any_of(estimate.findings.begin(), estimate.findings.end(),
                     [&](const Finding& f) { return f.code == code && f.severity == severity; });
}

TEST(ExpectedErrors, LargeOnesAreNotTrusted) {
  const NoiseEstimate estimate = judged(simulated(0.5, 3000, 2));
  EXPECT_EQ(estimate.status, Status::untrusted);
  ASSERT_TRUE(has(estimate, FindingCode::expected_errors, Severity::serious));
  const auto size =
      std::find_if(estimate.derived.begin(), estimate.derived.end(),
                   [](const DerivedValue& each) { return each.name == "expected NEES"; });
  ASSERT_NE(size, estimate.derived.end());
  EXPECT_GT(size->value, 1.5);
}

TEST(ExpectedErrors, TrialsThatAreStoppedSayNothing) {
  DrivenRecording drive = simulated(0.0, 20000, 3);
  for (Index t = 500; t < drive.truth.size(); t += 797) drive.recording.y(0, t) += 2.0;
  ExpectedErrorsOptions further;
  further.progress = [](const ModelExtension&) { return false; };
  const NoiseEstimate estimate = judged(drive, further);
  EXPECT_EQ(estimate.status, Status::untrusted);
  EXPECT_TRUE(estimate.derived.empty());
}

// Outliers 797 rows apart: no third or fifth row alone has all of them.
// Innovations that a test rejects beyond doubt, and a filter that loses nothing worth a word.
TEST(ExpectedErrors, SmallOnesLeaveTheResultInForce) {
  DrivenRecording drive = simulated(0.0, 20000, 3);
  for (Index t = 500; t < drive.truth.size(); t += 797) drive.recording.y(0, t) += 2.0;
  const NoiseEstimate estimate = judged(drive);
  EXPECT_EQ(estimate.status, Status::ok) << estimate.message;
  EXPECT_TRUE(has(estimate, FindingCode::expected_errors, Severity::note));
  for (const Finding& finding : estimate.findings) {
    EXPECT_NE(finding.severity, Severity::serious) << finding.text;
  }
  for (const EstimatedParameter& p : estimate.parameters) EXPECT_EQ(p.verdict, Verdict::ok);
}

// Growth that levels off, taken for growth without end: no noise moves the state, whose errors are those
// of the parameters.
TEST(ExpectedErrors, AreNoMeasureWhereNoNoiseMovesTheStates) {
  const YamlNode root = parse_yaml(R"(identikal: 1
time: {kind: discrete, step: 1 s, column: t}
parameters: {a: {value: 1.01, min: 0.5, max: 2}, x0: {value: 1, min: 0.01, max: 100}, r: {value: 1, min: 0}}
states: [x]
dynamics: {x: a*x}
outputs: {y: {column: y, equals: x}}
noise: {measurement: {variance: {y: r}}}
initial: {mean: {x: x0}}
)",
                                   "growth.yaml");
  const Model model = model_of(root, "growth.yaml");
  DrivenRecording drive = simulated(0.0, 200, 7);
  Random random(8);
  for (Index t = 0; t < 200; ++t) {
    const double u = static_cast<double>(t) / 20.0;
    drive.recording.y(0, t) = 10.0 * std::tanh(u) + 0.3 * random.normal();
  }
  NoiseEstimate out = tune_ml(model, {drive.recording}, {});
  judge_by_expected_errors(root, model, {drive.recording}, out, {});
  EXPECT_EQ(out.status, Status::untrusted);
  EXPECT_TRUE(has(out, FindingCode::coloured_innovations, Severity::serious));
  EXPECT_FALSE(has(out, FindingCode::expected_errors, Severity::note));
}

TEST(ExpectedErrors, ARightModelIsNotAsked) {
  const NoiseEstimate estimate = judged(simulated(0.0, 2000, 5));
  EXPECT_EQ(estimate.status, Status::ok);
  EXPECT_TRUE(estimate.derived.empty());
}

}  // namespace
}  // namespace identikal
